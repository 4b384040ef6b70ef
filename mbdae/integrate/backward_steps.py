"""Backward steps from a run's last node, to states that a polynomial continues across a singular configuration."""

from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..methods import Tableau, method
from ..system import Array
from ..tolerances import NEGLIGIBLE, SOLUTION_ROUNDING
from .defaults import DEFAULTS
from .events.jumps import Jumps
from .events.user_events import UserEvents
from .loop import time_loop
from .run_state import RunState
from .steppers.adaptive import Adaptive
from .steppers.native import NativeStepper

SHARPER, SHARPEST = NEGLIGIBLE, SOLUTION_ROUNDING  # times rtol, and the smallest rtol
MOST = 100  # steps from one time to the next; twice the largest number ever needed


@dataclass(frozen=True)
class BackwardStepper:
    """Takes backward steps from a run's last node.

    Attributes:
        run: the run.
        rtol: tolerance of these steps, with the default method: a low-order method would need thousands of accurate
            ones.
        anywhere: whether it may start at any node; otherwise, for an implicit method of stiff motions, only at the
            first node of a smooth interval, where no earlier steps exist.
    """

    run: RunState
    rtol: float
    anywhere: bool

    @classmethod
    def of(cls, run: RunState, rtol: float) -> "BackwardStepper | None":
        """Return the backward stepper of a run; None if forces cannot be integrated backwards."""
        try:
            run.system.breakpoint(run.t, -run.sign)
        except InputError:  # a sampled controller
            return None
        return cls(run, max(SHARPER * rtol, SHARPEST), isinstance(run.tableau, Tableau))

    def __call__(self, times: Array) -> tuple[Array, Array, Array]:
        """Return times (k,), points (k, ...) and rates (k, ny) of the last node and those at earlier times, in turn.

        Raises:
            StepError: if they cannot be reached.
        """
        run, tableau = self.run, method(DEFAULTS["method"])
        system = run.system.new_workspace()
        system.use_rows(run.system.in_use)
        ts, ys, rates = [run.t], [run.ys[-1]], []
        for t in times.tolist():
            control = Adaptive(tableau.error_power, self.rtol, None, None, np.inf)
            stepper = NativeStepper(control, system, tableau, True) if system.native else control
            ahead = {"method": tableau, "project": True, "t0": ts[-1], "t1": t, "end": t, "jumps": (), "events": ()}
            back = RunState(run.problem, replace(run.options, **ahead), system, stepper, ys[-1], (UserEvents, Jumps))
            back.begin()
            rates.append(back.F)
            time_loop(back, MOST)
            ts.append(t)
            ys.append(back.ys[-1])
        rates.append(system.derivative(ts[-1], ys[-1])[0])
        return np.array(ts), np.array(ys), np.array(rates)
