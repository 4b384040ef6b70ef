"""Location of a sign change in a step of a path traced by continuation."""

from collections.abc import Callable
from typing import TypeVar

from ..errors import MbdaeError
from ..tolerances import AGREEMENT

MAX_BISECTIONS = 40
Point = TypeVar("Point")


def locate(
    step: Callable[[Point, float], Point | None], start: Point, h: float, value: Callable[[Point], float], kind: str
) -> tuple[float, Point]:
    """Return the step length at a sign change of a value, and the point, by bisection and false position.

    Args:
        step: returns the point after a step of a length from a point; None if it fails.
        start: point where the step begins.
        h: length of the step.
        value: function of a point, with different signs at both ends of the step.
        kind: kind of the points, for the message.

    Raises:
        MbdaeError: if the step fails.
    """
    low, high, end = 0.0, h, step(start, h)
    if end is None:
        raise MbdaeError(f"a point of a path of {kind} cannot be located")
    a, b = value(start), value(end)
    if a == 0:
        return 0.0, start
    best, zero = (h, end), AGREEMENT * max(abs(a), abs(b))
    for k in range(MAX_BISECTIONS):
        middle = (low + high) / 2 if k % 3 == 2 or abs(a) == abs(b) == 1.0 else high - b * (high - low) / (b - a)
        found = step(start, middle) if low < middle < high else None
        if found is None:
            break
        c, best = value(found), (middle, found)
        if abs(c) <= zero:
            break
        low, high, a, b = (middle, high, c, b) if c * a > 0 else (low, middle, a, c)
    return best
