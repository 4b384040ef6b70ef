"""Batches of runs of an ensemble: each batch runs in the compiled core on one thread."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError
from ...integrate.options.options import RunOptions
from ...integrate.run.core_runs import (
    calls_python,
    consistent_starts,
    solve_in_core,
    supports_parameters_in_place,
)
from ...integrate.run.run_setup import prepare_at
from ...integrate.run.run_state import RunState
from ...mechanism import Mechanism
from ...system import Array
from ..factories import ParametricFactory
from ..final_signals import need_only_kinematics, reason_not_in_core, signals_at_end
from ..run_columns import equal_rows, row
from ..varied_starts import RunStarts, VariedStarts
from ..workers import StopFlag, batch_size
from .run_results import RunResults

NEEDS_PYTHON = "a singular configuration, a failed step, many steps or inaccurate results"
OTHER_MECHANISM = "a start or a parameter that requires a separate mechanism"
INCONSISTENT_START = "a start that may be inconsistent"


class Starts(NamedTuple):
    """Starts of n runs; q or v is None if the runs start as the model does."""

    n: int
    q: Array | None
    v: Array | None

    def arguments(self, i: int) -> tuple[Array | None, Array | None]:
        """Return q (nq,) and v (nv,) of run i, as arguments of `mbdae.solve`."""
        return (None if self.q is None else self.q[i]), (None if self.v is None else self.v[i])

    def points(self, mech: Mechanism, i: Array, model_points: Array) -> Array:
        """Return the initial points of the runs i, (k, n); ``model_points``, (k, n), are the starts of the model."""
        y = model_points.copy()
        if self.q is not None:
            y[:, : mech.nq] = self.q[i]
        if self.v is not None:
            y[:, mech.nq : mech.nq + mech.nv] = self.v[i]
        return y


@dataclass
class EnsembleJob:
    """Data that all runs of an ensemble share.

    Attributes:
        source: the mechanism, or its factory.
        t_span: start and end in s; from 0 to the model's duration when None.
        starts: the starts.
        parameters: values by name, (n,) each.
        names: names of the signals.
        settings: arguments of `mbdae.solve`.
        results: the results.
        calls_python: whether a run that is deferred to `mbdae.solve` calls functions of Python.
        seconds: mean wall time of the completed runs of the last batch in s; None before the first.
    """

    source: Mechanism | ParametricFactory
    t_span: Any
    starts: Starts
    parameters: dict[str, Array]
    names: tuple[str, ...]
    settings: dict[str, Any]
    results: RunResults
    calls_python: bool = False
    seconds: float | None = None

    def mechanism(self, i: int) -> Mechanism:
        """Return the mechanism of run i.

        Raises:
            InputError: if the length of its points differs from that of the results.
        """
        if isinstance(self.source, Mechanism):
            return self.source
        return self._checked(self.source.make(row(self._columns(np.array([i])), 0)))

    def _columns(self, i: Array) -> dict[str, list[Any]]:
        return {name: x[i].tolist() for name, x in self.parameters.items()}

    def _checked(self, mech: Mechanism) -> Mechanism:
        length, common = mech.nq + mech.nv + len(mech.states) + 1, self.results.y.shape[1]
        if length != common:
            raise InputError(
                f"{mech.title!r} has {length - 1} coordinates, velocities and states, the first run {common - 1}: "
                "runs of an ensemble have the same (mbdae.sweep takes others)"
            )
        return mech

    def begin(self, i: Array) -> Iterator[tuple[Mechanism, RunStarts]]:
        """Yield the runs that can begin, grouped by mechanism.

        Raises:
            MbdaeError: if none can begin, for the same reason.
        """
        if self.starts.q is not None and self.starts.v is not None:
            mech = self.mechanism(int(i[0]))
            points = np.tile([*np.zeros(mech.nq + mech.nv), *mech.states.values(), 0.0], (len(i), 1))
        elif isinstance(self.source, Mechanism):
            mech = self.source
            points = np.tile(mech.point(t=self.options(mech).t0), (len(i), 1))
        else:
            yield from self._begin_at_starts_of_model(i)
            return
        yield mech, RunStarts(i, self.starts.points(mech, i, points))

    def _begin_at_starts_of_model(self, i: Array) -> Iterator[tuple[Mechanism, RunStarts]]:
        """See `begin`: starts of the model depend on parameters. Runs that need separate mechanisms are deferred."""
        remaining = np.ones(len(i), bool)
        for group in self.varied_starts.groups(self._columns(i), len(i)):
            which, y, parameters = group.begin()
            if not len(which):
                continue
            runs, remaining[which] = i[which], False
            with self.results.recording_errors(runs):
                mech = self._checked(group.mech)
                yield mech, RunStarts(runs, self.starts.points(mech, runs, y), parameters)
        self.results.defer(i[remaining], OTHER_MECHANISM)

    @cached_property
    def varied_starts(self) -> VariedStarts:
        """Starts of the model by the parameters."""
        assert not isinstance(self.source, Mechanism)
        start_time, supported = lambda mech: self.options(mech).t0, self._supports_parameters_in_place
        return VariedStarts(self.source, self.starts.n, start_time, supported)

    def _supports_parameters_in_place(self, mech: Mechanism) -> bool:
        return supports_parameters_in_place(self.options(mech)) and need_only_kinematics(mech, self.names)

    def options(self, mech: Mechanism) -> RunOptions:
        """Return the options of a run.

        Raises:
            InputError: for invalid options.
        """
        return RunOptions.from_settings(mech, self.t_span, self.settings)

    def check(self, mech: Mechanism) -> None:
        """Reject options that are invalid or do not suit the mechanism.

        Raises:
            UnknownNameError, InputError: as `mbdae.solve`.
        """
        prepare_at(mech, self.options(mech), self.results.y[0]).release()

    def groups(self) -> Iterator[Array]:
        """Yield the indices of runs of the same mechanism, apart from its start values and parameters in place."""
        n, shared = self.starts.n, set[str]()
        if not isinstance(self.source, Mechanism):
            shared = {*self.varied_starts.names(self.parameters)}
            if self.starts.q is None or self.starts.v is None:
                shared |= {*self.varied_starts.names_in_place(self._columns(np.arange(1)))}
        columns = {name: x.tolist() for name, x in self.parameters.items() if name not in shared}
        yield from map(np.array, equal_rows(columns, columns, n))


def batches(job: EnsembleJob, pending: int) -> Iterator[list[Array]]:
    """Yield lists of indices of runs with the same mechanism, see `batch_size`."""
    batch, remaining, capacity = list[Array](), job.starts.n, 0
    for group in job.groups():
        while len(group):
            if capacity < min(len(group), size := batch_size(remaining, pending, job.seconds)):
                if batch:
                    yield batch
                batch, capacity = [], size
            taken, group = group[:capacity], group[capacity:]
            batch.append(taken)
            capacity, remaining = capacity - len(taken), remaining - len(taken)
    if batch:
        yield batch


def run_batch(job: EnsembleJob, batch: list[Array], stop: StopFlag) -> None:
    """Run a batch in the core; runs that need Python are marked, see `RunResults`."""
    started, completed = perf_counter(), 0
    for i in batch:
        if stop():
            return
        with job.results.recording_errors(i):
            for mech, begun in job.begin(i):
                with job.results.recording_errors(begun.i):
                    run = prepare_at(mech, job.options(mech), begun.y[0])
                    completed += _complete(job, run, begun, stop)
                    run.release()
    if completed:
        job.seconds = (perf_counter() - started) / completed


def _complete(job: EnsembleJob, run: RunState, begun: RunStarts, stop: StopFlag) -> int:
    """Run a group in the core; return the number of completed runs."""
    i, y, parameters = begun
    reason = reason_not_in_core(run, job.names)
    if reason:
        job.results.defer(i, reason)
        job.calls_python |= calls_python(run)
        return 0
    if job.starts.q is not None or job.starts.v is not None:
        consistent = consistent_starts(run, y, parameters)
        job.results.defer(i[~consistent], INCONSISTENT_START)
        i, y = i[consistent], y[consistent]
        parameters = parameters.of_runs(consistent)
    if not len(i):
        return 0
    runs = solve_in_core(run, y, stop.memory, parameters)
    i = i[: len(runs.finished)]
    job.results.defer(i[~runs.finished], NEEDS_PYTHON)
    job.results.store(i[runs.finished], run.options.t1, runs, signals_at_end(run, runs, job.names))
    return int(runs.finished.sum())
