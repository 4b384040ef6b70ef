"""An ensemble of random runs through and near singular configurations, each compared with an independent solution.

Each run has a number, from which mechanism, start, method, mode and tolerance are drawn; it is the same in every
ensemble of that seed. The reference of mechanisms of one degree of freedom is the motion along the closed form of the
branch on which they start (`branches.Truth`); that of the Stewart platform, whose closures lose no rank, is pherk6 with
projection at rtol 1e-11. Compared are up to 300 nodes and the last 20: q in rad and m, v over its largest, lam over its
largest where the smallest singular value of G M^-1/2 is above a tenth of its largest.

right            all within 1e-2
loose            on its branch, but farther from the reference: by less than 100 rtol times the growth of a small change
                 of the starting speed
stopped          the run ended with a reason, and all nodes before are right or loose
slow             the same, but ended by the largest number of steps
v there          the same, but velocities are wrong at nodes in or next to singular configurations, and only these
wrong, told      any other error, reported by a warning or the message
silently wrong   any other error, not reported
traceback        an exception

Run: python examples/benchmarks/singular.py [--runs N] [--seed N] [--mechanism M] [--method M] [--mode M] [--workers N]
[--only N] [--brief]
"""

import argparse
import warnings
from collections import Counter, defaultdict
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from time import perf_counter
from typing import NamedTuple

import numpy as np
from common import machine, table
from random_runs import CHANGE, MECHANISMS, METHODS, MODES, Case, case, options

import mbdae

Array = np.ndarray
OUTCOMES = ("right", "loose", "stopped", "slow", "v there", "wrong, told", "silently wrong", "traceback")
NEAR = 1e-2  # rad, m, and relative: right
LOOSE = 100.0  # times rtol: accumulated errors of steps as a change of the speed at the start
REGULAR = 0.1  # of the largest ratio of singular values: lam is compared above
REPORTED = "left its branch there", "rows that depended on others"
KEPT = 300  # nodes at which a run is compared
EXPLICIT_STEPS, IMPLICIT_STEPS = 20000, 1500


class Result(NamedTuple):
    """The outcome of a run."""

    number: int
    mechanism: str
    method: str
    mode: str
    outcome: str
    passed: int
    steps: int
    rejected: int
    seconds: float
    text: str


def _worst(error: Array, growth: Array, rtol: float, scale: Array | float = 1.0) -> tuple[float, int]:
    """Largest error over the scale, and 0, 1, 2: right, loose, wrong."""
    allowed = np.maximum(NEAR * scale, LOOSE * rtol * np.maximum.accumulate(growth))
    if not len(error):
        return 0.0, 0
    over = error / scale
    return float(over.max()), 2 if (error > allowed).any() else int((over > NEAR).any())


def judge(c: Case, sol: mbdae.Solution) -> tuple[list[str], int, str]:
    """Compare a run with the reference at its nodes.

    Returns:
        Which are wrong, or "loose", or nothing; the number of singular configurations crossed; the errors as text.
    """
    chosen = np.unique(np.linspace(0, len(sol.t) - 1, KEPT).astype(int)) if len(sol.t) > KEPT else np.arange(len(sol.t))
    chosen = np.union1d(chosen, np.arange(max(0, len(sol.t) - 20), len(sol.t)))
    times, near = sol.t[chosen], c.truth.branch
    true, changed = ([f.at(t) for t in times] for f in (c.truth, c.changed))
    error = np.array([np.abs(near.difference(sol.q[i], x[0])).max() for i, x in zip(chosen, true, strict=True)])
    growth = np.array([np.abs(near.difference(x[0], y[0])).max() for x, y in zip(changed, true, strict=True)]) / CHANGE
    off = max((near.distance(sol.q[i]) for i, e in zip(chosen, error, strict=True) if not e <= NEAR), default=0.0)
    found = {"q": _worst(np.where(np.isnan(error), np.inf, error), growth, c.rtol)}
    found["branch"] = off, 2 * int(not off <= NEAR)
    samples = np.array([c.truth.forces(t)[1] for t in np.linspace(0, times[-1], 400)])
    forces = [c.truth.forces(t) for t in times]
    regular = np.array([ratio > REGULAR * samples.max() for _, ratio in forces])
    dv = np.array([np.abs(sol.v[i] - x[1]).max() for i, x in zip(chosen, true, strict=True)])
    dg = np.array([np.abs(x[1] - y[1]).max() / CHANGE for x, y in zip(changed, true, strict=True)])
    fastest = max(np.abs(x[1]).max() for x in true)
    found["v"] = _worst(np.nan_to_num(dv, nan=np.inf)[regular], dg[regular], c.rtol, fastest)
    found["v there"] = _worst(np.nan_to_num(dv, nan=np.inf)[~regular], dg[~regular], c.rtol, fastest)
    exact = [lam for (lam, _), r in zip(forces, regular, strict=True) if r]
    sizes = np.array([np.linalg.norm(lam) for lam in exact])
    scale = np.maximum(sizes, 0.1 * max(sizes.max(initial=0.0), fastest**2))  # bars of about 1 kg and 1 m
    dl = [np.linalg.norm(sol.lam[i] - lam) for i, lam in zip(chosen[regular], exact, strict=True)]
    grown = [np.linalg.norm(c.changed.forces(t)[0] - x) / CHANGE for t, x in zip(times[regular], exact, strict=True)]
    found["lam"] = _worst(np.nan_to_num(dl, nan=np.inf), np.array(grown), c.rtol, scale)
    low = samples < REGULAR * samples.max()
    passed = int(((samples[1:-1] < samples[:-2]) & (samples[1:-1] <= samples[2:]) & low[1:-1]).sum())
    wrong = [k for k, (_, grade) in found.items() if grade == 2]
    loose = ["loose"] * any(grade == 1 for _, grade in found.values())
    return wrong or loose, passed, ", ".join(f"{k} {x:.1e}" for k, (x, _) in found.items())


