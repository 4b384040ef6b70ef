"""Integrate a mechanism or a textbook problem: what is asked for is checked, bound, run and reported."""

from collections.abc import Sequence
from dataclasses import asdict
from numbers import Real
from time import perf_counter
from typing import Any

import numpy as np

from ..errors import STATUS, InputError, StepError, require
from ..mechanism import Compiled, Mechanism
from ..mechanism.assembly import START
from ..mechanism.formulations.index2 import Descriptor
from ..methods import Tableau
from ..solution.solution import Problem, Solution
from ..system import Array
from .ending import event_value, report
from .events import Watch, as_events
from .jumps import Jumps
from .loop import Progress, time_loop
from .retrace import retracer
from .run import Run
from .singularity_watch import SingularWatch
from .steppers.native import Core, bind
from .steppers.pace import Adaptive, Fixed, Pace
from .steppers.scipy_ivp import Scipy, find
from .stiffness import StiffnessWatch

DRIFTED = 100.0  # times rtol: how far loops may stand open at the start, as after a run that let them drift


def solve(
    problem: Problem,
    t_span: Sequence[float],
    q: Array | None = None,
    v: Array | None = None,
    s: Array | None = None,
    *,
    method: str = "pherk6",
    formulation: str = "index2",
    project: bool | str = "auto",
    baumgarte: tuple[float, float] | None = None,
    step: float | None = None,
    rtol: float = 1e-6,
    atol: float | Array | None = None,
    first_step: float | None = None,
    max_step: float = np.inf,
    max_steps: int | None = None,
    jumps: Sequence[float] = (),
    t_eval: Array | None = None,
    events: Any = None,
    progress: Progress | None = None,
    backend: str = "auto",
) -> Solution:
    """Integrate a mechanism or a textbook problem over a time span.

        q' = v,   M(q) v' = f(t, q, v) + G(q)^T lam,   0 = G(q) v + g_t(t, q);      y' = f(t, y, z),   0 = g(t, y)

    Half-explicit methods meet the constraint at every stage (Brasey, Hairer, SIAM J. Numer. Anal. 30 (1993); Murua,
    Appl. Numer. Math. 24 (1997); Arnold, BIT 38 (1998)), Radau IIA methods by collocation (Hairer, Wanner II, VII.4).

    Args:
        problem: a mechanism, or a `mbdae.Hessenberg` problem (which brings its own start).
        t_span: start and end in s; the end may lie before the start.
        q: consistent start configuration (nq,); the model's start when left out.
        v: consistent start velocity (nv,); the model's start when left out.
        s: start values (ns,) of the states of actuators and controllers; their own when left out.
        method: a name of `mbdae.METHODS`; one of RK45, DOP853, Radau, LSODA for ``"index1"``.
        formulation: ``"index2"``: closures kept at velocity level, and see ``project``; ``"ggl"``: at position level
            too, by a second multiplier; ``"index1"``: neither, accelerations stepped by scipy as a baseline.
            Mechanisms only.
        project: bring the state back to g = 0 and G v = 0 after each step, over all rows and in the mass metric; for
            ``"index2"``. ``"auto"`` does so where steps are controlled, and not with fixed ones, where methods are
            studied. Without, g and rows that depend on others drift with the errors of the method.
        baumgarte: alpha and beta in 1/s, for ``"index1"``: 0 = G v' + gamma + 2 alpha G v + beta^2 g.
        step: fixed step in s; the step size is controlled when left out, and singular configurations are then leapt
            over. Where a fixed one would end in one, three shorter steps take the place of two.
        rtol: relative tolerance per step of q and v.
        atol: absolute tolerance, a number or one for each component of (q, v) in the tangent; 0.01 rtol when left out.
        first_step: first step in s; guessed when left out.
        max_step: largest step in s.
        max_steps: largest number of steps taken or rejected; unlimited when left out.
        jumps: times at which forces (of t) jump: steps end there. Controllers and functions of time in mechanism files
            tell their own.
        t_eval: times to report, in the span's order, interpolated as by ``sol(t)``; all steps when left out.
        events: functions event(t, q, v) -> float (textbook problems: event(t, y)) or `mbdae.Event`; their zeros are
            reported, and a terminal one ends the run.
        progress: called with the fraction done, after each step or several times a second.
        backend: ``"native"``: the compiled core, for half-explicit methods on mechanisms in index-2 form; ``"python"``;
            or ``"auto"``: the core where it is there and has what is asked for. ``stats["backend"]`` says which.

    Returns:
        The solution, with everything up to the point of failure if there was one: see `status` and `message`. Runs with
        status ``"finished"`` or ``"event"`` are successes; a ``"doubtful"`` one came to its end, but loops, velocities
        or energy say that it cannot be trusted; those with another of `mbdae.errors.STATUS` stopped before.

    Raises:
        InputError: for wrong arguments, or an inconsistent start.
        UnknownNameError: for a method that does not exist.
    """
    require(problem, Problem, "solve takes a Mechanism (see mbdae.load) or a Hessenberg problem")
    tableau = find(formulation, method)
    project = _projected(problem, project, formulation, step)
    t0, t1 = _span(t_span)
    for name, value in {"step": step, "first_step": first_step, "max_step": max_step, "max_steps": max_steps}.items():
        if value is None and name != "max_step":
            continue
        if isinstance(value, bool) or not isinstance(value, Real) or not value > 0:
            raise InputError(f"{name} must be a positive number, got {value!r}")
    times = None if t_eval is None else _times(t_eval, t0, t1)
    system, fallback = bind(problem, tableau, formulation, baumgarte, backend)
    ahead = Jumps(system, jumps, t1, 1.0 if t1 >= t0 else -1.0)
    run = Run(problem, tableau, t0, ahead, _start(problem, q, v, t0, s, None if step else rtol), system, project)
    pace: Pace
    if formulation == "index1":
        pace = Scipy(tableau, run.system, step, rtol, atol, first_step, max_step)
    elif step:
        pace = Fixed(step, t0, t1)
    else:
        pace = Adaptive(tableau.error_power, rtol, atol, first_step, max_step)
        if isinstance(system, Descriptor) and isinstance(tableau, Tableau):
            run.stiffness = StiffnessWatch(tableau, pace)
    run.pace = pace
    if isinstance(system, Descriptor) and system.ng:
        controlled = pace if isinstance(pace, Adaptive) and formulation != "index1" else None
        run.singular = SingularWatch(system, project or formulation == "ggl", controlled, formulation == "index2")
        if controlled and isinstance(tableau, Tableau):
            run.back = retracer(run, tableau, float(rtol))
    if isinstance(system, Compiled):
        run.core = Core(system, tableau, project)
    watch = Watch(as_events(events), lambda e, t, y: event_value(problem, e, t, y))
    started = perf_counter()
    status, message = "finished", STATUS["finished"]
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # a run that explodes says so by its status
            run.begin()
            watch.begin(t0, run.state.y)
            stopped = time_loop(run, pace, watch, max_steps, progress)
            _check_drivers(problem, t0, run.t)
        if stopped:
            status, message = "event", f"{STATUS['event']} at t = {run.t:.17g}"
    except StepError as e:
        if e.status == "force" and len(run.ts) == 1:  # nothing was computed: an error in the law
            raise InputError(str(e)) from e
        status, message = e.status, str(e)
        if status == "step_size":  # which a driver may be to blame for
            try:
                _check_drivers(problem, t0, t1)
            except StepError as wrong:
                status, message = wrong.status, str(wrong)
    except KeyboardInterrupt:
        status, message = "interrupted", f"{STATUS['interrupted']} at t = {run.t:.6g}"
    order = tableau.order_linear if hasattr(problem, "model") else tableau.order
    settings = {"method": method, "formulation": formulation, "project": project, "baumgarte": baumgarte}
    settings |= {"t_span": [t0, t1], **pace.settings(), "dense_order": max(1, order - 1)}
    seconds = perf_counter() - started
    stats: dict[str, Any] = {
        "steps": run.steps,
        "rejected": run.rejected,
        **run.system.counts.to_dict(),
        "seconds": seconds,
        "backend": "native" if run.core else "python",
    }
    if fallback:
        stats["fallback"] = fallback
    if run.stiffness and run.stiffness.found:
        stats["stiff"] = asdict(run.stiffness.found)
        message = f"{message}; {run.stiffness.found}"
    return report(run, watch, status, message, stats, settings, times)


