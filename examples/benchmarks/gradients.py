"""Cost of value and gradient of a cost function, and of tangents, in runs: Andrews' mechanism, 50 of its parameters.

Runs are timed alternately with gradients, and with tangents, each of which includes a run; the cost beyond the run is
reported, too. Parameters are bound to a mechanism once, and derivatives of a start are computed once, in the first
call, which is timed separately.
"""

from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np
from common import brief, machine, medians, ratio, table

import mbdae

RTOL = 1e-7
COUNTS = (1, 2, 5, 10, 20)


def parameters(mech: mbdae.Mechanism) -> list[str]:
    """Fifty parameters of Andrews' mechanism: masses, centres, inertias, placements, points, forces, gravity."""
    keys = ("mass", "com.0", "com.1", "inertia.2", "xyz.0", "xyz.1")
    names = [f"joint.{joint}.{key}" for joint in mech.joint_names for key in keys]
    names += [f"frame.{point}.xyz.0" for point in ("P2", "P3", "P4", "D", "C")]
    return [*names, "force.spring.stiffness", "force.spring.length", "force.drive.torque.value"]


def timed(work: Callable[[], object]) -> float:
    """Seconds that a call takes."""
    start = perf_counter()
    work()
    return perf_counter() - start


def main(argv: Sequence[str] | None = None) -> dict[str, float]:
    """Print the ratios; return the seconds of a run, and of the calls compared with it."""
    few = brief(argv, __doc__)
    mech = mbdae.load("andrews_squeezer")
    names, T = parameters(mech), 0.003 if few else 0.03

    def run() -> mbdae.Solution:
        return mbdae.solve(mech, (0.0, T), rtol=RTOL)

    sol = run()
    cost = mbdae.Squares({"q.beta": np.zeros(len(sol.t)), "v.Theta": np.zeros(len(sol.t))})
    bound = timed(lambda: mbdae.gradient(sol, cost, names))
    repeats = 2 if few else 15
    found = medians(
        {"run": lambda: timed(run), "value and gradient": lambda: timed(lambda: mbdae.gradient(run(), cost, names))},
        repeats,
    )
    for k in COUNTS:  # separately: a mechanism is bound to the parameters of the last call
        mbdae.sensitivity(sol, names[:k])
        work = {"run": lambda: timed(run), "k": lambda k=k: timed(lambda: mbdae.sensitivity(run(), names[:k]))}
        alternating = medians(work, repeats)
        found[f"{k} tangents"] = alternating["k"] / alternating["run"] * found["run"]
    about = f"{len(names)} parameters, {len(sol.t) - 1} steps of {sol.settings['method']}, rtol {RTOL:g}"
    print(f"{machine()}\n\n{about}\n")
    of_run = found["run"]
    rows = [[name, f"{1e3 * x:.1f}", ratio(x, of_run), ratio(x - of_run, of_run)] for name, x in found.items()]
    rows.append(["binding, once", f"{1e3 * bound:.0f}", ratio(bound, of_run), "-"])
    print(table(["work", "ms", "runs", "beyond the run"], rows))
    return found


if __name__ == "__main__":
    main()
