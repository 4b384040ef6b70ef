"""Validation and binding of the arguments of a run: problem, method, stepper, and monitors."""

from collections.abc import Sequence
from numbers import Real
from typing import Any

import numpy as np

from ..errors import InputError
from ..mechanism import Mechanism
from ..mechanism.assembly import START
from ..mechanism.formulations.index2 import Index2System
from ..methods import EXPLICIT, METHODS, ExplicitMethod, Tableau
from ..solution.solution import Problem
from ..system import Array, System
from .backward_steps import BackwardStepper
from .binding import bind
from .events.event import Event, as_events, event_value
from .events.hybrid import ModeChanges
from .events.jumps import Jumps
from .events.level_crossing import SignalEvent
from .events.singularity import SingularityMonitor
from .events.user_events import UserEvents
from .run import RunState
from .span import checked_span
from .steppers.adaptive import Adaptive
from .steppers.fixed import Fixed
from .steppers.native import NativeStepper
from .steppers.scipy_ivp import Scipy, ScipySolver, find
from .steppers.stepper import PythonStepper, Stepper
from .stiffness_detection import StiffnessDetector

DRIFTED = 100.0  # times rtol: largest violation of loops at the start, as after a run with drift

Start = tuple[Array | None, Array | None, Array | None]
Control = tuple[float, float | Array | None, float | None, float]


def prepare(
    problem: Problem,
    t_span: Sequence[float] | None,
    start: Start,
    method: Any,
    formulation: str,
    project: bool | str,
    baumgarte: tuple[float, float] | None,
    step: float | None,
    control: Control,
    jumps: Sequence[float],
    events: Any,
    backend: str,
) -> RunState:
    """Return a run that can begin; the arguments are those of `mbdae.solve`.

    Raises:
        InputError: for wrong arguments, or an inconsistent start.
        UnknownNameError: for an unknown method.
    """
    tableau = find(formulation, method)
    project = projected(problem, project, formulation, tableau, step)
    t0, t1 = checked_span((0.0, problem.duration) if t_span is None else t_span, pair=True)
    system, fallback = bind(problem, formulation, baumgarte, backend)
    inner = _stepper(system, tableau, formulation, step, control, t0, t1)
    stepper: Stepper = inner
    if system.native and not isinstance(tableau, ScipySolver):
        stepper = NativeStepper(inner, system, tableau, project)
    end = _reached(problem, t0, t1)
    ahead = Jumps(system, jumps, end, 1.0 if t1 >= t0 else -1.0, _knots(problem, system, t0, end))
    y = _start(problem, start, t0, None if step else control[0])
    run = RunState(problem, tableau, system, stepper, t0, y, ahead, project)
    run.fallback, run.settings = (
        fallback,
        {
            "method": tableau.name,
            "formulation": formulation,
            "project": project,
            "baumgarte": baumgarte,
            "t_span": [t0, t1],
        },
    )
    if isinstance(problem, Mechanism):  # before controllers, modes and projections change the start
        q, v, s, _ = np.split(y, np.cumsum([problem.nq, problem.nv, len(problem.states)]))
        run.settings |= {"q": q.tolist(), "v": v.tolist(), "s": s.tolist()}
    if isinstance(tableau, Tableau) and METHODS.get(tableau.name) is not tableau:
        run.settings["tableau"] = tableau.to_dict()
    wanted = as_events(events)
    run.events = UserEvents(wanted, lambda e, t, y: event_value(system, e, t, y), _signals(problem, system, wanted))
    _set_watches(run, inner, formulation)
    if isinstance(problem, Mechanism) and isinstance(system, Index2System) and problem.switches:
        _refuse_modes(problem.switches[0].name, formulation, tableau, run.sign)
        run.modes, run.events.by_signal = ModeChanges(system), False
    return run


def _reached(problem: Problem, t0: float, t1: float) -> float:
    """Return the end of a run: t1, or the end of a driver's table without ``beyond``.

    Raises:
        InputError: if the run begins outside of it, or at its end.
    """
    reached = t1
    for d in problem.drivers if isinstance(problem, Mechanism) else ():
        words = d.outside(t1)
        end = (d.span[1] if t1 > t0 else d.span[0]) if words else t1
        if d.outside(t0) or (end - t0) * (t1 - t0) <= 0 < abs(t1 - t0):
            raise InputError(f"{d.outside(t0) or words}; the run begins at t = {t0:g} s")
        reached = min(reached, end) if t1 > t0 else max(reached, end)
    return reached


