"""The end of a run in a terminal event, whose time moves: dt_e = -(e_y dy + e_p)/e'."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...differences import slope, slopes
from ...errors import InputError
from ...integrate.trace import LinearPart, Part, Trace
from ...system import Array

WIDTH = 1e-3  # of differences of event functions, which are the user's


@dataclass(frozen=True)
class Ending:
    """The last step, which ends in an event e(t, q, v) = 0, and how its size moves.

    Attributes:
        parts: of the step.
        by_t: de/dt.
        by_y: de/dy, (ny,).
    """

    parts: list[Part]
    by_t: float
    by_y: Array

    def forward(self, dy: Array, carry: Array, dp: Array, dh: Array) -> tuple[Array, Array]:
        """Return the variations behind the step, whose size moves by dh, (m,)."""
        steps = [p for p in self.parts if not isinstance(p, LinearPart)]
        for part in self.parts:
            if isinstance(part, LinearPart):
                dy, carry = part.forward(dy, carry, dp)
            else:
                dy, carry = part.forward(dy, carry, dp, dh / len(steps))
        return dy, carry

    def by_size(self, like: Array, carry: Array, k: int) -> Array:
        """Variation of y behind the step for dh = 1, (ny, 1)."""
        zero = np.zeros((len(like), 1)), np.zeros((len(carry), 1)), np.zeros((k, 1))
        return self.forward(*zero, np.ones(1))[0]

    def move(self, dy: Array, carry: Array, dp: Array) -> Array:
        """Return dt_e, (m,)."""
        rise = self.by_t + (self.by_y @ self.by_size(dy, carry, len(dp)))[0]
        fixed = self.forward(dy, carry, dp, np.zeros(dy.shape[1]))[0]
        return -(self.by_y @ fixed) / rise

    def held(self, y: Array, carry: Array, k: int, late: float) -> Array:
        """Return the cotangent of y behind the step with its size held, of that with dt_e, and of t_e itself."""
        by_size = self.by_size(y, carry, k)[:, 0]
        return y - self.by_y[:, None] * (float(y[:, 0] @ by_size) + late) / (self.by_t + self.by_y @ by_size)


def ending(trace: Trace, event: Callable[..., float] | None) -> Ending | None:
    """The last step of a run that ended in an event; None for others.

    Raises:
        InputError: where the event's function is missing, or none belongs.
    """
    if trace.sol.status != "event":
        if event is not None:
            raise InputError("the run did not end in an event: leave its function out")
        return None
    if event is None:
        raise InputError("the run ended in a terminal event, whose time moves: give its function, event=")
    function, s = getattr(event, "function", event), trace.system
    t, y = float(trace.ts[-1]), trace.ys[-1]

    def value(t: float, y: Array) -> float:
        return float(function(t, *s.split(y)))

    by_t = slope(lambda x: value(t + x, y), WIDTH)
    by_y = slopes(lambda x: value(t, s.add(y, x)), s.ny, WIDTH)
    return Ending(list(trace.parts(len(trace.ts) - 2)), by_t, by_y)
