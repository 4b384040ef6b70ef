"""Microseconds per stage of both back ends, compared with the Pinocchio and LAPACK calls that a stage requires.

A stage solves M v' = f + G^T lam, Ghat v' = rhs. Measured are whole runs of pherk5 with fixed steps: their seconds over
their linear solves, everything included. The bare calls, timed in the same run at the model's start: crba,
nonLinearEffects, the Cholesky factorization of M, M^-1 [G^T f], the factorization of G M^-1 G^T and the solution with
it; from Python through the bindings of Pinocchio and LAPACK, and in C++ by the compiled core. "partials" are all first
partial derivatives at a point, which an iteration of Radau IIA, statics and modes need. The column "serves" names the
source of M, nle and J in native stages: the core's sweep through the tree, or Pinocchio's routines.

Run: python examples/benchmarks/stages.py [--brief]
"""

from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np
import pinocchio as pin
from common import backends, brief, machine, medians, microseconds, ratio, table
from scipy.linalg.lapack import dgesv, dpotrf, dpotrs

import mbdae
from mbdae.backend import load
from mbdae.studies.info.inertia_source import inertia_source

MODELS = {"four_bar": 2e-3, "panda_handle": 1e-3, "humanoid_stance": 5e-4, "stewart_platform": 1e-3}  # step in s
CALLS = 300  # of the bare sequence in one measurement


def stage(mech: mbdae.Mechanism, h: float, steps: int, backend: str = "python") -> Callable[[], float]:
    """Return a run of pherk5 that returns its seconds per linear solve."""

    def run() -> float:
        sol = mbdae.solve(mech, (0, steps * h), method="pherk5", step=h, backend=backend)
        if not sol.success:
            raise RuntimeError(f"{mech.title}, {backend}: {sol.message}")
        return sol.stats["seconds"] / sol.stats["solves"]

    return run


def bare_python(mech: mbdae.Mechanism) -> Callable[[], float]:
    """Return a run of the bare calls from Python that returns the seconds of one sequence."""
    system, (q, v), model = mech.system(), mech.start, mech.model
    system.derivative(0.0, mech.point())
    G, data = system.jacobian(q)[system.rows], model.createData()
    rhs = np.zeros(len(G))

    def run() -> float:
        started = perf_counter()
        for _ in range(CALLS):
            pin.crba(model, data, q, pin.Convention.WORLD)
            U, _ = dpotrf(data.M, lower=0, clean=1)
            f = -pin.nonLinearEffects(model, data, q, v)
            X = dpotrs(U, np.column_stack([G.T, f]))[0]
            lam = dgesv(G @ X[:, :-1], rhs - G @ X[:, -1])[2]
            X[:, -1] + X[:, :-1] @ lam
        return (perf_counter() - started) / CALLS

    return run


def in_core(mech: mbdae.Mechanism) -> dict[str, Callable[[], float]]:
    """Return the timings of the compiled core: the bare calls, and all partial derivatives; empty without the core."""
    if (native := load()) is None:
        return {}
    system = mech.system(native=native)
    system.derivative(0.0, mech.point())
    system.expand()
    return {
        "bare native": lambda: system.core.minimal_stage_seconds(*mech.start, 10 * CALLS),
        "partials": lambda: native.partials_seconds(system.core, *mech.start, 10 * CALLS),
    }


def measure(name: str, h: float, steps: int, repeats: int) -> dict[str, float]:
    """Seconds per stage of each back end and of the bare calls, by name."""
    mech = mbdae.load(name)
    runs = {"bare python": bare_python(mech)}
    runs |= {backend: stage(mech, h, steps * (10 if backend == "native" else 1), backend) for backend in backends()}
    return medians(runs | in_core(mech), repeats)


def main(argv: Sequence[str] | None = None) -> dict[str, dict[str, float]]:
    """Print the table and return seconds by model and name."""
    steps, repeats = (10, 1) if brief(argv, __doc__) else (200, 7)
    columns = ("python", "native", "bare python", "bare native", "partials")
    measured, rows = {}, []
    for name, h in MODELS.items():
        found = measured[name] = measure(name, h, steps, repeats)
        times = [found.get(c) for c in columns]
        python, native, bare, core, partials = times
        cells = [microseconds(t) for t in times]
        ratios = (python, native), (python, bare), (native, core), (partials, core)
        source = inertia_source(mbdae.load(name)).removeprefix("the core's ").removesuffix(" through the tree")
        rows.append([name, source, *cells, *(ratio(*pair) for pair in ratios)])
    print(machine() + "\n")
    header = ["microseconds per stage", "serves", "Python", "native", "bare calls, Python", "bare calls, C++"]
    print(table([*header, "partials", "Python / native", "Python / bare", "native / bare", "partials / bare"], rows))
    return measured


if __name__ == "__main__":
    main()