def _knots(problem: Problem, system: System, t0: float, t1: float) -> Sequence[float]:
    """Return the knots of loads and motions if the run has modes: loads may have extrema between two of them."""
    if not isinstance(problem, Mechanism) or not isinstance(system, Index2System) or not problem.switches:
        return ()
    laws = (signal for law, _ in system.laws.bound for signal in law.signals)
    drives = (d.path for d in problem.drivers)
    commands = (clutch.engaged for clutch in problem.clutches if clutch.engaged)
    return [t for signal in (*laws, *drives, *commands) for t in signal.meets(t0, t1)]


def _refuse_modes(name: str, formulation: str, tableau: Any, sign: float) -> None:
    if formulation != "index2" or isinstance(tableau, ScipySolver):
        raise InputError(f"{name!r}: what opens, closes or steps needs formulation 'index2', got {formulation!r}")
    if sign < 0:
        raise InputError(f"{name!r}: modes are followed forward in time, impacts cannot be undone")


def _stepper(
    system: System, tableau: Any, formulation: str, step: float | None, control: Control, t0: float, t1: float
) -> PythonStepper:
    if isinstance(tableau, ScipySolver):
        return Scipy(tableau, system, step, *control)
    if step:
        return Fixed(step, t0, t1)
    return Adaptive(tableau.error_power, *control, tableau.control, tableau.steady(system.ny))


def _signals(problem: Problem, system: System, events: tuple[Event, ...]) -> dict[int, SignalEvent]:
    """Bind all textual events, by index, to one workspace.

    Raises:
        InputError: for a text with a textbook problem, or an invalid event.
    """
    texts = {i: (e.function, e.direction) for i, e in enumerate(events) if isinstance(e.function, str)}
    if not texts:
        return {}
    if not isinstance(problem, Mechanism) or not isinstance(system, Index2System):
        raise InputError(
            f"events of a textbook problem are functions event(t, y), got {next(iter(texts.values()))[0]!r}"
        )
    workspace = system.new_workspace()
    return {i: SignalEvent.of(workspace, problem, *text) for i, text in texts.items()}


def _set_watches(run: RunState, stepper: PythonStepper, formulation: str) -> None:
    """Enable detection of stiffness and singular configurations in a mechanism's run."""
    if not isinstance(run.system, Index2System):
        return
    control = stepper if isinstance(stepper, Adaptive) and formulation != "index1" else None
    if control and isinstance(run.tableau, Tableau):
        run.stiffness = StiffnessDetector(run.system, run.tableau, control)
    if run.system.ng:
        kept = run.project or formulation == "ggl"
        run.singular = SingularityMonitor(run.system, kept, control, formulation == "index2")
        if control:
            run.back = BackwardStepper.of(run, float(control.rtol))


def positive(**values: Any) -> None:
    """Reject values that are not positive numbers; None means not given.

    Raises:
        InputError: naming the argument.
    """
    for name, value in values.items():
        if value is None:
            continue
        if isinstance(value, bool) or not isinstance(value, Real) or not float(value) > 0:
            raise InputError(f"{name} must be a positive number, got {value!r}")


def _start(problem: Problem, start: Start, t: float, rtol: Any) -> Array:
    """Return the start; with step-size control, loops may be violated as after a run with drift."""
    q, v, s = start
    drifted = DRIFTED * float(rtol) if isinstance(rtol, Real) else 0.0
    return problem.point(q, v, t, s, max(START, drifted))


def projected(problem: Problem, project: bool | str, formulation: str, tableau: Any, step: float | None) -> bool:
    """Return whether positions are projected after each step."""
    if project not in (True, False, "auto"):
        raise InputError(f"project is True, False or 'auto', got {project!r}")
    if project == "auto":
        return isinstance(problem, Mechanism) and formulation == "index2" and step is None and problem.ng > 0
    if project and not isinstance(problem, Mechanism):
        raise InputError("project=True belongs to mechanisms: 0 = g of a textbook problem is kept by the method")
    if project and formulation != "index2" and not isinstance(tableau, ExplicitMethod):
        belongs = f"project=True belongs to formulation 'index2', and to {', '.join(EXPLICIT)} of 'index1'"
        raise InputError(f"{belongs}; got {tableau.name!r} of {formulation!r}")
    return bool(project)


def within(t_eval: Array, t0: float, t1: float) -> Array:
    """Return times to report as an array, within the span from t0 to t1, in its order.

    Raises:
        InputError: for any other times.
    """
    try:
        times = np.asarray(t_eval, float)
    except (TypeError, ValueError):
        raise InputError(f"t_eval is an array of times, got {t_eval!r}") from None
    sign = 1.0 if t1 >= t0 else -1.0
    inside = times.ndim == 1 and len(times) and np.isfinite(times).all()
    inside = inside and sign * times[0] >= sign * t0 and sign * times[-1] <= sign * t1
    if not inside or (np.diff(times) * sign <= 0).any():
        raise InputError(f"t_eval must run from {t0} to {t1} in the span's order")
    return times
