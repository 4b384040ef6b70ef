"""Mechanisms and initial points of the runs of a sweep or an ensemble.

Runs that differ in start values share a mechanism, and so do those whose other parameters are written in place.
"""

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache, partial
from math import nan
from typing import Any, NamedTuple

import numpy as np

from ..data_types import Columns
from ..errors import InputError
from ..mechanism import Mechanism
from ..mechanism.assembly.initial_points import InitialPoints
from ..mechanism.formats.in_place_parameters import InPlaceParameters, in_place_parameters
from ..mechanism.formats.mechanism_file.template import CACHE_SIZE, START, Template
from ..mechanism.run_parameters import RunParameters
from ..system import Array
from .factories import ParametricFactory
from .run_columns import Indices, equal_rows, pick_rows, row

FEWEST = 8  # smallest number of runs for which parameters in place are sought, which takes as long as a few mechanisms
SHARED = "model", "constraints", "forces", "settings"  # parts of mechanisms that are identical if runs share one
FEWEST_SHARED = 3  # smallest number of runs for which a mechanism is copied and its bodies are examined
Values = Mapping[str, Any]


class RunStarts(NamedTuple):
    """Runs of a group that can begin, with their initial points.

    Attributes:
        i: indices of the runs, (k,).
        y: initial points, (k, n).
        parameters: parameters that are written in place; the mechanism belongs to this thread if there are any.
    """

    i: Array
    y: Array
    parameters: RunParameters = RunParameters()


class RunGroup(NamedTuple):
    """Runs that share a mechanism.

    Attributes:
        mech: a mechanism with the parameters of the runs, but perhaps with other start values.
        begin: returns the runs that can begin with this mechanism. Each remaining run forms its own group, unless
            its mechanism cannot be constructed.
    """

    mech: Mechanism
    begin: Callable[[], RunStarts]


class _Shared(NamedTuple):
    mech: Mechanism
    points: InitialPoints
    in_place: InPlaceParameters | None


