"""Growth of the cost of default runs with the mechanism: assembly, start and projected steps of N four-bars in a row.

In the unequal row the pivots are displaced alternately by 5 cm: no symmetry keeps the loops closed, and every step
projects. The start is a run over 1e-7 s; a step is the longer run without the start, over its steps.

Run: python examples/benchmarks/growth.py [--brief]
"""

from collections.abc import Sequence
from math import pi
from time import perf_counter

from common import brief, digits, machine, table
from scaling import exponent

import mbdae

SIZES = (10, 30, 100, 300, 1000)
OFFSET = 0.05  # m
END = 0.2  # s: before the first singular configuration
REPEATS = 3  # the shortest counts
PARTS = ("assembly", "start", "step")


def unequal(N: int) -> mbdae.Mechanism:
    """Return a row of four-bars whose pivots are displaced alternately."""
    equal = mbdae.load("n_four_bar", N=N)
    model = equal.model.copy()
    for i in range(N + 1):
        model.jointPlacements[model.getJointId(f"crank_{i}")].translation[0] += OFFSET * (-1) ** i
    return mbdae.Mechanism(model, equal.closures, title=f"Row of unequal four-bars, N = {N}")


def seconds(mech: mbdae.Mechanism, N: int) -> dict[str, float]:
    """Seconds of assembly, start and step."""
    guess = {f"crank_{i}": pi / 2 for i in range(1, N + 1)} | {f"coupler_{i}": -pi / 2 for i in range(1, N + 1)}
    begun = perf_counter()
    q, v = mech.assemble(q={"crank_0": pi / 2}, v={"crank_0": -1.0}, guess=guess)
    found = {"assembly": perf_counter() - begun}
    for name, end in (("start", 1e-7), ("run", END)):
        times = []
        for _ in range(REPEATS):
            begun = perf_counter()
            sol = mbdae.solve(mech, (0, end), q, v)
            times.append(perf_counter() - begun)
            if not sol.success:
                raise RuntimeError(f"N = {N}: {sol.message}")
        found[name] = min(times)
    return found | {"step": max(0.0, found["run"] - found["start"]) / (sol.stats["steps"] - 1)}


def main(argv: Sequence[str] | None = None) -> dict[str, dict[int, dict[str, float]]]:
    """Print the table and return seconds by row, N and part."""
    sizes = SIZES[:2] if brief(argv, __doc__) else SIZES
    rows = {"equal": lambda N: mbdae.load("n_four_bar", N=N), "unequal": unequal}
    measured = {name: {N: seconds(make(N), N) for N in sizes} for name, make in rows.items()}
    print(machine() + "\n")
    header = ["N, ms", *(f"{part}, {name}" for name in rows for part in PARTS)]
    lines = [[str(N), *(digits(1e3 * measured[r][N][p]) for r in rows for p in PARTS)] for N in sizes]
    exponents = [exponent({N: t[p] for N, t in measured[r].items()}) for r in rows for p in PARTS]
    lines.append(["exponent", *("-" if s is None else f"{s:.2f}" for s in exponents)])
    print(table(header, lines))
    return measured


if __name__ == "__main__":
    main()
