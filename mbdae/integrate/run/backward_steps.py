"""Backward steps from the last node of a run, to states from which a singular configuration is extrapolated."""

from dataclasses import dataclass

import numpy as np

from ...mechanism.formulations.index2 import Index2System
from ...methods import Tableau, method
from ...system import Array
from ...tolerances import NEGLIGIBLE, SOLUTION_ROUNDING
from ..events.jumps import Jumps
from ..events.user_events import UserEvents
from ..options.defaults import DEFAULTS
from ..steppers.adaptive import Adaptive
from ..steppers.native import NativeStepper
from .loop import time_loop
from .run_state import RunState

RTOL_FACTOR, MIN_RTOL = NEGLIGIBLE, SOLUTION_ROUNDING  # tolerance of these steps relative to rtol, and its minimum
MAX_STEPS = 100  # from one time to the next; twice the largest number observed
SOURCES = (UserEvents, Jumps)  # sources of events of the backward runs


@dataclass(frozen=True)
class BackwardStepper:
    """Backward steps from the last node of a run.

    They use the default method: a method of low order would need thousands of steps for this accuracy.

    Attributes:
        rtol: relative tolerance of these steps.
        from_any_node: whether they may start at any node; if not (implicit methods, for stiff motions), only at the
            first node of a smooth interval, where no earlier steps exist.
    """

    rtol: float
    from_any_node: bool

    @classmethod
    def from_run(cls, run: RunState, rtol: float) -> "BackwardStepper":
        """Return the backward stepper of a run."""
        return cls(max(RTOL_FACTOR * rtol, MIN_RTOL), isinstance(run.tableau, Tableau))

    def __call__(self, run: RunState, times: Array) -> tuple[Array, Array, Array]:
        """Return times (k,), points (k, ...) and rates (k, ny): first at the last node of a run, then at earlier times.

        Raises:
            StepError: if a time cannot be reached.
            InputError: for forces that cannot be integrated backward in time, such as sampled controllers.
        """
        run.system.breakpoint(run.t, -run.sign)
        assert run.mechanism_system
        system = run.mechanism_system.new_workspace()
        try:
            return self._steps(run, system, times)
        finally:
            system.mechanism.workspaces.release(system)

    def _steps(self, run: RunState, system: Index2System, times: Array) -> tuple[Array, Array, Array]:
        """Take the steps in a workspace."""
        tableau = method(DEFAULTS["method"])
        system.use_rows(run.system.in_use)
        ts, ys, rates = [run.t], [run.ys[-1]], []
        for t in times.tolist():
            control = Adaptive(tableau.error_power, self.rtol, None, None, np.inf)
            stepper = NativeStepper(control, system, tableau, True) if system.native else control
            options = run.options._replace(t0=ts[-1], t1=t, end=t, method=tableau, project=True, max_steps=MAX_STEPS)
            options = options._replace(jumps=(), events=())
            backward = RunState(run.problem, options, system, stepper, ys[-1], SOURCES)
            backward.begin()
            rates.append(backward.F)
            time_loop(backward)
            ts.append(t)
            ys.append(backward.ys[-1])
        rates.append(system.derivative(ts[-1], ys[-1])[0])
        return np.array(ts), np.array(ys), np.array(rates)
