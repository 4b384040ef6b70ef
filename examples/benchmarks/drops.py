"""A thousand random drops with modes in the core, and a share of them all in Python: modes, impacts and ends compared.

Each drop has a number, from which mechanism, start, restitution and friction are drawn (`random_drops`). The drops of
the core are checked against physics at each node: gaps are not negative, closed contacts push, friction is within its
limit and against the motion, the balance of energy holds, no impact gains energy. Where both back ends differ in modes,
impacts, status or end, runs at tighter tolerances decide which of them is right:

same        both agree
core        the core follows the tight runs, Python does not
Python      the reverse: the core is wrong
sensitive   tight runs differ from each other as much: a change of the start by rounding decides
unphysical  a check of the core's run fails

Run: python examples/benchmarks/drops.py [--runs N] [--python N] [--only N] [--brief]
"""

import argparse
import warnings
from collections import Counter, defaultdict
from collections.abc import Sequence
from time import process_time
from typing import NamedTuple

import numpy as np
from common import machine, ratio, table
from random_drops import KINDS, Drop, drop, gaps

import mbdae
from mbdae.errors import MbdaeError
from mbdae.mechanism.hybrid.impact import Impact
from mbdae.mechanism.hybrid.kinds.frictional_contact import FrictionalContact
from mbdae.mechanism.hybrid.kinds.joint_stiction import JointStiction
from mbdae.mechanism.hybrid.kinds.unilateral import Unilateral
from mbdae.solution.columns import residuals

Array = np.ndarray
RTOL, TIGHT = 1e-8, (1e-10, 1e-11, 1e-12)
SAME = 1e-5  # of the largest coordinate or speed, and of the duration: ends and times of transitions are the same
GAP, BALANCE, MULTIPLIER = 1e-9, 1e-6, 1e-6  # relative to 1 m, the largest energy, the largest multiplier
LEAST = 1e-3  # J: the least scale of the energy
MAX_STEPS = 50_000
BRIEF = range(40, 50)  # one of each kind, with few impacts
PASSIVE = frozenset(KINDS) - {"slider_crank_with_stop", "stick_slip_slider", "ratchet"}  # no drivers, no torques


class Outcome(NamedTuple):
    """A run: its status, transitions, impacts, its end, and what contradicts physics."""

    status: str
    t: float
    modes: list[tuple[float, tuple[int, ...]]]
    impacts: list[tuple[str, ...]]
    end: Array
    wrong: str
    seconds: float
    in_core: int


class Result(NamedTuple):
    """A drop: its outcome in the core, and how it compares with Python; not compared if empty."""

    number: int
    kind: str
    core: Outcome
    python: Outcome | None
    verdict: str
    text: str


def outcome(d: Drop, backend: str, rtol: float = RTOL) -> Outcome:
    """Compute a drop."""
    began = process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            sol = mbdae.solve(d.mechanism, (0, d.end), d.q, d.v, rtol=rtol, backend=backend, max_steps=MAX_STEPS)
        except MbdaeError as e:
            return Outcome(type(e).__name__, 0.0, [], [], np.zeros(0), str(e), process_time() - began, 0)
    seconds = process_time() - began
    modes = [(float(sol.t[i]), mode) for i, mode in sol.modes]
    impacts, counted = [visible(x) for x in sol.impacts], sol.stats.get("transitions_in_core", 0)
    return Outcome(sol.status, float(sol.t[-1]), modes, impacts, sol.y[-1], unphysical(d, sol), seconds, counted)


def visible(impact: Impact) -> tuple[str, ...]:
    """Return the names of an impact whose impulses are not zero by rounding."""
    least = MULTIPLIER * max(map(abs, impact.impulse), default=0.0)
    return tuple(name for name, p in zip(impact.where, impact.impulse, strict=True) if abs(p) > least)


def unphysical(d: Drop, sol: mbdae.Solution) -> str:
    """Return the first check of physics that a run fails, in words; empty if it passes all."""
    least = float(gaps(d.mechanism, *sol.q).min(initial=np.inf))
    if least < -GAP:
        return f"a gap is {least:.1e}"
    r = residuals(sol)
    energy, scale = r.kinetic + r.potential, max(LEAST, r.kinetic.max(), np.ptp(r.potential))
    off = float(np.abs(energy - energy[0] - sol.work + sol.work[0]).max() / scale)
    if off > BALANCE:
        return f"the balance of energy is off by {off:.1e}"
    gained = float((energy - np.minimum.accumulate(energy)).max() / scale) if d.kind in PASSIVE else 0.0
    return f"energy grows by {gained:.1e}" if gained > BALANCE else wrong_mode(sol)


def wrong_mode(sol: mbdae.Solution) -> str:
    """Return the first contact that pulls, or friction beyond its limit, in words."""
    switches, largest = sol.mechanism.switches, max(1.0, float(np.abs(sol.lam).max(initial=0.0)))
    for i, (t, lam) in enumerate(zip(sol.t, sol.lam, strict=True)):
        mode = sol.mode(i)
        sticking = sum(isinstance(x, JointStiction) and mode[x.index] == 1 for x in switches)
        for x in switches:
            if isinstance(x, JointStiction) and sticking > 1:  # they may be statically indeterminate
                continue
            over = excess(x, mode[x.index], lam, sol.v[i]) / largest
            if over > MULTIPLIER:
                return f"{x.name} at t = {t:.6g}, {x.states[mode[x.index]]}: multiplier off by {over:.1e}"
    return ""


