"""Steps back from a run's last node, to states before it that a polynomial can continue; see `mbdae.integrate.leap`."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ..errors import InputError
from ..system import Array
from .jumps import Jumps
from .loop import time_loop
from .run import RunState
from .steppers.adaptive import Adaptive
from .steppers.native import NativeStepper

SHARPER, SHARPEST = 1e-3, 1e-12  # times rtol, and the least rtol
MOST = 500  # steps from one time to the next

Retracer = Callable[[Array], tuple[Array, Array, Array]]


def retracer(run: RunState, tableau: Any, rtol: float) -> Retracer | None:
    """Return what steps back from a run's last node; None where forces cannot be followed back in time."""
    try:
        run.system.breakpoint(run.t, -run.sign)
    except InputError:  # a sampled controller
        return None
    return partial(_retraced, run, tableau, max(SHARPER * rtol, SHARPEST))


def _retraced(run: RunState, tableau: Any, rtol: float, times: Array) -> tuple[Array, Array, Array]:
    """Return times (k,), points (k, ...) and rates (k, ny) of the last node and those at earlier times, one by one.

    Raises:
        StepError: where they cannot be reached.
    """
    system = run.system.twin()
    system.hold(run.system.in_use)
    ts, ys, rates = [run.t], [run.ys[-1]], []
    for t in times.tolist():
        ahead = Jumps(system, (), t, -run.sign)
        control = Adaptive(tableau.error_power, rtol, None, None, np.inf)
        stepper = NativeStepper(control, system, tableau, True) if system.native else control
        back = RunState(run.problem, tableau, system, stepper, ts[-1], ys[-1], ahead, True)
        back.begin()
        rates.append(back.F)
        time_loop(back, MOST)
        ts.append(t)
        ys.append(back.ys[-1])
    rates.append(system.derivative(ts[-1], ys[-1])[0])
    return np.array(ts), np.array(ys), np.array(rates)
