"""Growth of the cost of a stage with the mechanism: rows of N four-bars with N loops and 2 N + 1 bars.

Measured are whole runs of pherk5 with fixed steps: their seconds over their linear solves. The exponent is the slope of
the logarithm of the time over that of N, from N = 10 on.

Run: python examples/benchmarks/scaling.py [--brief]
"""

from collections.abc import Sequence

import numpy as np
from common import backends, brief, machine, medians, microseconds, ratio, table
from stages import stage

import mbdae

SIZES = (1, 2, 5, 10, 20, 40, 100)
STEP = 2e-4  # s: before the first singular configuration, at half a second


def exponent(times: dict[int, float]) -> float | None:
    """Slope of log(time) over log(N) from N = 10 on; None with less than two such times."""
    known = {n: t for n, t in times.items() if n >= 10 and t > 0}
    return float(np.polyfit(np.log(list(known)), np.log(list(known.values())), 1)[0]) if len(known) > 1 else None


def main(argv: Sequence[str] | None = None) -> dict[str, dict[int, float]]:
    """Print the table and return seconds per stage by back end and N."""
    short = brief(argv, __doc__)
    repeats = 1 if short else 5
    found = backends()
    measured: dict[str, dict[int, float]] = {backend: {} for backend in found}
    for n in SIZES[:-1] if short else SIZES:
        mech = mbdae.load("n_four_bar", N=n)
        steps = 2 if short else max(20, 200 // n)
        runs = {b: stage(mech, STEP, steps * (10 if b == "native" else 1), b) for b in found}
        for backend, seconds in medians(runs, repeats).items():
            measured[backend][n] = seconds
    python, native = measured["python"], measured.get("native", {})
    rows = [[str(n), microseconds(t), microseconds(native.get(n)), ratio(t, native.get(n))] for n, t in python.items()]
    slopes = [exponent(times) for times in (python, native)]
    rows.append(["exponent from N = 10", *("-" if s is None else f"{s:.2f}" for s in slopes), "-"])
    print(machine() + "\n")
    print(table(["N, microseconds per stage", "Python", "native", "Python / native"], rows))
    return measured


if __name__ == "__main__":
    main()
