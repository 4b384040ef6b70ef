"""Step sizes of a run: fixed, or under error control."""

from numbers import Real
from typing import Any, Protocol

import numpy as np

from ...errors import InputError, StepError
from ...methods.controller import Controller, error_norm
from ...system import Array, State, Step, System
from ..jumps import Leg

SMALLEST_RTOL = 100 * np.finfo(float).eps
NOTHING = 1e-100  # keeps the scale of a component positive where neither tolerance does
NEAR = 1e-9  # of a step: how near to the grid a time counts as on it
DETOUR = (0.309, 0.655)  # of two steps, of which the end of the first cannot be stepped on
TOLERATED = 1e-8  # what a move of the state may measure when steps are fixed


class Watch(Protocol):
    """What a pace sees of the watch for singular configurations."""

    def refuse_landing(self, t: float, y: Array) -> None:
        """Refuse a step that leads into one."""


class Run(Protocol):
    """What a pace sees of a run."""

    system: System
    tableau: Any
    state: State
    t: float
    t1: float
    leg: Leg
    sign: float
    ts: list[float]
    F: Array
    rejected: int | None

    @property
    def singular(self) -> Watch | None:
        """The watch for singular configurations, if there is one."""

    def left(self) -> float:
        """Time left to the end of the leg, positive."""


def _smallest(t: float, t1: float) -> float:
    """A step that is well above the rounding of times from t to t1."""
    return 16 * float(np.spacing(max(abs(t), abs(t1))))


def _not_negative(name: str, value: Any) -> Array:
    try:
        out = np.asarray(value, float)
    except (TypeError, ValueError):
        out = np.full(1, np.nan)
    if not (np.isfinite(out).all() and (out >= 0).all()):
        raise InputError(f"{name} must be finite and not negative, one number or several, got {value!r}")
    return out


class Pace(Protocol):
    """How long the steps are, and which of them are accepted."""

    def propose(self, run: Run) -> tuple[float, float]:
        """Return the size of the next step and the time where it ends."""

    def take(self, run: Run, h: float) -> Step:
        """Take a step of size h (signed)."""

    def error(self, run: Run, step: Step) -> float:
        """Return the error norm of a step; it is accepted below 1."""

    def may_retry(self, run: Run, h: float, reason: StepError) -> bool:
        """Say whether another step is worth a try after one that could not be taken for this reason."""

    def judge(self, run: Run, h: float, error: float) -> bool:
        """Say whether a step is accepted, and choose the next one."""

    def restart(self) -> None:
        """A jump was crossed: nothing of the steps before it holds."""

    def tolerates(self, run: Run, y: Array, move: Array) -> bool:
        """Say whether a move of the state away from y stays within the tolerance of a step."""

    def ready(self, run: Run) -> bool:
        """Say whether the compiled core may take the next steps."""

    def lend(self, course: Any) -> None:
        """Hand the pace over to the compiled core; see mbdae/native/core.hpp for the fields."""

    def take_back(self, course: Any) -> None:
        """Take the pace back after its steps."""

    def settings(self) -> dict[str, Any]:
        """What is recorded with the solution."""


