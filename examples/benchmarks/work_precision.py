"""Time to reach an error of the end position: mbdae compared with other solvers for mechanisms.

Three problems (problems.py): four-bar and double pendulum for 10 s, Andrews' squeezing mechanism for 0.03 s. The error
is the largest of all joint angles at the end, in rad. References are those of problems.py: of the four-bar and the
double pendulum by DOP853 of scipy, which is measured, too, at rtol 1e-13 from equations in independent angles; of
Andrews' mechanism by two codes in quadruple precision. Each solver runs over tolerances in half decades, or steps that
are halved; the result is the cheapest run below an error, as the median of interleaved repetitions, and only the
solver's loop is timed. "n.r.": not reached within the time allowed. The four-bar nearly rests at 10 s, where phase
errors have little effect: that favours all solvers equally.

The settings. mbdae: atol = rtol; "projected" keeps g = 0 and G v = 0 after each step. scipy: DOP853, atol = rtol, on
pin.constraintDynamics with Baumgarte's alpha = beta = 100 1/s (Kp = 1e4, Kd = 200; proximal accuracy 1e-12, mu =
1e-10); the four-bar again with alpha = 10 1/s, the fastest of several, which on Andrews differ little; Andrews' spring
by hand in terms of its angle. solve_dae: Radau, atol = rtol, on the GGL form in absolute angles, written by hand in a
few matrix products, with the exact Jacobian. MuJoCo: RK4, solref = (2 steps, 1), solimp = (0.9999, 0.9999, 0.001),
tolerance 1e-14; its C loop is entered only 20 times. Exudyn: generalized alpha with spectral radius 1 on index 2,
modified Newton to 1e-10, bodies in absolute coordinates. diffrax (Dopri8, compiled by JAX before it is timed) and
casadi (CVODES with Adams' methods and functional iteration; IDAS with accelerations and lam as algebraic unknowns; both
compiled to C if there is a compiler) solve equations with index 1 written by hand, with alpha = 10 1/s and 20 output
points. The double pendulum is a tree for mbdae, Pinocchio and MuJoCo; solve_dae closes the elbow by a constraint, as
"elbow cut" of mbdae does, and Exudyn all joints. The stiff problems (stiff.py) are solved by mbdae, by IDAS as above
but not compiled and with a and lam left out of its error test, by solve_dae's Radau on equations with index 1, with a
finite-difference Jacobian, and by Exudyn as above, the governor as a kinematic tree (exudyn_stiff.py). Largest |g| in
m: over all steps; for MuJoCo and Exudyn over 20 times, and there without the hinges.

Run: python examples/benchmarks/work_precision.py [--brief]
"""

import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from common import backends, brief, digits, machine, medians, ratio, table
from peers import solvers
from PIL import Image
from planar import Problem
from problems import PROBLEMS
from runs import Runner
from stiff import STIFF, Stiff
from stiff_peers import stiff_solvers

TARGETS = (1e-3, 1e-6, 1e-9)  # rad
STIFF_TARGETS = (1e-4, 1e-6, 1e-8)  # rad and m
DRIFT = 1e-9  # m
CAP, LONG, SHORT = 5.0, 1.0, 0.05  # s: upper limit of a run; longer ones are timed once; shorter ones always repeated
PICTURE = Path(__file__).parent.parent / "pictures" / "work_precision_peers.png"
TOLERANCES = np.logspace(-2, -13, 23)


@dataclass
class Point:
    """A run: tolerance or step, seconds, error in rad, largest |g| in m."""

    value: float
    seconds: float
    error: float
    g: float


class Effort(NamedTuple):
    """Upper limit of a run in s, repetitions of timed runs, and stride through the tolerances."""

    cap: float
    repeats: int
    stride: int


def values(problem: Problem | Stiff, stepped: bool, stride: int) -> Iterable[float]:
    """Every n-th of the tolerances; or step sizes, from a 500th of the span, halved repeatedly."""
    return (problem.end / (500 * 2**k) for k in range(16)) if stepped else TOLERANCES[::stride]


def curve(runner: Runner, values: Iterable[float], reference: np.ndarray, least: float, cap: float) -> Iterator[Point]:
    """Run from coarse to fine until the least error and drift are reached, or a run would exceed cap seconds."""
    last = 0.0
    for value in values:
        run = runner(value)
        if run is None:
            continue
        error = float(np.abs(run.end - reference).max())
        yield Point(value, run.seconds, error, run.g)
        if (error < least / 3 and run.g <= DRIFT) or max(
            2.0, run.seconds / max(last, run.seconds / 4)
        ) * run.seconds > cap:
            return
        last = run.seconds


def cheapest(points: Sequence[Point], error: float, g: float = np.inf) -> Point | None:
    """The fastest run below an error and |g|."""
    return min((p for p in points if p.error <= error and p.g <= g), key=lambda p: p.seconds, default=None)


