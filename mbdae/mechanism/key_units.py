"""Units of the keys of a table: declared with their types, used where a mechanism file with ``[units]`` is read.

    mass: Annotated[float, Unit("kg")]
    stiffness: Annotated[float, Unit("e/q")]

Symbols in the units of keys are units of the joints of a table and of functions: ``q``, ``q1``, ``q2`` of the
coordinates of its first, second and third joint (rad or m; m for a distance of frames), ``e`` of the effort on the
first (N m or N), ``y`` of the values of a function and ``x`` of its argument.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args

from pydantic.fields import FieldInfo


@dataclass(frozen=True, init=False)
class Unit:
    """The unit of all numbers of a key.

    Args:
        texts: the unit; or several, of the entries of a list with as many, or of each list in a list.
        powers_of: the variable of coefficients c_k, which have the unit divided by its k-th power.
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
    return _found(field.metadata) or _found([field.annotation])


def _found(values: Any) -> Unit | Coordinates | None:
    for value in values:
        if isinstance(value, Unit | Coordinates):
            return value
    nested = (_found(get_args(value)) for value in values)
    return next((unit for unit in nested if unit), None)


UnitSymbols = Mapping[str, str]
"""Units in SI by symbol."""


def function_symbols(unit: Unit | Coordinates | None) -> UnitSymbols:
    """Return the units of the symbols y and x, value and argument, of a function of time that is the value of a key."""
    return {"y": unit.texts[0], "x": unit.over} if isinstance(unit, Unit) else {}
