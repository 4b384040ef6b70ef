"""Inputs of a mechanism: functions of time whose values are set while it is simulated."""

from collections.abc import Mapping, Sequence
from typing import Any

from ..errors import InputError, UnknownNameError
from .input_functions import Input, InputHistory, InputSetting
from .mechanism import Mechanism


class Inputs:
    """The inputs of a mechanism, and a copy of it in which they can be set.

    Args:
        mechanism: with any number of inputs in its forces; one without inputs is not copied.

    Attributes:
        original: the mechanism.
        mechanism: the copy.
        named: the inputs by name.
        cells: those of the copy.

    Raises:
        InputError: for inputs of one name with different settings, or in a driver.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.original, self.named = mechanism, dict[str, Input]()
        for force in mechanism.forces:
            _mapped(force, self._collect)
        for driver in mechanism.drivers:
            _mapped(driver, lambda x, name=driver.name: _refuse(x, name))
        self.cells = {name: self.named[name].model_copy() for name in self.named}
        self.mechanism = self.replaced(self.cells) if self.named else mechanism
        for name, cell in self.cells.items():
            cell.set(InputSetting(0.0, self.named[name].value))

    def _collect(self, value: Input) -> Input:
        known = self.named.setdefault(value.name, value)
        if known != value:
            raise InputError(f"input {value.name!r} is given twice, with different settings")
        return value

    def replaced(self, replaced: Mapping[str, Any], m: Mechanism | None = None) -> Mechanism:
        """Return the mechanism, or a variant of it, with functions of time in place of its inputs."""
        m = m or self.original
        return Mechanism(
            m.model, m.closures, [_mapped(f, lambda x: replaced[x.name]) for f in m.forces], drivers=m.drivers,
            stops=m.stops, clutches=m.clutches, start=m.start_values, visuals=m.visuals, title=m.title,
            duration=m.duration, order=m.order, settings=m.settings, motors=m.motors, left_out=m.left_out,
            remarks=m.remarks,
        )  # fmt: skip

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

    def recorded(self, history: Mapping[str, Sequence[InputSetting]]) -> Mechanism:
        """Return the mechanism with the inputs as functions of time."""
        if not self.named:
            return self.original
        pieces = {name: tuple(map(tuple, settings)) for name, settings in history.items()}
        return self.replaced({name: InputHistory(name=name, pieces=x) for name, x in pieces.items()})


def _refuse(value: Input, driver: str) -> Input:
    raise InputError(f"driver {driver!r}: input {value.name!r} has no acceleration; use it in a force")


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
    return value.model_copy(update=update) if update else value
