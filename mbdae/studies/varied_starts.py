"""Mechanisms and initial points of the runs of a sweep or an ensemble.

Runs that differ in start values share a mechanism, and so do those whose other parameters are written in place.
"""

import json
import threading
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from ..integrate.run.core_runs import RunParameters
from ..mechanism import Mechanism
from ..mechanism.assembly.initial_points import InitialPoints
from ..mechanism.formats.in_place_parameters import InPlaceParameters, in_place_parameters
from ..mechanism.formats.mechanism_file.template import CACHE_SIZE, START, Template
from ..system import Array
from .factories import ParametricFactory

FEWEST = 8  # runs for which parameters in place are sought: it takes longer than a few mechanisms
FEWEST_SHARED = 3  # runs for which a mechanism is copied and its bodies are examined
Key = tuple[tuple[str, ...], str]  # names of parameters, and the values that runs have in common
Values = Mapping[str, Any]


class Beginning(NamedTuple):
    """Beginning of a run.

    Attributes:
        mech: a mechanism with its parameters, but perhaps with other start values.
        point: the initial point, (n,).
        in_place: parameters that are written in the mechanism's core; the mechanism belongs to this thread then.
        values: their numbers in the core, (k,).
    """

    mech: Mechanism
    point: Array
    in_place: InPlaceParameters | None = None
    values: Array | None = None

    @property
    def shared_parts(self) -> tuple[int, ...]:
        """Identities of what runs have in common that can be completed together."""
        mech = self.mech
        return id(mech.model), id(mech.constraints), id(mech.forces), id(mech.settings)


def run_parameters(runs: Sequence[Beginning]) -> RunParameters:
    """Return the parameters in place of runs that share a mechanism."""
    found = runs[0].in_place
    return RunParameters(found.locations, np.array([run.values for run in runs])) if found else RunParameters()


def _owner(key: Key) -> tuple[Key, int]:
    """Return the key of a mechanism that belongs to this thread."""
    return key, threading.get_ident()


class _Shared(NamedTuple):
    mech: Mechanism
    points: InitialPoints
    in_place: InPlaceParameters | None


class VariedStarts:
    """Mechanisms of a factory, with their initial points.

    Args:
        factory: the factory.
        start_time: returns the start time of a mechanism in s.
        supports_in_place: returns whether parameters of a mechanism may be written in place; never if omitted.
    """

    def __init__(
        self,
        factory: ParametricFactory,
        start_time: Callable[[Mechanism], float],
        supports_in_place: Callable[[Mechanism], bool] | None = None,
    ) -> None:
        self.factory, self.start_time, self.supports_in_place = factory, start_time, supports_in_place
        self.shared, self._in_place = dict[Any, _Shared](), dict[tuple[str, ...], tuple[str, ...]]()
        self._names = cache(self._start_values)  # all runs of a grid have the same

    def names(self, values: Iterable[str]) -> tuple[str, ...]:
        """Return the names that are start values; none for a function, which may return any mechanism."""
        return self._names(tuple(values))

    def _start_values(self, names: Sequence[str]) -> tuple[str, ...]:
        if not isinstance(self.factory, Template):
            return ()
        return tuple(name for name in names if name.startswith(START) and name not in self.factory.parameters)

    def names_in_place(self, runs: Sequence[Values]) -> tuple[str, ...]:
        """Return the parameters that can be written in place; none for few runs where they are not known."""
        names = tuple(runs[0])
        if names not in self._in_place and len(runs) >= FEWEST:
            with suppress(Exception):  # the first run has the message
                self._in_place[names] = self._find_in_place(names, runs[0])
        return self._in_place.get(names, ())

    def _find_in_place(self, names: Sequence[str], values: Values) -> tuple[str, ...]:
        factory, supports = self.factory, self.supports_in_place
        if supports is None or not isinstance(factory, Template) or not supports(factory.make(values)):
            return ()
        others = [name for name in names if name not in self.names(names)]
        found = [name for name in others if in_place_parameters(factory, [name], values)]
        return tuple(found) if len(found) < 2 or in_place_parameters(factory, found, values) else ()

    def make(self, runs: Sequence[Values]) -> Iterator[Beginning | Exception]:
        """Yield the beginning of each run, or the exception that prevents it.

        A shared mechanism has the start values of its first run. Points are computed together: from the second run on,
        or of all runs with parameters in place.
        """
        in_place = self.names_in_place(runs)
        alike = self._alike(runs, in_place)
        if in_place and any(_owner(key) not in self.shared and len(i) < FEWEST_SHARED for key, i in alike.items()):
            in_place, alike = (), self._alike(runs, ())
        parts = [(key, part) for key, i in alike.items() for part in ((i,) if in_place else (i[:1], i[1:])) if part]
        together, ahead = {part[0]: (key, part) for key, part in parts}, dict[int, Beginning]()
        for i, values in enumerate(runs):
            if i in together:
                key, part = together[i]
                ahead |= self._points(key, in_place, part, [runs[k] for k in part])
            yield ahead.pop(i) if i in ahead else self._made(values)

    def _alike(self, runs: Sequence[Values], in_place: Sequence[str]) -> dict[Key, list[int]]:
        """Return the indices of runs that share a mechanism, by what they have in common."""
        out, names, others = defaultdict[Key, list[int]](list), None, list[str]()
        for i, values in enumerate(runs):
            if names is None or names != (*values,):
                names = tuple(values)
                varied = {*self.names(names), *in_place}
                others = [name for name in names if name not in varied]
            if len(others) < len(names):
                out[names, json.dumps([values[name] for name in others]) if others else ""].append(i)
        return out

    def _points(
        self, key: Key, in_place: Sequence[str], which: Sequence[int], runs: Sequence[Values]
    ) -> dict[int, Beginning]:
        """Return the beginnings of runs that share a mechanism, without those that need their own."""
        names, inertias = self.names(key[0]), list[dict[int, Any]]()
        rows: Sequence[Array | None] = [None] * len(runs)
        try:
            mech, points, found = self._shared(key, in_place, runs[0])
            if found:
                all_rows = found.rows(runs)
                valid = np.flatnonzero(np.isfinite(all_rows).all(axis=1)).tolist()
                which, runs = [which[k] for k in valid], [runs[k] for k in valid]
                finite = all_rows[valid]
                rows, inertias = [*finite], found.inertias(finite)
            at_start = points.at([[values[name] for values in runs] for name in names], len(runs), inertias)
        except Exception:  # their own mechanisms cannot be made, either
            return {}
        ready = zip(which, at_start, rows, strict=True)
        return {i: Beginning(mech, point, found, row) for i, point, row in ready if point is not None}

    def _shared(self, key: Key, in_place: Sequence[str], values: Values) -> _Shared:
        """Return what runs share; a mechanism with parameters in place belongs to this thread."""
        owner = _owner(key) if in_place else key
        if shared := self.shared.get(owner):
            return shared
        if len(self.shared) >= CACHE_SIZE:
            self.shared.clear()
        found = None
        if in_place:
            found = in_place_parameters(self.factory, in_place, values)  # type: ignore[arg-type]
            assert found, "of parameters that can be written in place"
        mech = found.mech if found else self.factory.make(values)
        names = tuple(name.removeprefix(START) for name in self.names(key[0]))
        return self.shared.setdefault(owner, _Shared(mech, InitialPoints(mech, names, self.start_time(mech)), found))

    def _made(self, values: Values) -> Beginning | Exception:
        try:
            mech = self.factory.make(values)
            return Beginning(mech, mech.point(t=self.start_time(mech)))
        except Exception as e:
            return e
