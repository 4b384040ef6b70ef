"""Initial points of the runs of a sweep or an ensemble: those that differ only in start values share a mechanism."""

import json
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any

from ..mechanism import Mechanism
from ..mechanism.assembly.initial_points import InitialPoints
from ..mechanism.formats.mechanism_file.template import CACHE_SIZE, START, Template
from ..system import Array
from .factories import ParametricFactory

Key = tuple[tuple[str, ...], str]  # names of parameters, and the values that are no start values

class VariedStarts:
    """Mechanisms of a factory, with their initial points.

    Args:
        factory: the factory.
        start_time: returns the start time of a mechanism in s.
    """

    def __init__(self, factory: ParametricFactory, start_time: Callable[[Mechanism], float]) -> None:
        self.factory, self.start_time = factory, start_time
        self.shared = dict[Key, tuple[Mechanism, InitialPoints]]()
        self._names = cache(self._start_values)  # all runs of a grid have the same

    def names(self, values: Iterable[str]) -> tuple[str, ...]:
        """Return the names that are start values; none for a function, which may return any mechanism."""
        return self._names(tuple(values))

    def _start_values(self, names: Sequence[str]) -> tuple[str, ...]:
        if not isinstance(self.factory, Template):
            return ()
        return tuple(name for name in names if name.startswith(START) and name not in self.factory.parameters)

    def make(self, runs: Sequence[Mapping[str, object]]) -> Iterator[tuple[Mechanism, Array] | Exception]:
        """Yield a mechanism with the parameters of each run and its initial point, or the exception that prevents it.

        A shared mechanism has the start values of its first run. Points are computed together from the second run on.
        """
        alike, ahead = defaultdict[Any, list[int]](list), dict[int, Any]()
        for i, values in enumerate(runs):
            if key := self._key(values):
                alike[key].append(i)
        together = {part[0]: (key, part) for key, group in alike.items() for part in (group[:1], group[1:]) if part}
        for i, values in enumerate(runs):
            if i in together:
                key, part = together[i]
                ahead |= self._points(key, part, [runs[k] for k in part])
            yield ahead.pop(i, None) or self._made(values)

    def _key(self, values: Mapping[str, object]) -> Key | None:
        """Return what runs that share a mechanism have in common; None for a run without start values."""
        names = tuple(values)
        start = self.names(names)
        others = [x for name, x in values.items() if name not in start]
        return (names, json.dumps(others) if others else "") if start else None

    def _points(
        self, key: Key, numbers: Sequence[int], runs: Sequence[Mapping[str, object]]
    ) -> dict[int, tuple[Mechanism, Array]]:
        """Return the shared mechanism and initial points of runs, without those that need their own mechanism."""
        names = self.names(key[0])
        try:
            mech, points = self.shared.get(key) or self._share(key, runs[0], names)
            found = points.at([[values[name] for values in runs] for name in names])
        except Exception:  # their own mechanisms cannot be made, either
            return {}
        return {i: (mech, point) for i, point in zip(numbers, found, strict=True) if point is not None}

    def _share(self, key: Key, values: Mapping[str, object], start: Iterable[str]) -> tuple[Mechanism, InitialPoints]:
        if len(self.shared) >= CACHE_SIZE:
            self.shared.clear()
        mech = self.factory.make(values)
        points = InitialPoints(mech, tuple(name.removeprefix(START) for name in start), self.start_time(mech))
        return self.shared.setdefault(key, (mech, points))

    def _made(self, values: Mapping[str, object]) -> tuple[Mechanism, Array] | Exception:
        try:
            mech = self.factory.make(values)
            return mech, mech.point(t=self.start_time(mech))
        except Exception as e:
            return e
