"""Starts of the runs of a sweep or an ensemble: runs that differ in start values share one mechanism."""

import json
from collections.abc import Callable, Iterable, Mapping

from ..mechanism import Mechanism
from ..mechanism.assembly.start_points import StartPoints
from ..mechanism.formats.mechanism_file.template import CACHE_SIZE, START, Template
from ..system import Array
from .makers import Maker


class VariedStarts:
    """Mechanisms of a factory with their points at the start.

    Args:
        maker: the factory.
        start_time: returns the start time of a mechanism in s.
    """

    def __init__(self, maker: Maker, start_time: Callable[[Mechanism], float]) -> None:
        self.maker, self.start_time = maker, start_time
        self.shared = dict[str, tuple[Mechanism, StartPoints]]()

    def names(self, values: Iterable[str]) -> list[str]:
        """Return the names that are start values: those of a user's function may be anything."""
        if not isinstance(self.maker, Template):
            return []
        return [name for name in values if name.startswith(START) and name not in self.maker.parameters]

    def make(self, values: Mapping[str, object]) -> tuple[Mechanism, Array]:
        """Return a mechanism with values of its parameters, apart from its start values, and the point at its start.

        Raises:
            UnknownNameError, InputError, AssemblyError: as the factory, and `Mechanism.start_at`.
        """
        start = {name: values[name] for name in self.names(values)}
        if not start:
            return self._made(values)
        key = json.dumps([list(start), {n: x for n, x in values.items() if n not in start}])
        mech, points = self.shared.get(key) or self._share(key, values, start)
        point = points.at(start)
        return self._made(values) if point is None else (mech, point)

    def _share(self, key: str, values: Mapping[str, object], start: Iterable[str]) -> tuple[Mechanism, StartPoints]:
        if len(self.shared) >= CACHE_SIZE:
            self.shared.clear()
        mech = self.maker.make(values)
        points = StartPoints(mech, tuple(name.removeprefix(START) for name in start), self.start_time(mech))
        return self.shared.setdefault(key, (mech, points))

    def _made(self, values: Mapping[str, object]) -> tuple[Mechanism, Array]:
        mech = self.maker.make(values)
        return mech, mech.point(t=self.start_time(mech))
