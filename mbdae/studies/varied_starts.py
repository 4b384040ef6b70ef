"""Initial points of the runs of a sweep or an ensemble: those that differ only in start values share a mechanism."""

import json
from collections.abc import Callable, Iterable, Mapping

from ..mechanism import Mechanism
from ..mechanism.assembly.initial_points import InitialPoints
from ..mechanism.formats.mechanism_file.template import CACHE_SIZE, START, Template
from ..system import Array
from .factories import ParametricFactory


class VariedStarts:
    """Mechanisms of a factory, with their initial points.

    Args:
        factory: the factory.
        start_time: returns the start time of a mechanism in s.
    """

    def __init__(self, factory: ParametricFactory, start_time: Callable[[Mechanism], float]) -> None:
        self.factory, self.start_time = factory, start_time
        self.shared = dict[str, tuple[Mechanism, InitialPoints]]()

    def names(self, values: Iterable[str]) -> list[str]:
        """Return the names that are start values; none for a function, which may return any mechanism."""
        if not isinstance(self.factory, Template):
            return []
        return [name for name in values if name.startswith(START) and name not in self.factory.parameters]

    def make(self, values: Mapping[str, object]) -> tuple[Mechanism, Array]:
        """Return a mechanism with these parameters and its initial point; a shared one has other start values.

        Raises:
            UnknownNameError, InputError, AssemblyError: as raised by the factory, and by `Mechanism.start_at`.
        """
        start = {name: values[name] for name in self.names(values)}
        if not start:
            return self._made(values)
        key = json.dumps([list(start), {n: x for n, x in values.items() if n not in start}])
        mech, points = self.shared.get(key) or self._share(key, values, start)
        point = points.at(start)
        return self._made(values) if point is None else (mech, point)

    def _share(self, key: str, values: Mapping[str, object], start: Iterable[str]) -> tuple[Mechanism, InitialPoints]:
        if len(self.shared) >= CACHE_SIZE:
            self.shared.clear()
        mech = self.factory.make(values)
        points = InitialPoints(mech, tuple(name.removeprefix(START) for name in start), self.start_time(mech))
        return self.shared.setdefault(key, (mech, points))

    def _made(self, values: Mapping[str, object]) -> tuple[Mechanism, Array]:
        mech = self.factory.make(values)
        return mech, mech.point(t=self.start_time(mech))
