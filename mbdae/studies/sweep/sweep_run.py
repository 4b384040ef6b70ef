"""One run of a sweep, from parameter values to a row, in any thread, process or machine."""

import inspect
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import chain
from time import perf_counter
from typing import Any

import numpy as np

from ...errors import AssemblyError, InputError, MbdaeError, UnknownNameError
from ...integrate.options.options import RunOptions
from ...integrate.run.core_runs import COUNTS, supports_parameters_in_place
from ...integrate.solve import solve
from ...mechanism import Mechanism
from ...solution.signals import units
from ..factories import Model, ParametricFactory, factory_of
from ..final_signals import need_only_kinematics
from ..varied_starts import VariedStarts
from ..workers import Stop, stop_check
from .outputs import Output, evaluate, parse
from .plan import Runs, Task
from .results_file import MORE, Row

SOLVE = "solve."
NOT_SETTINGS = ("problem", "t_span", "q", "v", "s", "t_eval", "progress")
FAILURES = {  # statuses of runs without a solution
    "input": "an invalid value",
    "assembly": "no consistent start was found",
    "output": "an output could not be computed",
    "error": "an unexpected error",
}


@dataclass
class Job:
    """Data that all runs of a sweep share, and that other processes receive.

    Attributes:
        model: a mechanism that was loaded, an argument of `mbdae.load`, or a function that returns a Mechanism.
        t_span: start and end in s; from 0 to the model's duration when None.
        times: number of equidistant times, or the times, at which signals are evaluated; the steps when None.
        outputs: results of each run.
        settings: arguments of `mbdae.solve`.
        runs: number of runs.
        columns: names of the columns of the table.
        key: text that identifies the sweep in a cache of factories.
    """

    model: Model
    t_span: tuple[float, float] | None = None
    times: int | tuple[float, ...] | None = None
    outputs: tuple[Output, ...] = ()
    settings: dict[str, Any] = field(default_factory=dict)
    runs: int = 1
    columns: tuple[str, ...] = ()
    key: str = ""

    def __getstate__(self) -> dict[str, Any]:
        """Return the data for other processes, without mechanisms and their factory."""
        return {name: x for name, x in vars(self).items() if name not in ("factory", "varied_starts")}

    @cached_property
    def factory(self) -> ParametricFactory:
        """Factory of the mechanisms; files are read once for a sweep."""
        return _cached_factory(self.model, self.key) if self.key else factory_of(self.model)

    @cached_property
    def varied_starts(self) -> VariedStarts:
        """Mechanisms with their points at the start."""
        start_time, supported = lambda mech: self.span(mech)[0], self._supports_parameters_in_place
        return VariedStarts(self.factory, self.runs, start_time, supported)

    def _supports_parameters_in_place(self, mech: Mechanism) -> bool:
        options = RunOptions.from_settings(mech, self.span(mech), self.settings)
        return supports_parameters_in_place(options) and need_only_kinematics(mech, self.signals)

    @property
    def signals(self) -> list[str]:
        """Signals of outputs that are text."""
        return [parse(x).signal for x in self.outputs if isinstance(x, str)]

    def span(self, mech: Mechanism) -> tuple[float, float]:
        """Return start and end in s."""
        return (0.0, mech.duration) if self.t_span is None else self.t_span

    def sample_times(self, mech: Mechanism) -> np.ndarray | None:
        """Return the times at which signals are evaluated; None for the steps."""
        if isinstance(self.times, int):
            return np.linspace(*self.span(mech), self.times)
        return None if self.times is None else np.array(self.times)


def split(
    values: Mapping[str, Any], factory: ParametricFactory, seed: int | Sequence[int]
) -> tuple[Mapping[str, Any], dict[str, Any]]:
    """Return values for the mechanism, with its seed if it has that parameter, and settings of `mbdae.solve`.

    The values are those of one run, or columns of many runs with their seeds.
    """
    settings, parameters = dict[str, Any](), values
    if any(n.startswith(SOLVE) for n in values):
        settings = {n.removeprefix(SOLVE): x for n, x in values.items() if n.startswith(SOLVE)}
        parameters = {n: x for n, x in values.items() if not n.startswith(SOLVE)}
    return ({"seed": seed, **parameters} if "seed" in factory.parameters else parameters), settings


@lru_cache(4)
def _cached_factory(model: Any, key: str) -> ParametricFactory:
    return factory_of(model)


def run(job: Job, task: Task, stop: Stop) -> tuple[Row, float]:
    """Run one task; return its row, and its wall time in s. Any failure is a status and a message in the row."""
    started, row = perf_counter(), empty_row(job, task)
    try:
        row |= _solve(job, task, stop)
    except AssemblyError as e:
        row |= {"status": "assembly", "message": str(e)}
    except InputError as e:
        row |= {"status": "input", "message": str(e)}
    except Exception as e:
        reason = str(e) if isinstance(e, MbdaeError) else f"{type(e).__name__}: {e}"
        row |= {"status": "error", "message": " ".join(reason.split())}
    return row, perf_counter() - started


def empty_row(job: Job, task: Task) -> Row:
    """Return the row of a run without results."""
    return {**dict.fromkeys(job.columns), **task.values, "run": task.run, "seed": task.seed, MORE: {}}


def _solve(job: Job, task: Task, stop: Stop) -> Row:
    values, settings = split(task.values, job.factory, task.seed)
    mech = job.factory.make(values)
    times = job.sample_times(mech)
    sol = solve(mech, job.span(mech), t_eval=times, progress=stop_check(stop), **{**job.settings, **settings})
    row = {"status": sol.status, "message": sol.message, "t": float(sol.nodes[0][-1])}
    row |= {name: sol.stats.get(name) for name in (*COUNTS, "backend")}
    if not sol.success:
        return row
    try:
        numbers, samples, more = evaluate(sol, job.outputs, None if times is None else len(times))
    except InputError as e:
        return {**row, "status": "output", "message": str(e)}
    row |= {**numbers, **samples}
    if clashes := sorted(name for name in more if name in job.columns):
        text = f"an output function returns {clashes[0]!r}, which is a column of the table already"
        return {**row, "status": "output", "message": text}
    return {**row, MORE: more}


def known_signals(job: Job, plan: Sequence[Runs], mech: Mechanism) -> dict[str, str]:
    """Return units of signals by name: of the first mechanism, and of further ones until all outputs are known.

    Mechanisms that differ only in float-valued parameters have the same signals.
    """
    requested = {*job.signals}
    factory, found, made = job.factory, units(mech) if requested else {}, set[str]()
    for task in chain.from_iterable(runs.tasks() for runs in plan):
        if requested <= found.keys():
            break
        values, _ = split(task.values, factory, task.seed)
        kind = repr([(name, x) for name, x in values.items() if not isinstance(x, float | list)])
        if kind not in made:
            with suppress(Exception):  # the row of the run has the message
                found |= units(factory.make(values))
                made.add(kind)
    return found


def check_settings(
    settings: Iterable[str], function: Callable[..., Any] = solve, excluded: Collection[str] = NOT_SETTINGS
) -> None:
    """Reject names that are not arguments of a function, or are among ``excluded``.

    Raises:
        UnknownNameError: for such a name; lists the valid ones.
    """
    valid = [name for name in inspect.signature(function).parameters if name not in excluded]
    for name in settings:
        if name not in valid:
            raise UnknownNameError(f"setting of {function.__name__}", name, valid)
