"""Units of the keys of a table: declared with their types, used to read mechanism files with ``[units]``.

    mass: Annotated[float, Unit("kg")]
    stiffness: Annotated[float, Unit("e/q")]

A unit may contain symbols: ``q``, ``q1``, ``q2`` are the units of the coordinates of the first, second and third joint
of the table (rad or m; m for a distance of frames), ``e`` the unit of the effort on the first (N m or N), ``y`` and
``x`` the units of the values of a function and of its argument.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args

from pydantic.fields import FieldInfo


@dataclass(frozen=True, init=False)
class Unit:
    """The units of the values of a key.

    Args:
        texts: one unit for all values; or one per entry, for a list of that length, or for each list in a list.
        powers_of: symbol of the variable of a polynomial: coefficient c_k has the unit divided by its k-th power.
        over: the unit of the argument of a function.
    """

    texts: tuple[str, ...]
    powers_of: str
    over: str

    def __init__(self, *texts: str, powers_of: str = "", over: str = "s") -> None:
        object.__setattr__(self, "texts", texts)
        object.__setattr__(self, "powers_of", powers_of)
        object.__setattr__(self, "over", over)

    def entries(self, n: int) -> tuple[str, ...]:
        """Return the units of a list of n numbers."""
        if self.powers_of:
            return tuple("/".join([self.texts[0], *[self.powers_of] * k]) for k in range(n))
        return self.texts if len(self.texts) == n else self.texts[:1] * n


@dataclass(frozen=True)
class Coordinates:
    """Values by joint, or by name of a coordinate, with the units of coordinates, or of velocities if ``per_time``."""

    per_time: bool = False


def declared_unit(field: FieldInfo) -> Unit | Coordinates | None:
    """Return the unit in the type of a key; None without one."""
    return _unit_in(field.metadata) or _unit_in([field.annotation])


def _unit_in(values: Any) -> Unit | Coordinates | None:
    for value in values:
        if isinstance(value, Unit | Coordinates):
            return value
    nested = (_unit_in(get_args(value)) for value in values)
    return next((unit for unit in nested if unit), None)


UnitSymbols = Mapping[str, str]
"""SI units by symbol."""


def function_symbols(unit: Unit | Coordinates | None) -> UnitSymbols:
    """Return the units of the symbols y and x, value and argument, of a function of time that is the value of a key."""
    return {"y": unit.texts[0], "x": unit.over} if isinstance(unit, Unit) else {}
