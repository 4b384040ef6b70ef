"""Joint ranges in which a closure is active."""

from math import inf

from pydantic import Field, model_validator

from ..checked_table import Table


class ActiveRange(Table):
    """A closure is active while the coordinate of a joint lies in a window (a pin in a slot, a tooth in mesh).

    When it becomes active, positions and velocities should satisfy it: remaining velocity errors are removed by an
    impact without restitution.

    Attributes:
        joint: name of a joint of one coordinate with a bounded range.
        windows: pairs (lower, upper) in rad or m, which do not overlap.
        period: in rad or m, after which the windows repeat.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint.
    """

    joint: str
    windows: tuple[tuple[float, float], ...] = Field(min_length=1)
    period: float | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _fits(self) -> "ActiveRange":
        if any(not low < high for low, high in self.windows):
            raise ValueError("a window is a pair (lower, upper), lower below upper")
        if self.period and any(high - low >= self.period for low, high in self.windows):
            raise ValueError("a window is shorter than the period")
        return self

    def depth(self, x: float) -> float:
        """Return how far inside a window x lies, negative outside."""
        best = -inf
        for low, high in self.windows:
            half = (high - low) / 2
            away = x - low - half
            if self.period:
                away -= self.period * round(away / self.period)
            best = max(best, half - abs(away))
        return best

    @property
    def shortest(self) -> float:
        """Length of the shortest interval inside or between windows."""
        ordered = sorted(self.windows)
        ends = [*ordered[1:], *([(ordered[0][0] + self.period, inf)] if self.period else [])]
        gaps = [after[0] - before[1] for before, after in zip(ordered, ends, strict=False)]
        return min([high - low for low, high in ordered] + gaps)