def _check_drivers(problem: Problem, t0: float, t1: float) -> None:
    """See that the derivatives of drivers are those of their functions."""
    for driver in problem.drivers if isinstance(problem, Mechanism) else ():
        driver.check_run(t0, t1)


def _start(problem: Problem, q: Any, v: Any, t: float, s: Any, rtol: Any) -> Array:
    """The start; under step-size control loops may stand open as after a run that let them drift."""
    drifted = DRIFTED * float(rtol) if isinstance(rtol, Real) else 0.0
    if isinstance(problem, Mechanism):
        return problem.point(q, v, t, s, max(START, drifted))
    return problem.point(q, v, t, s)


def _projected(problem: Problem, project: bool | str, formulation: str, step: float | None) -> bool:
    """Say whether positions are restored after each step."""
    if project not in (True, False, "auto"):
        raise InputError(f"project is True, False or 'auto', got {project!r}")
    if project == "auto":
        return isinstance(problem, Mechanism) and formulation == "index2" and step is None and problem.ng > 0
    if project and formulation != "index2":
        raise InputError(f"project=True belongs to formulation 'index2', got {formulation!r}")
    return bool(project)


def _span(t_span: Sequence[float]) -> tuple[float, float]:
    try:
        t0, t1 = (float(t) for t in t_span)
    except (TypeError, ValueError):
        raise InputError(f"t_span is a pair of times, got {t_span!r}") from None
    if not (np.isfinite(t0) and np.isfinite(t1)):
        raise InputError(f"t_span must be finite, got {t_span!r}")
    return t0, t1


def _times(t_eval: Array, t0: float, t1: float) -> Array:
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