def excess(x: object, state: int, lam: Array, v: Array) -> float:
    """Return by how much the multiplier of a switch exceeds what its state allows, in its units."""
    if isinstance(x, FrictionalContact):
        beyond = abs(lam[x.no_slip]) - x.coefficient * lam[x.row] if state == 1 else 0.0
        return max(beyond, -lam[x.row])
    if isinstance(x, Unilateral):
        return float(-x.sign * lam[x.row])
    if isinstance(x, JointStiction):
        against = {2: -1.0, 3: 1.0}.get(state, 0.0) * v[x.column]  # a joint that slips against its state
        return float(abs(lam[x.row]) - x.spec.static if state == 1 else against)
    return 0.0


def distance(a: Outcome, b: Outcome) -> float:
    """Return how far two runs are apart relative to `SAME`: infinite if their transitions differ."""
    equal = a.status == b.status and a.impacts == b.impacts and [m for _, m in a.modes] == [m for _, m in b.modes]
    if not equal or a.end.shape != b.end.shape:
        return np.inf
    pairs = zip(a.modes, b.modes, strict=True)
    times = max((abs(s - t) for (s, _), (t, _) in pairs), default=0.0) / max(a.t, b.t, 1e-3)
    scale = 1 + float(np.abs(a.end).max(initial=0.0))
    return max(times, float(np.abs(a.end - b.end).max(initial=0.0)) / scale) / SAME


def followed(a: Outcome, b: Outcome) -> int:
    """Return how many transitions two runs have in common at the same times."""
    pairs = zip(a.modes, b.modes, strict=False)
    same = [x[1] == y[1] and abs(x[0] - y[0]) <= SAME * max(a.t, b.t) for x, y in pairs]
    return same.index(False) if False in same else len(same)


def decide(d: Drop, core: Outcome, python: Outcome) -> tuple[str, str]:
    """Return the verdict on two runs that differ, and the reason."""
    tight = [outcome(d, "native", rtol) for rtol in TIGHT] + [outcome(d, "python", TIGHT[0])]
    reference = tight[-2]
    agree = min(followed(x, reference) for x in tight)  # transitions on which tight runs agree
    ours, theirs = (min(followed(x, reference), agree) for x in (core, python))
    text = (
        f"{core.status} at {core.t:.6g} s and {python.status} at {python.t:.6g} s, {len(core.modes)} and"
        f" {len(python.modes)} transitions, {ours} and {theirs} of the {agree} of the tight runs,"
        f" {len(reference.modes)} in all, apart {distance(core, python):.1e}"
    )
    if ours == theirs:
        return "sensitive", text
    return ("core" if ours > theirs else "Python"), text


def compare(number: int, with_python: bool, share: float = 1.0) -> Result:
    """Compute a share of the duration of a drop in the core, and in Python if asked, and compare both."""
    d = drop(number)
    d = d._replace(end=share * d.end)
    core, python = outcome(d, "native"), outcome(d, "python") if with_python else None
    verdict, text = "", core.wrong
    if core.wrong:
        verdict = "unphysical"
    elif python:
        verdict, text = ("same", "") if distance(core, python) <= 1 else decide(d, core, python)
    return Result(number, d.kind, core, python, verdict, text)


def summary(results: Sequence[Result]) -> str:
    """Return a table with a row for each kind, and one for all."""
    groups = defaultdict[str, list[Result]](list)
    for x in results:
        groups[x.kind].append(x)
    rows = []
    for kind, found in {**groups, "all": list(results)}.items():
        verdicts, both = Counter(x.verdict for x in found), [x for x in found if x.python]
        ended = Counter(x.core.status for x in found)
        counts = [sum(len(x.core.modes) - 1 for x in found), sum(x.core.in_core for x in found)]
        seconds = [sum(x.core.seconds for x in both), sum(x.python.seconds for x in both if x.python)]
        others = ", ".join(f"{n} {name}" for name, n in ended.items() if name != "finished")
        cells = [len(found), others or "-", *counts, len(both), *(verdicts[k] for k in VERDICTS)]
        rows.append([kind, *map(str, cells), ratio(seconds[1], seconds[0])])
    head = ["drops", "runs", "not finished", "transitions", "in the core", "compared", *VERDICTS, "Python / core"]
    return table(head, rows)


VERDICTS = "same", "core", "Python", "sensitive", "unphysical"


def main(argv: Sequence[str] | None = None) -> list[Result]:
    """Print the table and what is not the same; return the results."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--runs", type=int, default=1000, help="number of drops")
    parser.add_argument("--python", type=int, default=3, help="one of so many is computed in Python, too")
    parser.add_argument("--only", type=int, help="the number of a single drop")
    parser.add_argument("--brief", action="store_true", help="a drop of each kind")
    given = parser.parse_args(argv)
    numbers = [given.only] if given.only is not None else BRIEF if given.brief else range(given.runs)
    share = 1 if given.only is not None or given.brief else given.python
    results = []
    for n in numbers:
        x = compare(n, (n // len(KINDS)) % share == 0, 0.25 if given.brief else 1.0)
        results.append(x)
        if x.verdict not in ("", "same"):
            print(f"{x.number}, {x.kind}: {x.verdict}: {x.text}", flush=True)
    print(f"\n{machine()}\n\n{summary(results)}")
    return results


if __name__ == "__main__":
    main()
