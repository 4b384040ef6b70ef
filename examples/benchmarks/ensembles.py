"""A thousand runs of a slider-crank by mbdae.sweep, over threads and processes.

Each run starts at another speed of the crank and takes 10 s with pherk5 at rtol 1e-8; its final position of the slider
is kept. The time is that of the whole call, with loading, assembly and the table; ratios are those of the times of the
same executor with one worker, and of all to one thread. The tables must be equal bit for bit.

Run: python examples/benchmarks/ensembles.py [--brief]
"""

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any

import numpy as np
from common import brief, digits, machine, medians, ratio, table

import mbdae

CASES = [(executor, workers) for executor in ("threads", "processes") for workers in (1, 2)]


def main(argv: Sequence[str] | None = None) -> dict[tuple[str, int], float]:
    """Print the table and return seconds by executor and workers."""
    short = brief(argv, __doc__)
    n, end, repeats = (8, 0.2, 1) if short else (1000, 10.0, 3)
    speeds = {"start.v.crank": np.linspace(4.0, 12.0, n).tolist()}
    tables: dict[tuple[str, int], list[dict[str, Any]]] = {}

    def case(executor: str, workers: int) -> Callable[[], float]:
        def run() -> float:
            started = perf_counter()
            found = mbdae.sweep(
                "slider_crank",
                speeds,
                end,
                outputs=["final q.slider"],
                executor=executor,
                workers=workers,
                method="pherk5",
                rtol=1e-8,
            )
            seconds = perf_counter() - started
            tables[executor, workers] = found.rows
            return seconds

        return run

    times = medians({key: case(*key) for key in (CASES[:3] if short else CASES)}, repeats)
    if any(rows != tables[CASES[0]] for rows in tables.values()):
        raise RuntimeError("the tables of threads and processes differ")
    print(machine() + "\n")
    rows = [
        [
            executor,
            str(workers),
            digits(t),
            digits(n / t),
            ratio(times[executor, 1], t),
            ratio(times["threads", 1], t),
        ]
        for (executor, workers), t in times.items()
    ]
    header = [
        f"{n} runs of {end:g} s",
        "workers",
        "seconds",
        "runs per second",
        "speed over one worker",
        "over one thread",
    ]
    print(table(header, rows))
    return times


if __name__ == "__main__":
    main()