class VariedStarts:
    """Mechanisms of a factory, with their initial points.

    Args:
        factory: the factory.
        n: number of runs of all groups.
        start_time: returns the start time of a mechanism in s.
        supports_in_place: returns whether parameters of a mechanism may be written in place; never if omitted.
    """

    def __init__(
        self,
        factory: ParametricFactory,
        n: int,
        start_time: Callable[[Mechanism], float],
        supports_in_place: Callable[[Mechanism], bool] | None = None,
    ) -> None:
        self.factory, self.n, self.start_time, self.supports_in_place = factory, n, start_time, supports_in_place
        self.shared, self._in_place = dict[Any, _Shared](), dict[tuple[str, ...], tuple[str, ...]]()
        self._names = cache(self._start_values)  # computed once: all runs of a grid vary the same parameters

    def names(self, values: Iterable[str]) -> tuple[str, ...]:
        """Return the names that are start values; none for a function, which may return any mechanism."""
        return self._names(tuple(values))

    def _start_values(self, names: Sequence[str]) -> tuple[str, ...]:
        if not isinstance(self.factory, Template):
            return ()
        return tuple(name for name in names if name.startswith(START) and name not in self.factory.parameters)

    def names_in_place(self, columns: Columns) -> tuple[str, ...]:
        """Return the parameters that can be written in place; none for few runs, or an invalid first one."""
        names = (*columns,)
        if names not in self._in_place and self.n >= FEWEST:
            with suppress(Exception):
                self._in_place[names] = self._find_in_place(names, row(columns, 0))
        return self._in_place.get(names, ())

    def _find_in_place(self, names: Sequence[str], values: Values) -> tuple[str, ...]:
        factory, supports = self.factory, self.supports_in_place
        if supports is None or not isinstance(factory, Template) or not supports(factory.make(values)):
            return ()
        candidates = [name for name in names if name not in self.names(names)]
        found = [name for name in candidates if in_place_parameters(factory, [name], values)]
        return tuple(found) if len(found) < 2 or in_place_parameters(factory, found, values) else ()

    def groups(self, columns: Columns, n: int) -> Iterator[RunGroup]:
        """Yield runs that share a mechanism, without those whose mechanism cannot be constructed.

        Args:
            columns: values of the parameters of n runs.
            n: number of runs.
        """
        if not isinstance(self.factory, Template):  # a function may return any mechanism
            for k in range(n):
                yield from self._single(columns, k)
            return
        in_place = self.names_in_place(columns)
        for i in equal_rows(columns, self._common(columns, in_place), n):
            yield from self._groups(columns, i, in_place)

    def _common(self, columns: Columns, in_place: Sequence[str]) -> list[str]:
        """Return the names of parameters whose values are equal in a group."""
        varied = {*self.names(columns), *in_place}
        return [name for name in columns if name not in varied]

    def _groups(self, columns: Columns, i: Indices, in_place: Sequence[str]) -> Iterator[RunGroup]:
        """Yield the groups of runs i, whose parameters are equal, except start values and those in place."""
        common = self._common(columns, in_place)
        key: Any = (*columns,), repr([columns[name][i[0]] for name in common])
        if in_place:
            key = key, threading.get_ident()  # the mechanism belongs to this thread
            if key not in self.shared and len(i) < FEWEST_SHARED:
                for k in i:
                    yield from self._groups(columns, [k], ())
                return
        elif len(i) == 1 and len(common) == len(columns):
            yield from self._single(columns, i[0])
            return
        for k, first in enumerate(i):
            try:
                shared = self._shared(key, in_place, row(columns, first))
            except Exception:
                yield from self._single(columns, first)
                continue
            separate = list[int]()  # runs that need a mechanism each
            yield RunGroup(shared.mech, partial(self._begin, shared, columns, i[k:], separate))
            for run in separate:
                yield from self._single(columns, run)
            return

    def _single(self, columns: Columns, i: int) -> Iterator[RunGroup]:
        def begin() -> RunStarts:
            with suppress(Exception):
                return RunStarts(np.array([i]), mech.point(t=self.start_time(mech))[None])
            return RunStarts(np.array([], int), np.empty((0, 0)))

        with suppress(Exception):
            mech = self.factory.make(row(columns, i))
            yield RunGroup(mech, begin)

    def _shared(self, key: Any, in_place: Sequence[str], values: Values) -> _Shared:
        """Return the mechanism that runs share, with its initial points and parameters in place.

        Raises:
            MbdaeError: if the mechanism cannot be constructed, or parameters of the first run not be written in place.
        """
        if shared := self.shared.get(key):
            return shared
        if len(self.shared) >= CACHE_SIZE:
            self.shared.clear()
        found = None
        if in_place:
            found = in_place_parameters(self.factory, in_place, values)  # type: ignore[arg-type]
            if not found:
                raise InputError("these values cannot be written in place")
        mech = found.mech if found else self.factory.make(values)
        names = tuple(name.removeprefix(START) for name in self.names(values))
        return self.shared.setdefault(key, _Shared(mech, InitialPoints(mech, names, self.start_time(mech)), found))

    def _begin(self, shared: _Shared, columns: Columns, i: Indices, separate: list[int]) -> RunStarts:
        """Return the runs that can begin, see `RunGroup`; append the remaining ones to ``separate``."""
        mech, points, found = shared
        parameters, which = RunParameters(), np.array(i)
        if found:
            numbers = found.rows(pick_rows(columns, i))
            valid = np.isfinite(numbers).all(axis=1)
            which, numbers = which[valid], numbers[valid]
            parameters = RunParameters(found.locations, numbers)
        starts = pick_rows(columns, which.tolist())
        inertias = parameters if found and found.bodies else RunParameters()
        y = points.at([starts[name] for name in self.names(columns)], len(which), inertias)
        if not found:
            for k in np.flatnonzero(np.isnan(y).any(axis=1)).tolist():
                y[k] = self._point(mech, row(starts, k))
        valid = ~np.isnan(y).any(axis=1)
        separate += sorted({*i} - {*which[valid].tolist()})
        return RunStarts(which[valid], y[valid], parameters.of_runs(valid))

    def _point(self, shared: Mechanism, values: Values) -> Array | float:
        """Return the initial point (n,) of a run that shares a mechanism; nan if its own mechanism fails or differs."""
        with suppress(Exception):
            mech = self.factory.make(values)
            if all(getattr(mech, part) is getattr(shared, part) for part in SHARED):
                return mech.point(t=self.start_time(mech))
        return nan
