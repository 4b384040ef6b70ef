"""Cost of an impact or a change of the mode beyond the steps of its run, resolved in the core or in Python, by model.

For comparison, all transitions are located and resolved in Python, one step at a time. With the CPU times T of runs at
two tolerances and of one of no duration, T = T_0 + steps * T_step + transitions * T_transition; rejected steps count.
"-" where this has no positive solution: steps at both tolerances differ in their cost.

Run: python examples/benchmarks/impacts.py [--brief]
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from time import process_time
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from common import brief, machine, medians, microseconds, ratio, table

import mbdae
from mbdae.integrate.events import mode_changes

MODELS = {  # span in s: until a contact closes, or the whole run
    "pendulum_on_stop": (4.2829, 8.0),
    "slider_crank_with_stop": (0.632, 3.0),
    "bouncing_chain": (0.5, 3.0),
    "woodpecker": (1.0,),
    "ratchet": (6.0,),
    "stick_slip_slider": (3.0,),
    "geneva_drive": (5.0,),
}
RTOL = 1e-7, 1e-10
NO_DURATION = 1e-9  # s


class Cost(NamedTuple):
    """Cost of a run at the first tolerance.

    Attributes:
        transitions: impacts and changes of mode.
        in_core: of these, resolved in the core.
        seconds: CPU time of the run.
        step: CPU time of a step.
        transition: CPU time of a transition beyond its steps; not positive where the two cannot be separated.
    """

    transitions: int
    in_core: int
    seconds: float
    step: float
    transition: float


@contextmanager
def in_python() -> Iterator[None]:
    """Leave all modes to Python."""
    with patch.object(mode_changes, "core_switches", lambda system: None):
        yield


def seconds(mechanism: mbdae.Mechanism, where: AbstractContextManager[None], **options: Any) -> float:
    """CPU seconds of a run."""
    with where:
        began = process_time()
        mbdae.solve(mechanism, **options)
        return process_time() - began


def cost(
    mechanism: mbdae.Mechanism, end: float, where: Callable[[], AbstractContextManager[None]], repeats: int
) -> Cost:
    """Measure the runs of a mechanism: T = T_0 + steps * T_step + transitions * T_transition at two tolerances."""
    options: list[dict[str, Any]] = [{"rtol": rtol, "t_span": (0, end)} for rtol in RTOL]
    with where():
        stats = [mbdae.solve(mechanism, **x).stats for x in options]
    options.append({"t_span": (0, NO_DURATION)})
    times = medians({i: lambda x=x: seconds(mechanism, where(), **x) for i, x in enumerate(options)}, repeats)
    counts = np.array([[s["steps"] + s["rejected"], s["transitions"]] for s in stats], float)
    step, transition = np.linalg.solve(counts, [times[0] - times[2], times[1] - times[2]])
    return Cost(stats[0]["transitions"], stats[0]["transitions_in_core"], times[0], float(step), float(transition))


def main(argv: Sequence[str] | None = None) -> dict[tuple[str, float], tuple[Cost, Cost]]:
    """Print the table and return the costs, in the core and in Python, by model and duration."""
    short = brief(argv, __doc__)
    found, rows = {}, []
    runs = [(name, end) for name, ends in MODELS.items() for end in ends]
    for name, end in runs[:1] if short else runs:
        mechanism = mbdae.load(name)
        core, python = found[name, end] = tuple(
            cost(mechanism, end, where, 1 if short else 9) for where in (nullcontext, in_python)
        )
        in_core = f"{core.in_core} of {core.transitions}"
        times = [
            [f"{1e3 * x.seconds:.3g}", *(microseconds(t if t > 0 else None) for t in (x.step, x.transition))]
            for x in (core, python)
        ]
        both = [f"{a} / {b}" for a, b in zip(*times, strict=True)]
        rows.append([f"{name}, {end:g} s", in_core, *both, ratio(python.seconds, core.seconds)])
    print(machine() + "\n")
    head = ["core / in Python", "transitions in the core", "ms a run", "us a step", "us a transition", "Python / core"]
    print(table(head, rows))
    return found


if __name__ == "__main__":
    main()