class Fixed:
    """Steps of equal size on a grid; those before and after jumps and at the end of the span may be shorter."""

    def __init__(self, step: float, t0: float, t1: float) -> None:
        if abs(t1 - t0) > 0 and step < _smallest(t0, t1):
            raise InputError(f"step = {step} s is below {_smallest(t0, t1):.1e} s, where t + h rounds to t")
        self.step, self.t0, length = step, t0, abs(t1 - t0)
        self.n = max(1, int(np.ceil(length / step * (1 - 1e-12))))
        self.i, self.on_grid = 0, True  # the last point of the grid, and whether the run stands there
        self.detour: list[float] = []  # times of the next steps, where they leave the grid

    def propose(self, run: Run) -> tuple[float, float]:
        """Return the size of the next step and the time where it ends."""
        if self.detour:
            t = self.detour.pop(0)
            return abs(t - run.t), t
        i, started = self.i + 1, self.on_grid
        t = run.t1 if i >= self.n else self.t0 + run.sign * i * self.step
        beyond = run.sign * (t - run.leg.stop)  # the leg ends before the next point of the grid
        self.on_grid = beyond <= NEAR * self.step
        self.i += self.on_grid
        if beyond >= -NEAR * self.step:
            return run.left(), run.leg.end
        return (self.step if started else abs(t - run.t)), t

    def take(self, run: Run, h: float) -> Step:
        """Take a step of size h (signed)."""
        step = run.tableau.step(run.system, run.t, h, run.state)
        if run.singular and self._behind(run) is not None:
            run.singular.refuse_landing(run.t + h, step.state.y)
        return step

    def error(self, run: Run, step: Step) -> float:
        """Return the error norm of a step; it is accepted below 1."""
        if not np.isfinite(step.state.y).all():
            raise StepError("nonfinite", f"the state is not finite after the step at t = {run.t:.17g}")
        return 0.0

    def may_retry(self, run: Run, h: float, reason: StepError) -> bool:
        """Say whether to leave out the next point of the grid, because it lies in a singular configuration.

        Three steps then lead to the point behind it.
        """
        end = self._behind(run) if reason.status in ("rank", "singular") else None
        if end is None:
            return False
        self.i += 1
        self.detour = [run.t + share * (end - run.t) for share in DETOUR] + [end]
        return True

    def _behind(self, run: Run) -> float | None:
        """The point of the grid behind the next one; None where that cannot be left out."""
        if self.detour or not self.on_grid or self.i >= self.n:
            return None
        end = run.t1 if self.i + 1 == self.n else self.t0 + run.sign * (self.i + 1) * self.step
        return end if run.sign * (run.leg.stop - end) >= 0 else None

    def judge(self, run: Run, h: float, error: float) -> bool:
        """Say whether a step is accepted, and choose the next one."""
        return True

    def restart(self) -> None:
        """A jump was crossed: nothing to do."""

    def tolerates(self, run: Run, y: Array, move: Array) -> bool:
        """Say whether a move of the state away from y stays within 1e-8."""
        m = run.system.measured
        return bool((np.abs(move[m]) <= TOLERATED * (1 + run.system.size(y)[m])).all())

    def ready(self, run: Run) -> bool:
        """Say whether the compiled core may take the next steps: on the grid only."""
        return not self.detour

    def lend(self, course: Any) -> None:
        """Hand over the grid and where the run stands on it."""
        course.adaptive, course.near, course.tolerated = False, NEAR, TOLERATED
        course.step, course.t0, course.n, course.i, course.on_grid = self.step, self.t0, self.n, self.i, self.on_grid

    def take_back(self, course: Any) -> None:
        """Take back where the run stands on the grid."""
        self.i, self.on_grid = course.i, course.on_grid

    def settings(self) -> dict[str, Any]:
        """What is recorded with the solution."""
        return {"step": float(self.step)}


