"""Steps back from a run's last node, to states that a polynomial continues across a singular configuration."""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..methods import Tableau, method
from ..system import Array
from .defaults import DEFAULTS
from .jumps import Jumps
from .loop import time_loop
from .run import RunState
from .steppers.adaptive import Adaptive
from .steppers.native import NativeStepper

SHARPER, SHARPEST = 1e-3, 1e-12  # times rtol, and the least rtol
MOST = 100  # steps from one time to the next; twice what ever were needed


@dataclass(frozen=True)
class BackwardStepper:
    """Steps back from a run's last node.

    Attributes:
        run: the run.
        rtol: tolerance of these steps, by the default method: sharp ones of a low order would be thousands.
        anywhere: from any node; else, for an implicit method of stiff motions, from the first one of a leg only, the
            short way that a leap needs where no step lies behind.
    """

    run: RunState
    rtol: float
    anywhere: bool

    @classmethod
    def of(cls, run: RunState, rtol: float) -> "BackwardStepper | None":
        """Return what steps back from a run's last node; None where forces cannot be followed back in time."""
        try:
            run.system.breakpoint(run.t, -run.sign)
        except InputError:  # a sampled controller
            return None
        return cls(run, max(SHARPER * rtol, SHARPEST), isinstance(run.tableau, Tableau))

    def __call__(self, times: Array) -> tuple[Array, Array, Array]:
        """Return times (k,), points (k, ...) and rates (k, ny) of the last node and those at earlier times, one by one.

        Raises:
            StepError: where they cannot be reached.
        """
        run, tableau = self.run, method(DEFAULTS["method"])
        system = run.system.new_workspace()
        system.hold(run.system.in_use)
        ts, ys, rates = [run.t], [run.ys[-1]], []
        for t in times.tolist():
            ahead = Jumps(system, (), t, -run.sign)
            control = Adaptive(tableau.error_power, self.rtol, None, None, np.inf)
            stepper = NativeStepper(control, system, tableau, True) if system.native else control
            back = RunState(run.problem, tableau, system, stepper, ts[-1], ys[-1], ahead, True)
            back.begin()
            rates.append(back.F)
            time_loop(back, MOST)
            ts.append(t)
            ys.append(back.ys[-1])
        rates.append(system.derivative(ts[-1], ys[-1])[0])
        return np.array(ts), np.array(ys), np.array(rates)
