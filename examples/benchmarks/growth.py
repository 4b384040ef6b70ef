"""Growth of default runs with the mechanism: time and peak memory of N four-bars in a row.

In the unequal row the pivots are displaced alternately by 5 cm: no symmetry keeps the loops closed, and every step
projects. The start is a run over 1e-7 s; a step is the longer run without the start, over its steps, and "2 s" one of a
run that crosses singular configurations, where all loops of the equal row are flat, or passes them closely. Times are
those of the processor. Each case runs in a new process, whose peak memory is above that after a run of one four-bar.

A table has the steps of implicit methods on unequal rows, whose matrices have a band in the order of the loops.

The last table has the longest unequal row from rest over 1 s, beside MuJoCo (RK4) and Exudyn (sparse solver); errors
of all angles are those against `pherk6` at rtol 1e-10, also the method of the measured runs of mbdae: their errors are
differences from a tighter run of the same method.

Run: python examples/benchmarks/growth.py [--brief]
"""

import resource
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from math import pi
from multiprocessing import get_context
from time import process_time
from typing import TypeVar

import numpy as np
from common import brief, digits, machine, table
from peers import with_exudyn, with_mbdae, with_mujoco
from planar import Problem
from problems import rod
from runs import Array, Run
from scaling import exponent

import mbdae

R = TypeVar("R")
SIZES = (10, 30, 100, 300, 1000)
OFFSET = 0.05  # m
SHORT = 1e-7  # s: of a run of one step
END = 0.2  # s: before the first singular configuration
LONG_END = 2.0  # s: after singular configurations
REPEATS, LEAST = 3, 0.3  # at least this many runs and seconds, the shortest of which counts
TIMES = ("model", "assembly", "start", "step", "step of 2 s")
PARTS = (*TIMES, "memory")
LENGTH = 1.0  # s, of the run beside other programs
IMPLICIT = {"radau5": {"rtol": 1e-8}, "alpha": {"step": 2e-3}, "rattle4": {"step": 2e-3}}
IMPLICIT_SIZES, IMPLICIT_END = (10, 30, 100, 300), 0.1  # s
STEPS = {"MuJoCo RK4": (2e-3, 1e-3), "Exudyn, sparse": (2e-3, 1e-3)}  # s
TOLERANCES = (1e-4, 1e-6)
REFERENCE = 1e-10  # rtol


def unequal(N: int) -> mbdae.Mechanism:
    """Return a row of four-bars whose pivots are displaced alternately."""
    equal = mbdae.load("n_four_bar", N=N)
    model = equal.model.copy()
    for i in range(N + 1):
        model.jointPlacements[model.getJointId(f"crank_{i}")].translation[0] += OFFSET * (-1) ** i
    return mbdae.Mechanism(model, equal.closures, title=f"Row of unequal four-bars, N = {N}")


def equal(N: int) -> mbdae.Mechanism:
    """Return a row of parallelograms."""
    return mbdae.load("n_four_bar", N=N)


ROWS = {"equal": equal, "unequal": unequal}


def assembled(mech: mbdae.Mechanism, N: int) -> tuple[Array, Array]:
    """Return the upright row."""
    guess = {f"crank_{i}": pi / 2 for i in range(1, N + 1)} | {f"coupler_{i}": -pi / 2 for i in range(1, N + 1)}
    return mech.assemble(q={"crank_0": pi / 2}, v={"crank_0": -1.0}, guess=guess)


def seconds(row: str, N: int, repeats: int, least: float) -> dict[str, float]:
    """Seconds of the processor for the model, its assembly, start and step: of at least so many runs and seconds."""
    begun = process_time()
    mech = ROWS[row](N)
    found = {"model": process_time() - begun}
    begun = process_time()
    q, v = assembled(mech, N)
    found["assembly"] = process_time() - begun
    steps = {}
    for name, end in (("start", SHORT), ("step", END), ("step of 2 s", LONG_END)):
        times: list[float] = []
        while len(times) < repeats or sum(times) < least:
            begun = process_time()
            sol = mbdae.solve(mech, (0, end), q, v)
            times.append(process_time() - begun)
            if not sol.success:
                raise RuntimeError(f"N = {N}: {sol.message}")
        found[name], steps[name] = min(times), sol.stats["steps"] - 1
    return found | {x: max(0.0, found[x] - found["start"]) / n for x, n in steps.items() if x != "start"}


def implicit_seconds(N: int, end: float) -> dict[str, float]:
    """Seconds of the processor for a step of each implicit method, without those of a run of one step."""
    mech = unequal(N)
    q, v = assembled(mech, N)
    found = {}
    for method, settings in IMPLICIT.items():
        times, one = [], {"step": SHORT} if "step" in settings else settings
        for span, options in [(SHORT, one)] * 2 + [(end, settings)] * 2:
            begun = process_time()
            sol = mbdae.solve(mech, (0, span), q, v, method=method, **options)
            times.append(process_time() - begun)
        found[method] = max(0.0, times[-1] - times[1]) / (sol.stats["steps"] - 1)
    return found


