"""Fixed cost of a run: CPU time of `mbdae.solve` over 0.1 us, one step, and of an advance of `mbdae.Simulator`.

Run: python examples/benchmarks/fixed_cost.py [--brief]
"""

from collections.abc import Callable, Sequence
from time import process_time

from common import brief, machine, medians, microseconds, table

import mbdae

GOALS = {  # us of a run
    "pendulum": 150, "four_bar": 150, "andrews_squeezer": 150, "panda_handle": 150, "humanoid_stance": 300,
}  # fmt: skip
SHORT, ADVANCE = 1e-7, 1e-5  # s


def mean(repeats: int, run: Callable[[], object]) -> float:
    """Mean CPU seconds of a run."""
    began = process_time()
    for _ in range(repeats):
        run()
    return (process_time() - began) / repeats


def main(argv: Sequence[str] | None = None) -> dict[str, tuple[float, float]]:
    """Print the table and return the costs in s, of a run and of an advance, by model."""
    repeats = 2 if brief(argv, __doc__) else 100
    found = {}
    for name in GOALS:
        mechanism, simulator = mbdae.load(name), mbdae.Simulator(name, step=ADVANCE, record=False)
        runs = {
            "run": lambda m=mechanism: mean(repeats, lambda: mbdae.solve(m, (0, SHORT))),
            "advance": lambda s=simulator: mean(repeats, lambda: s.advance(ADVANCE)),
        }
        costs = medians(runs, 5)
        found[name] = costs["run"], costs["advance"]
    rows = [[name, microseconds(cost[0]), str(GOALS[name]), microseconds(cost[1])] for name, cost in found.items()]
    print(machine() + "\n")
    print(table(["us of CPU", "a run of one step", "goal", "an advance of one step"], rows))
    return found


if __name__ == "__main__":
    main()
