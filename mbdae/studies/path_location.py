"""Location of a sign change along a path that continuation follows."""

from collections.abc import Callable
from typing import TypeVar

from ..errors import MbdaeError
from ..tolerances import AGREEMENT

MAX_BISECTIONS = 40
Point = TypeVar("Point")


def locate(
    step: Callable[[Point, float], Point | None], at: Point, h: float, value: Callable[[Point], float], what: str
) -> tuple[float, Point]:
    """Return the step length at a sign change of a value, and the point, by bisection and false position.

    Args:
        step: returns the point after a step of a length from a point; None if it fails.
        at: the point where the step begins.
        h: its length.
        value: of a point, of different signs at both ends.
        what: the kind of the points, for the message.

    Raises:
        MbdaeError: if the step fails.
    """
    low, high, here, end = 0.0, h, at, step(at, h)
    if end is None:
        raise MbdaeError(f"a point of a path of {what} cannot be located")
    a, b = value(at), value(end)
    if a == 0:
        return 0.0, at
    best, zero = (h, end), AGREEMENT * max(abs(a), abs(b))
    for k in range(MAX_BISECTIONS):
        middle = (low + high) / 2 if k % 3 == 2 or abs(a) == abs(b) == 1.0 else high - b * (high - low) / (b - a)
        found = step(here, middle) if low < middle < high else None
        if found is None:
            break
        c, best = value(found), (middle, found)
        if abs(c) <= zero:
            break
        low, high, a, b = (middle, high, c, b) if c * a > 0 else (low, middle, a, c)
    return best