def measure(
    problem: Problem | Stiff, solvers: dict[str, Any], targets: Sequence[float], effort: Effort
) -> dict[str, list[Point]]:
    """Points of each solver; relevant and short ones are timed again, in turn."""
    reference, runners, points = problem.reference(), {}, {}
    for name, (make, stepped) in solvers.items():
        if (runner := make(problem)) is None:
            print(f"{name} is not installed: left out", file=sys.stderr)
            continue
        print(f"{problem.title}: {name}", file=sys.stderr)
        runners[name] = runner
        points[name] = list(curve(runner, values(problem, stepped, effort.stride), reference, min(targets), effort.cap))
    chosen = {(name, p.value): p for name, found in points.items() for p in found if p.seconds < SHORT}
    for name, found in points.items():
        for point in (cheapest(found, e, g) for e in targets for g in (np.inf, DRIFT)):
            if point and point.seconds < LONG:
                chosen[name, point.value] = point
    again = {key: (lambda key=key: runners[key[0]](key[1]).seconds) for key in chosen}
    for key, seconds in medians(again, effort.repeats).items():
        chosen[key].seconds = seconds
    return points


def cells(points: Sequence[Point], targets: Sequence[float], g: float = np.inf) -> list[float | None]:
    """Seconds to each error."""
    return [p.seconds if (p := cheapest(points, e, g)) else None for e in targets]


def ms(times: Sequence[float | None]) -> str:
    """Return milliseconds in three digits."""
    return " / ".join("n.r." if t is None else digits(1e3 * t) for t in times)


def power(x: float) -> str:
    """Return a number in one digit."""
    return f"{x:.0e}".replace("e-0", "e-")


def report(problem: Problem, points: dict[str, list[Point]], targets: Sequence[float]) -> str:
    """One row for each solver; ratios are those of the times to the errors."""
    ours = [n for n in points if n.startswith(("pherk", "herk", "radau"))]
    one = cells(points[next(n for n in ours if n.startswith("pherk5, projected"))], targets, DRIFT)
    rows = [cells(points[n], targets, DRIFT) for n in ours]
    best = [min((t for t in column if t), default=None) for column in zip(*rows, strict=True)]
    rows = []
    for name, found in points.items():
        times, runs = cells(found, targets), [cheapest(found, e) for e in targets]
        g = " / ".join(power(p.g) if p else "-" for p in runs) if problem.pins or "cut" in name else "-"
        ratios = (" / ".join(ratio(t, base) for t, base in zip(times, b, strict=True)) for b in (one, best))
        rows.append([name, ms(times), g, ms(cells(found, targets, DRIFT)), *ratios])
    errors = " / ".join(power(e) for e in targets)
    header = [f"{problem.title}, {problem.end:g} s", f"ms to {errors} rad", "largest \\|g\\|, m"]
    kept = f"ms to the same with \\|g\\| <= {power(DRIFT)} m"
    return table([*header, kept, "time over pherk5, projected", "over mbdae's best with this \\|g\\|"], rows)


def report_stiff(problem: Stiff, points: dict[str, list[Point]], targets: Sequence[float]) -> str:
    """One row for each solver, relative to radau5."""
    base, rows = cells(points["radau5"], targets), []
    for name, found in points.items():
        times = cells(found, targets)
        rows.append([name, ms(times), " / ".join(ratio(t, b) for t, b in zip(times, base, strict=True))])
    errors = " / ".join(power(e) for e in targets)
    return table([f"{problem.title}, {problem.end:g} s", f"ms to {errors} m or rad", "time over radau5"], rows)


def draw(measured: dict[str, dict[str, list[Point]]], path: Path) -> None:
    """Error over time, a panel for each problem."""
    figure, axes = plt.subplots(
        1, len(measured), figsize=(3.6 * len(measured), 3.8), layout="constrained", squeeze=False
    )
    names = list(dict.fromkeys(name for points in measured.values() for name in points))
    for ax, (title, points) in zip(axes[0], measured.items(), strict=True):
        for name, found in points.items():
            i, ours = names.index(name), name.startswith(("pherk", "herk", "radau"))
            style = {
                "color": f"C{i}" if i < 10 else "black",
                "marker": "osD^v<>PX*"[i % 10],
                "ls": "-" if ours else "--",
            }
            ax.loglog([1e3 * p.seconds for p in found], [p.error for p in found], ms=3, lw=1, label=name, **style)
        ax.set(title=title, xlabel="time (ms)", ylim=(1e-11, 10))
        ax.grid(alpha=0.3)
    axes[0, 0].set_ylabel("error of the joint angles at the end (rad)")
    handles = {t: h for ax in axes[0] for h, t in zip(*ax.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles, loc="outside lower center", ncols=4, fontsize=8)
    figure.savefig(path, dpi=130)
    plt.close(figure)
    Image.open(path).convert("RGB").quantize(48).save(path, optimize=True)  # a quarter of the size


def main(argv: Sequence[str] | None = None, picture: Path | None = None) -> dict[str, dict[str, list[Point]]]:
    """Print a table for each problem, draw the figure, and return the points."""
    short = brief(argv, __doc__)
    targets, effort = ((1e-2, 1e-4), Effort(0.02, 1, 8)) if short else (TARGETS, Effort(CAP, 5, 1))
    print(machine("solve_dae", "mujoco", "exudyn", "casadi", "diffrax"))
    print(f"back end of mbdae: {backends()[-1]}, except in rows marked Python")
    measured = {}
    for title, problem in PROBLEMS.items():
        measured[title] = measure(problem, solvers(problem), targets, effort)
        print("\n" + report(problem, measured[title], targets), flush=True)
    for stiff in () if short else STIFF.values():
        points = measure(stiff, stiff_solvers(stiff), STIFF_TARGETS, effort)
        print("\n" + report_stiff(stiff, points, STIFF_TARGETS), flush=True)
    if picture or not short:
        draw(measured, picture or PICTURE)
    return measured


if __name__ == "__main__":
    main()