def run(number: int, seed: int = 0) -> Result:
    """Compute a run and compare it with its reference."""
    c = case(number, seed)
    limit = IMPLICIT_STEPS if c.method == "radau5" else EXPLICIT_STEPS
    about = f"{c.mechanism}, {c.method}, {c.mode}, rtol {c.rtol:.1e}, {c.title}"
    formulation, started = MODES[c.mode][1], perf_counter()
    q, v = c.truth.at(0.0)
    with warnings.catch_warnings(record=True) as reported:
        warnings.simplefilter("always")
        try:
            sol = mbdae.solve(
                c.truth.branch.mech, (0, c.end), q, v, method=c.method, rtol=c.rtol, max_steps=limit, **formulation
            )
            seconds = perf_counter() - started
            wrong, passed, errors = judge(c, sol)
        except Exception as e:  # any exception is an outcome of the ensemble
            text = f"{about}: {type(e).__name__}: {e}"
            return Result(number, c.mechanism, c.method, c.mode, "traceback", 0, 0, 0, 0.0, text)
    if wrong == ["v there"]:
        outcome = "v there"
    elif wrong and wrong != ["loose"]:
        outcome = "wrong, told" if reported or any(x in sol.message for x in REPORTED) else "silently wrong"
    elif not sol.success:
        outcome = "slow" if sol.status == "max_steps" else "stopped"
    else:
        outcome = "loose" if wrong else "right"
    text = f"{about}: {', '.join(wrong) or 'right'} ({errors}); {sol.status} at {sol.t[-1]:.4f} s: {sol.message}"
    counts = sol.stats["steps"], sol.stats["rejected"] or 0
    return Result(number, c.mechanism, c.method, c.mode, outcome, passed, *counts, seconds, text)


def summary(results: Sequence[Result], of: Sequence[str]) -> str:
    """Return a table of outcomes with a row for each value of some fields of the results, and of all."""
    groups: dict[tuple[str, ...], list[Result]] = defaultdict(list)
    for r in results:
        groups[tuple(getattr(r, name) for name in of)].append(r)
    groups = {**dict(sorted(groups.items())), ("all", *[""] * (len(of) - 1)): list(results)}
    lines = []
    for key, some in groups.items():
        counts = Counter(r.outcome for r in some)
        sums = [sum(getattr(r, name) for r in some) for name in ("passed", "steps", "rejected")]
        slowest = f"{1e3 * max(r.seconds for r in some):.0f}"
        lines.append([*key, str(len(some)), *(str(counts[x] or "") for x in OUTCOMES), *map(str, sums), slowest])
    return table([*of, "runs", *OUTCOMES, "passages", "steps", "rejected", "slowest, ms"], lines)


def main(argv: Sequence[str] | None = None) -> list[Result]:
    """Print tables of outcomes and the runs that are neither right nor loose; return all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--runs", type=int, default=400, help="numbers 0 to N - 1, of which options choose")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--mechanism", help=f"begin of a name: {', '.join(MECHANISMS)}")
    parser.add_argument("--method", choices=list(METHODS))
    parser.add_argument("--mode", choices=list(MODES))
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--only", type=int, help="one run, told in full")
    parser.add_argument("--brief", action="store_true", help="few runs, to see that it works")
    args = parser.parse_args(argv)
    if args.only is not None:
        result = run(args.only, args.seed)
        print(f"{result.number} {result.outcome}: {result.text}")
        return [result]
    numbers = []
    for number in range(len(MECHANISMS) if args.brief else args.runs):
        _, mechanism, method, mode, _ = options(number, args.seed)
        chosen = mechanism.startswith(args.mechanism or ""), args.method in (None, method), args.mode in (None, mode)
        numbers += [number] * all(chosen)
    one = partial(run, seed=args.seed)
    if args.workers > 1:
        with ProcessPoolExecutor(args.workers) as pool:
            results = list(pool.map(one, numbers))
    else:
        results = [one(number) for number in numbers]
    print(machine() + "\n")
    for of in (("mechanism", "mode"), ("method", "mode")):
        print(summary(results, of) + "\n")
    for r in results:
        if r.outcome not in ("right", "loose"):
            print(f"{r.number} {r.outcome}: {r.text}")
    return results


if __name__ == "__main__":
    main()
