"""Joint ranges in which a closure is active."""

from math import inf
from typing import Annotated

from pydantic import Field, model_validator

from ..checked_table import Table
from ..key_units import Unit


class ActiveRange(Table):
    """Joint range in which a closure is active: a pin in a slot, a tooth in mesh.

    When a closure becomes active, positions and velocities should satisfy it: an impact without restitution removes
    remaining velocity errors.

    Attributes:
        joint: name of a joint of one bounded coordinate.
        windows: pairs (lower, upper) in rad or m that do not overlap.
        period: of the windows in rad or m; they do not repeat when left out.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint.
    """

    joint: str
    windows: Annotated[tuple[tuple[float, float], ...], Unit("q")] = Field(min_length=1)
    period: Annotated[float | None, Unit("q")] = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _check_windows(self) -> "ActiveRange":
        if any(not low < high for low, high in self.windows):
            raise ValueError("a window is a pair (lower, upper), lower below upper")
        if self.period and any(high - low >= self.period for low, high in self.windows):
            raise ValueError("a window is shorter than the period")
        return self

    def depth(self, x: float) -> float:
        """Return the distance of x from the nearest end of a window, positive inside and negative outside."""
        deepest = -inf
        for low, high in self.windows:
            half_width = (high - low) / 2
            offset = x - low - half_width
            if self.period:
                offset -= self.period * round(offset / self.period)
            deepest = max(deepest, half_width - abs(offset))
        return deepest

    @property
    def shortest(self) -> float:
        """Length of the shortest interval inside or between windows."""
        ordered = sorted(self.windows)
        following = [*ordered[1:], *([(ordered[0][0] + self.period, inf)] if self.period else [])]
        gaps = [after[0] - before[1] for before, after in zip(ordered, following, strict=False)]
        return min([high - low for low, high in ordered] + gaps)
