"""Steps with step-size control."""

from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from ...data_types import JsonObject
from ...errors import InputError, StepError
from ...methods.controller import PI, Control, Controller, error_norm, root_mean_squares
from ...system import Array, Step
from ...tolerances import AGREEMENT, EPS, ROUNDING, TINY
from .stepper import PythonStepper, StepperState, smallest_step

if TYPE_CHECKING:
    from ..run.run_state import RunState

SMALLEST_RTOL = 100 * EPS
# Hairer's starting step: norms below which the default h_0 is taken; h_1/h_0 where y' and y'' vanish; relative change
# of y in h_0; largest h_1/h_0.
STARTING_STEP = {"small_norm": 1e-5, "default_step": 1e-6, "reduction": 1e-3, "change": 0.01, "growth": 100.0}


class Adaptive(PythonStepper):
    """Step-size control: accepted steps have an error norm of at most 1.

    The norm is that of `mbdae.methods.controller.error_norm`, with the scales atol + rtol max(|y_n|, |y_n+1|).
    """

    controls = True

    def __init__(
        self,
        power: int,
        rtol: object,
        atol: float | Array | None,
        first_step: float | None,
        max_step: float,
        control: Control = PI,
        min_growth: float = 1.0,
    ) -> None:
        if not (isinstance(rtol, Real) and SMALLEST_RTOL <= float(rtol) < np.inf):
            raise InputError(f"rtol = {rtol!r} cannot be met: it must be a finite number, at least {SMALLEST_RTOL:.2g}")
        self.rtol, self.atol = rtol, np.asarray(0.01 * rtol if atol is None else atol)
        self.controller, self.max_step = Controller(power, control, min_growth), max_step
        self.h: Any = first_step
        self.cap = np.inf  # limit of the next step near singular configurations
        self.reason = self._reason = ""  # why the previous attempt, and this one, failed
        self.size_before_truncation = 0.0  # size of a step that is truncated at the end of an interval; else 0

    @property
    def control(self) -> "Adaptive | None":
        return self

    def propose(self, run: "RunState") -> tuple[float, float]:
        """Return the size of the next step and its end time."""
        self.ready_for_core(run)
        h, left = min(self.h, self.max_step, self.cap), run.time_to_interval_end()
        self.size_before_truncation = self.h if h > left else 0.0
        if h >= left * (1 - AGREEMENT):
            return left, run.interval.end
        if h < smallest_step(run.t, run.t1):
            limit = f"{smallest_step(run.t, run.t1):.1e} s, where t + h rounds to t"
            fell = f"the step size fell to {h:.1e} s at t = {run.t:.17g}, below {limit}"
            raise StepError("step_size", f"{fell}: {self.reason or 'rtol cannot be met'}")
        return h, run.t + run.sign * h

    def take(self, run: "RunState", h: float) -> Step:
        """Take a step of size h (signed)."""
        return run.tableau.controlled_step(run.system, run.t, h, run.state)

    def error(self, run: "RunState", step: Step) -> float:
        """Return the error norm of a step; the step is accepted up to 1."""
        s, y = run.system, step.state.y
        scale = self._scale(run, y) + s.noise(y, run.tableau.noise)[s.error_components]
        return error_norm(step.errors[:, s.error_components], scale, run.tableau.blend)

    def may_retry(self, run: "RunState", h: float, reason: StepError) -> bool:
        """Return whether to retry a failed step with a smaller step size."""
        self.h = self.controller.next_step(h, np.inf)
        self.reason = self._reason = str(reason)
        return self.h > smallest_step(run.t, run.t1)

    def accept_or_reject(self, run: "RunState", h: float, error: float) -> bool:
        """Return whether a step is accepted, and choose the next step size."""
        self.h = self.controller.next_step(h, error)
        if error <= 1:
            self.h, self.reason, self._reason = max(self.h, self.size_before_truncation), self._reason, ""
        return error <= 1

    def tolerance_norms(self, run: "RunState", y: Array, displacements: Array) -> list[float]:
        return root_mean_squares(displacements[:, run.system.error_components] / self._scale(run, y))

    def ready_for_core(self, run: "RunState") -> bool:
        """Choose the first step size, if unknown; the compiled core may take the next steps."""
        if self.h is None:
            self.h = max(self._estimate_first_step(run), smallest_step(run.t, run.t1))
        return True

    def limit_step(self, h: float) -> None:
        self.h, self.size_before_truncation = min(self.h, h), 0.0

    def snapshot(self) -> StepperState:
        pi = self.controller
        return self.h, self.size_before_truncation, pi.last, pi.rejected

    def resume(self, snapshot: StepperState) -> None:
        self.h, self.size_before_truncation, self.controller.last, self.controller.rejected = snapshot

    def settings(self) -> JsonObject:
        """Return the settings that are recorded with the solution."""
        return {"rtol": float(self.rtol), "atol": self.atol.tolist()}

    def _scale(self, run: "RunState", y: Array) -> Array:
        m = run.system.error_components
        size = np.maximum(run.system.component_magnitudes(run.state.y)[m], run.system.component_magnitudes(y)[m])
        return self.atol + self.rtol * size + TINY

    def first_step_data(self, run: "RunState") -> dict[str, Any]:
        """Return the data for an estimate of the first step, see `mbdae.system.System.first_step`."""
        return {
            "sign": run.sign, "left": run.time_to_interval_end(), "rtol": float(self.rtol), "atol": self.atol.ravel(),
            "power": self.controller.power, "zero_change": ROUNDING, "tiny": TINY, **STARTING_STEP,
        }  # fmt: skip

    def _estimate_first_step(self, run: "RunState") -> float:
        """Estimate the first step size (Hairer, Noersett, Wanner I, II.4, starting step size algorithm)."""
        s, y, F, data = run.system, run.state.y, run.F, self.first_step_data(run)
        h_of_core = s.first_step(run.t, y, F, **data)
        if h_of_core is not None:
            return h_of_core
        small_norm, default_step, reduction, change, growth = STARTING_STEP.values()
        left, power = data["left"], data["power"]
        scale, m = self._scale(run, y), s.error_components

        def norm(x: Array) -> float:
            return float(np.sqrt(np.mean((x[m] / scale) ** 2)))

        d0, d1 = norm(s.component_magnitudes(y)), norm(F)
        h0 = min(default_step if min(d0, d1) < small_norm else change * d0 / d1, left)
        if not h0 > 0:  # the rates overflow: the smallest step will fail with the reason
            return 0.0
        F1 = s.derivative(run.t + run.sign * h0, s.add(y, run.sign * h0 * F))[0]
        d2 = norm(F1 - F) / h0
        steepest = max(d1, d2)
        h1 = max(default_step, reduction * h0) if steepest <= ROUNDING else (change / steepest) ** (1 / power)
        return min(growth * h0, h1)
