"""Joint ranges in which a closure is active."""

from itertools import pairwise
from math import inf
from typing import Annotated

from pydantic import Field, model_validator

from ...tolerances import INPUT_DIGITS
from ..checked_table import Table
from ..key_units import Unit


class ActiveRange(Table):
    """Joint range in which a closure is active: a pin in a slot, a tooth in mesh.

    When a closure becomes active, positions and velocities should satisfy it: an impact without restitution removes
    remaining velocity errors.

    Attributes:
        joint: name of a joint of one bounded coordinate.
        windows: pairs (lower, upper) in rad or m, which neither overlap nor touch.
        period: period of the windows in rad or m; they do not repeat when left out.

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
        if min(self._gaps(), default=inf) <= INPUT_DIGITS * max(high - low for low, high in self.windows):
            raise ValueError("windows overlap or touch: join them into one")
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

    def distances(self, x: float) -> list[float]:
        """Return the distances of x from the lower and upper end of each window, positive inside the window."""
        ends = [(end, sign) for low, high in self.windows for end, sign in ((low, 1.0), (high, -1.0))]
        shifts = [round((x - end) / self.period) * self.period if self.period else 0.0 for end, _ in ends]
        return [sign * (x - end - shift) for (end, sign), shift in zip(ends, shifts, strict=True)]

    @property
    def shortest(self) -> float:
        """Length of the shortest interval inside or between windows."""
        return min([high - low for low, high in self.windows] + self._gaps())

    def _gaps(self) -> list[float]:
        """Return the distances from each window to the next one, also across periods; negative if they overlap."""
        if self.period:
            ordered = sorted((low % self.period, low % self.period + high - low) for low, high in self.windows)
            ordered.append((ordered[0][0] + self.period, inf))
        else:
            ordered = sorted(self.windows)
        return [after[0] - before[1] for before, after in pairwise(ordered)]