class Adaptive:
    """Steps under control: the error of q and v per step stays below atol + rtol max(|y_n|, |y_n+1|)."""

    def __init__(self, power: int, rtol: Any, atol: float | Array | None, first: float | None, largest: float) -> None:
        if not (isinstance(rtol, Real) and SMALLEST_RTOL <= float(rtol) < np.inf):
            raise InputError(f"rtol = {rtol!r} cannot be met: it must be a finite number, at least {SMALLEST_RTOL:.2g}")
        self.rtol, self.atol = rtol, _not_negative("atol", 0.01 * rtol if atol is None else atol)
        self.controller, self.largest = Controller(power), largest
        self.h: Any = first
        self.cap = np.inf  # of the next step, near singular configurations
        self.reason = self._reason = ""  # why a step could not be taken, this one or the one before
        self._cut = 0.0  # the step that would have been taken, had there not been the end of a leg

    def propose(self, run: Run) -> tuple[float, float]:
        """Return the size of the next step and the time where it ends."""
        self.ready(run)
        h, left = min(self.h, self.largest, self.cap), run.left()
        self._cut = self.h if h > left else 0.0
        if h >= left * (1 - 1e-10):
            return left, run.leg.end
        if h < _smallest(run.t, run.t1):
            limit = f"{_smallest(run.t, run.t1):.1e} s, where t + h rounds to t"
            fell = f"the step size fell to {h:.1e} s at t = {run.t:.17g}, below {limit}"
            raise StepError("step_size", f"{fell}: {self.reason or 'rtol cannot be met'}")
        return h, run.t + run.sign * h

    def take(self, run: Run, h: float) -> Step:
        """Take a step of size h (signed)."""
        return run.tableau.controlled_step(run.system, run.t, h, run.state)

    def error(self, run: Run, step: Step) -> float:
        """Return the error norm of a step; it is accepted below 1."""
        scale = self._scale(run, step.state.y) + run.system.noise(step.state.y, run.tableau.noise)[run.system.measured]
        return error_norm(step.errors[:, run.system.measured], scale)

    def may_retry(self, run: Run, h: float, reason: StepError) -> bool:
        """Say whether a smaller step is worth a try after one that could not be taken."""
        self.h = self.controller.next_step(h, np.inf)
        self.reason = self._reason = str(reason)
        return self.h > _smallest(run.t, run.t1)

    def judge(self, run: Run, h: float, error: float) -> bool:
        """Say whether a step is accepted, and choose the next one."""
        self.h = self.controller.next_step(h, error)
        if error <= 1:
            self.h, self.reason, self._reason = max(self.h, self._cut), self._reason, ""
        return error <= 1

    def restart(self) -> None:
        """A jump was crossed: the step size stays, the error decides."""

    def tolerates(self, run: Run, y: Array, move: Array) -> bool:
        """Say whether a move of the state away from y stays within the tolerance of a step."""
        return self.measure(run, y, move) <= 1

    def measure(self, run: Run, y: Array, move: Array) -> float:
        """Return the norm of a move of the state away from y, in tolerances."""
        return error_norm(move[None, run.system.measured], self._scale(run, y))

    def ready(self, run: Run) -> bool:
        """Find the first step; the compiled core may take the next ones."""
        if self.h is None:
            self.h = max(self._first(run), _smallest(run.t, run.t1))
            self._scale(run, run.state.y)
        return True

    def lend(self, course: Any) -> None:
        """Hand over tolerances, step size and controller."""
        course.adaptive, course.rtol, course.atol = True, float(self.rtol), self.atol.ravel().tolist()
        course.h, course.largest, course.cut = self.h, min(self.largest, self.cap), self._cut
        self.controller.lend(course)

    def take_back(self, course: Any) -> None:
        """Take back step size and controller."""
        self.h, self._cut = course.h, course.cut
        self.controller.last, self.controller.rejected = course.last, course.was_rejected

    def settings(self) -> dict[str, Any]:
        """What is recorded with the solution."""
        return {"rtol": float(self.rtol), "atol": self.atol.tolist()}

    def _scale(self, run: Run, y: Array) -> Array:
        m = run.system.measured
        n = len(range(run.system.ny)[m])
        if self.atol.shape not in ((), (n,)):
            raise InputError(f"atol is one number or one for each of {n} components, got shape {self.atol.shape}")
        size = np.maximum(run.system.size(run.state.y)[m], run.system.size(y)[m])
        return self.atol + self.rtol * size + NOTHING

    def _first(self, run: Run) -> float:
        """Guess the first step (Hairer, Noersett, Wanner I, II.4, starting step size algorithm)."""
        s, y, F = run.system, run.state.y, run.F
        scale, m = self._scale(run, y), s.measured

        def norm(x: Array) -> float:
            return float(np.sqrt(np.mean((x[m] / scale) ** 2)))

        d0, d1 = norm(s.size(y)), norm(F)
        h0 = min(1e-6 if min(d0, d1) < 1e-5 else 0.01 * d0 / d1, run.left())
        if not h0 > 0:  # the rates overflow: the smallest step shows what there is to see
            return 0.0
        F1 = s.derivative(run.t + run.sign * h0, s.add(y, run.sign * h0 * F))[0]
        d2 = norm(F1 - F) / h0
        steepest = max(d1, d2)
        h1 = max(1e-6, 1e-3 * h0) if steepest <= 1e-15 else (0.01 / steepest) ** (1 / self.controller.power)
        return min(100 * h0, h1)
