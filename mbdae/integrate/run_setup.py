"""Setup of a run: workspace, stepper and start."""

from numbers import Real
from typing import Any

import numpy as np

from ..mechanism import Mechanism
from ..solution.solution import Problem
from ..system import Array, System
from ..tolerances import INPUT_DIGITS, NEGLIGIBLE
from .backward_steps import BackwardStepper
from .binding import bind
from .options import RunOptions
from .run_state import RunState
from .steppers.adaptive import Adaptive
from .steppers.fixed import Fixed
from .steppers.native import NativeStepper
from .steppers.scipy_ivp import Scipy, ScipySolver
from .steppers.stepper import PythonStepper

NEWTON = NEGLIGIBLE  # of rtol, with its root for a small one: accuracy of implicit stages, see RADAU5
DRIFTED = 100.0  # times rtol: largest violation of loops at the start, as after a run with drift


def prepare(problem: Problem, options: RunOptions, start: tuple[Array | None, Array | None, Array | None]) -> RunState:
    """Return a run that can begin from (q, v, s), each None for that of the mechanism.

    Raises:
        InputError: for options that do not suit the problem, or an inconsistent start.
    """
    y = _start(problem, start, options.t0, None if options.step else options.rtol)
    system, fallback = bind(problem, options.formulation, options.baumgarte, options.backend)
    inner = _stepper(system, options)
    native = system.native and not isinstance(options.method, ScipySolver)
    stepper = NativeStepper(inner, system, options.method, options.project) if native else inner
    if inner.control and options.formulation != "ggl":  # which keeps 0 = g and 0 = G v to rounding
        rtol = float(inner.control.rtol)
        system.accuracy = min(NEWTON, rtol**0.5) * rtol
    run = RunState(problem, options, system, stepper, y)
    run.fallback = fallback
    if isinstance(problem, Mechanism):  # before controllers, modes and projections change the start
        q, v, s, _ = np.split(y, np.cumsum([problem.nq, problem.nv, len(problem.states)]))
        run.settings |= {"q": q.tolist(), "v": v.tolist(), "s": s.tolist()}
    if run.singular and run.control:
        run.back = BackwardStepper.of(run, float(run.control.rtol))
    return run


def _stepper(system: System, o: RunOptions) -> PythonStepper:
    control = o.rtol, o.atol, o.first_step, o.max_step
    if isinstance(o.method, ScipySolver):
        return Scipy(o.method, system, o.step, *control)
    if o.step:
        return Fixed(o.step, o.t0, o.t1)
    return Adaptive(o.method.error_power, *control, o.method.control, o.method.steady(system.ny))


def _start(problem: Problem, start: tuple[Array | None, Array | None, Array | None], t: float, rtol: Any) -> Array:
    """Return the start; with step-size control, loops may be violated as after a run with drift."""
    q, v, s = start
    drifted = DRIFTED * float(rtol) if isinstance(rtol, Real) else 0.0
    return problem.point(q, v, t, s, max(INPUT_DIGITS, drifted))
