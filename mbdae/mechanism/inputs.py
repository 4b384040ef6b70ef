"""Inputs of a mechanism: functions of time whose values are set while it is simulated."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..errors import InputError, UnknownNameError
from .closures.driver import Driver
from .time_functions.input_functions import Input, InputHistory, InputSetting
from .variant import variant

if TYPE_CHECKING:
    from .mechanism import Mechanism


class Inputs:
    """The inputs of a mechanism, and a copy of it in which they can be set.

    Args:
        mechanism: with any number of inputs in its forces and drivers; one without inputs is not copied.

    Attributes:
        original: the mechanism.
        mechanism: the copy.
        named: the inputs by name.
        cells: those of the copy.
        by_rate: names of those whose rate enters the accelerations, so that they jump with it.

    Raises:
        InputError: for inputs of one name with different settings, or in a driver whose speed they would let jump.
    """

    def __init__(self, mechanism: "Mechanism") -> None:
        self.original, self.named = mechanism, dict[str, Input]()
        for force in mechanism.forces:
            _mapped(force, self._collect)
        for driver in mechanism.drivers:
            _mapped(driver, lambda x, driver=driver: self._collect(_continuous(x, driver)))
        self.cells = {name: x.cell(i) for i, (name, x) in enumerate(self.named.items())}
        self.mechanism = self.replaced(self.cells) if self.named else mechanism
        self.by_rate = {d.path.name for d in self.mechanism.drivers if isinstance(d.path, Input)}
        for law, _ in self.mechanism.bind_forces(self.mechanism.make_workspace()).bound:
            self.by_rate |= {u.name for u in law.differentiated if isinstance(u, Input)}

    def _collect(self, value: Input) -> Input:
        known = self.named.setdefault(value.name, value)
        if known != value:
            raise InputError(f"input {value.name!r} is given twice, with different settings")
        return value

    def replaced(self, replaced: Mapping[str, Any], m: "Mechanism | None" = None) -> "Mechanism":
        """Return the mechanism, or a variant of it, with functions of time in place of its inputs."""
        m, change = m or self.original, lambda x: replaced[x.name]
        drivers = [_mapped(d, change) for d in m.drivers]
        return variant(m, forces=[_mapped(f, change) for f in m.forces], drivers=drivers, source=None)

    def cell(self, name: str) -> Input:
        """Return an input that can be set.

        Raises:
            UnknownNameError: lists the inputs.
        """
        if name not in self.cells:
            raise UnknownNameError("input", name, self.cells)
        return self.cells[name]

    @property
    def values(self) -> dict[str, InputSetting]:
        """The present setting of each input."""
        return {name: cell.setting for name, cell in self.cells.items()}

    def recorded(self, history: Mapping[str, Sequence[InputSetting]]) -> "Mechanism":
        """Return the mechanism with the inputs as functions of time."""
        if not self.named:
            return self.original
        pieces = {name: tuple(map(tuple, settings)) for name, settings in history.items()}
        return self.replaced({name: InputHistory(name=name, pieces=x) for name, x in pieces.items()})


def _continuous(value: Input, driver: Driver) -> Input:
    """Return the input of a driver.

    Raises:
        InputError: for a motion, whose speed would jump with its rate; for a speed that jumps: that is an impact.
    """
    if driver.speed is None or value.hold != "first":
        what = "motion" if driver.speed is None else "speed"
        use = "a driver follows an input as its speed, with hold = 'first'"
        raise InputError(f"driver {driver.name!r}: input {value.name!r} lets its {what} jump, an impact: {use}")
    return value


def _mapped(value: Any, change: Any) -> Any:
    """Return a force, or a value of its keys, with its inputs replaced."""
    if isinstance(value, Input):
        return change(value)
    if isinstance(value, tuple):
        return tuple(_mapped(x, change) for x in value)
    if not hasattr(type(value), "model_fields"):
        return value
    found = {name: getattr(value, name) for name in type(value).model_fields}
    update = {name: new for name, x in found.items() if (new := _mapped(x, change)) is not x}
    if not update:
        return value
    out = value.model_copy(update=update)
    for name in vars(out).keys() - found.keys():  # cached properties, of the inputs before
        del vars(out)[name]
    return out