def peak() -> float:
    """Largest resident memory of this process in bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def with_memory(measure: Callable[[], R]) -> tuple[R, float]:
    """Return what is measured, and the bytes by which it raises the peak after a run of one four-bar."""
    mech = equal(1)
    mbdae.solve(mech, (0, 1e-3), *assembled(mech, 1))
    before = peak()
    return measure(), peak() - before


def in_process(measure: Callable[[], R]) -> tuple[R, float]:
    """`with_memory` in a new process."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
        return process.submit(with_memory, measure).result()


def problem(N: int, end: float) -> Problem:
    """Return the unequal row from rest."""
    mech = unequal(N)
    start = dict(zip(mech.joint_names, assembled(mech, N)[0], strict=True))
    model = mech.model
    pivots = [complex(model.jointPlacements[model.getJointId(f"crank_{i}")].translation[0]) for i in range(N + 1)]
    cranks = [rod(n := f"crank_{i}", None, pivots[i], 1.0, 1.0, float(start[n])) for i in range(N + 1)]
    couplers = [rod(n := f"coupler_{i}", f"crank_{i - 1}", 1 + 0j, 1.0, 1.0, float(start[n])) for i in range(1, N + 1)]
    pins = tuple((f"coupler_{i}", 1 + 0j, f"crank_{i}", 1 + 0j) for i in range(1, N + 1))
    return Problem("row", end, lambda: mech, (*cranks, *couplers), lambda: np.empty(0), pins)


def one_run(name: str, N: int, end: float, value: float) -> Run | None:
    """Run one program at a tolerance or step."""
    row = problem(N, end)
    if name == "mbdae":
        run = with_mbdae(row, "pherk6", project=True)
    else:
        run = with_mujoco(row) if name.startswith("MuJoCo") else with_exudyn(row, sparse=True)
    return run and run(value)


def beside(N: int, end: float, short: bool, measured: Callable[[Callable[[], R]], tuple[R, float]]) -> list[list[str]]:
    """Rows of the second table: seconds, largest error in rad, |g| in m, and peak memory in MB."""
    out = []
    # Also in a new process: each begins with the peak of its parent.
    reference, _ = measured(partial(one_run, "mbdae", N, end, REFERENCE))
    assert reference is not None
    for name, values in ({"mbdae": TOLERANCES} | STEPS).items():
        for value in values[:1] if short else values:
            run, memory = measured(partial(one_run, name, N, end, value))
            setting = f"rtol {value:.0e}" if name == "mbdae" else f"step {value:.0e} s"
            if run is None:
                out.append([f"{name}, {setting}", *("-" * 4)])
                continue
            error = f"{np.abs(run.end - reference.end).max():.1e}"
            out.append([f"{name}, {setting}", digits(run.seconds), error, f"{run.g:.0e}", digits(memory / 1e6)])
    return out


def main(argv: Sequence[str] | None = None) -> dict[str, dict[int, dict[str, float]]]:
    """Print the tables and return seconds and bytes by row, N and part."""
    short = brief(argv, __doc__)
    sizes, effort = (SIZES[:2], (1, 0.0)) if short else (SIZES, (REPEATS, LEAST))
    measure = with_memory if short else in_process
    measured: dict[str, dict[int, dict[str, float]]] = {name: {} for name in ROWS}
    for name in ROWS:
        for N in sizes:
            times, memory = measure(partial(seconds, name, N, *effort))
            measured[name][N] = times | {"memory": memory}
    print(machine("mujoco", "exudyn") + "\n")
    for name, found in measured.items():
        header = [f"N, {name} row", *(f"{part}, ms" for part in TIMES), "memory, MB"]
        lines = [[str(N), *(digits((1e-6 if p == "memory" else 1e3) * x[p]) for p in PARTS)] for N, x in found.items()]
        for least in (10, 100):
            exponents = [exponent({N: x[p] for N, x in found.items() if least <= N}) for p in PARTS]
            lines.append([f"exponent from {least}", *("-" if s is None else f"{s:.2f}" for s in exponents)])
        print(table(header, lines) + "\n")
    steps = {N: implicit_seconds(N, 0.01 if short else IMPLICIT_END) for N in IMPLICIT_SIZES[: 2 if short else None]}
    lines = [[str(N), *(digits(1e3 * x) for x in found.values())] for N, found in steps.items()]
    exponents = [exponent({N: found[name] for N, found in steps.items()}) for name in IMPLICIT]
    lines.append(["exponent", *("-" if s is None else f"{s:.2f}" for s in exponents)])
    print(table(["N, unequal row", *(f"{name}, ms a step" for name in IMPLICIT)], lines) + "\n")
    N, end = sizes[-1], 0.1 if short else LENGTH
    header = [f"N = {N}, {end:g} s", "seconds", "error, rad", "largest \\|g\\|, m", "memory, MB"]
    print(table(header, beside(N, end, short, measure)))
    return measured


if __name__ == "__main__":
    main()
