"""Setup of a run: back end, workspace, stepper and initial point."""

from collections.abc import Iterable, Sequence
from numbers import Real
from typing import Any

from ...backend import checked_backend, select_core, status
from ...errors import InputError
from ...mechanism import Mechanism, NotCompiled
from ...mechanism.formulations.compiled_systems import CompiledSystem
from ...methods import unsupported_reason
from ...methods.variational import NewtonMethod
from ...solution.solution import Problem
from ...system import Array, System
from ...tolerances import INPUT_DIGITS, NEGLIGIBLE
from ..events.source import EventSource
from ..options.options import RunOptions
from ..steppers.adaptive import Adaptive
from ..steppers.fixed import Fixed
from ..steppers.library_solver import LibrarySolver
from ..steppers.native import NativeStepper
from ..steppers.stepper import PythonStepper, Stepper
from .backward_steps import BackwardStepper
from .run_state import SOURCES, RunState

NEWTON_TOLERANCE = NEGLIGIBLE  # implicit stages are iterated to min(this, sqrt(rtol)) rtol; RADAU5 uses 0.03
START_DRIFT = 100.0  # times rtol: largest constraint violation at the start, as after a run with drift


def prepare(
    problem: Problem,
    options: RunOptions,
    start: tuple[Array | None, Array | None, Array | None],
    kinds: Sequence[type[EventSource]] = SOURCES,
) -> RunState:
    """Return a run that is ready to begin from (q, v, s), with sources of events; None: start of the mechanism.

    Raises:
        InputError: for options that do not suit the problem, or an inconsistent start.
    """
    if isinstance(problem, Mechanism):
        bound = _bind(problem, options)
        y = _start(problem, start, options, bound[0])
    else:
        q, v, s = start
        y = problem.point(q, v, options.t0, s)  # first, since binding requires valid functions
        bound = _bind(problem, options)
    return _make_run(problem, options, bound, y, kinds)


def prepare_at(problem: Problem, options: RunOptions, y: Array) -> RunState:
    """Return a run that can begin at y (n,), without checks of y.

    Raises:
        InputError: for options that do not suit the problem.
    """
    return _make_run(problem, options, _bind(problem, options), y, SOURCES)


def _bind(problem: Problem, o: RunOptions) -> tuple[System, str]:
    """Bind a problem to a workspace, see `bind`, and check that the method of the run can integrate it."""
    system, fallback = bind(problem, o.formulation, o.baumgarte, o.backend)
    if reason := unsupported_reason(o.method, system):
        raise InputError(reason)
    return system, fallback


def _make_run(
    problem: Problem, options: RunOptions, bound: tuple[System, str], y: Array, kinds: Sequence[type[EventSource]]
) -> RunState:
    system, fallback = bound
    stepper = _stepper(system, options)
    if (control := stepper.control) and options.formulation != "ggl":  # ggl satisfies 0 = g and 0 = G v to rounding
        rtol = float(control.rtol)
        system.accuracy = min(NEWTON_TOLERANCE, rtol**0.5) * rtol
    run = RunState(problem, options, system, stepper, y, kinds)
    run.fallback = fallback or ("" if options.method.in_core else f"method {options.method.name!r}")
    if isinstance(problem, Mechanism):  # recorded before controllers, modes and projections change the start
        values, nq, nv = y.tolist(), problem.nq, problem.nv
        run.settings |= {"q": values[:nq], "v": values[nq : nq + nv], "s": values[nq + nv : -1]}
    if system.nz and run.mechanism_system and run.control:
        run.backward_stepper = BackwardStepper.from_run(run, float(run.control.rtol))
    return run


def _stepper(system: System, o: RunOptions) -> Stepper:
    inner = _python_stepper(system, o)
    n = len(range(system.ny)[system.error_components])
    if (shape := getattr(o.atol, "shape", ())) not in ((), (n,)):
        raise InputError(f"atol is one number or one for each of {n} components, got shape {shape}")
    if not system.native or isinstance(o.method, LibrarySolver) or not o.method.in_core:
        return inner
    if inner.control and isinstance(o.method, NewtonMethod):  # Python controls the step size, the core takes the steps
        inner.backend = "native"
        return inner
    return NativeStepper(inner, system, o.method, o.project)


def _python_stepper(system: System, o: RunOptions) -> PythonStepper:
    control = o.rtol, o.atol, o.first_step, o.max_step
    if isinstance(o.method, LibrarySolver):
        if o.step:
            raise InputError(f"method {o.method.name!r} controls the step size: set rtol and atol instead of a step")
        return o.method.stepper(system, *control)
    if o.step:
        return Fixed(o.step, o.t0, o.t1)
    if not o.method.error_power:
        raise InputError(f"method {o.method.name!r} takes fixed steps: give a step")
    return Adaptive(o.method.error_power, *control, o.method.control, o.method.min_growth(system.ny))


def _start(
    mechanism: Mechanism, start: tuple[Array | None, Array | None, Array | None], options: RunOptions, system: System
) -> Array:
    """Return the initial point; with step-size control, closures may be violated as after a run with drift-off."""
    q, v, s = start
    drifted = START_DRIFT * float(options.rtol) if isinstance(options.rtol, Real) and not options.step else 0.0
    residual = system.closure_residual if isinstance(system, CompiledSystem) else None
    return mechanism.point(q, v, options.t0, s, max(INPUT_DIGITS, drifted), residual)


def bind(problem: Any, formulation: str, baumgarte: tuple[float, float] | None, backend: str) -> tuple[System, str]:
    """Bind a problem to a workspace, of the compiled core if possible.

    Returns:
        The workspace; and, for ``backend="auto"``, the reason why the run cannot use the core, or "".

    Raises:
        InputError: for ``backend="native"`` if the core is missing or does not support the problem.
        UnknownNameError: for an unknown back end or formulation.
    """
    unsupported = "" if isinstance(problem, Mechanism) else "textbook problems"
    system = problem.workspaces.acquire if isinstance(problem, Mechanism) else problem.system
    native = None if unsupported and backend in ("auto", "native") else select_core(backend)
    if native:
        try:
            return system(formulation, baumgarte, native), ""
        except NotCompiled as e:
            unsupported = str(e)
    if unsupported and backend == "native":
        raise InputError(f"backend='native' does not support {unsupported}: use 'auto' or 'python'")
    reason = "" if backend == "python" else unsupported or status()
    return system(formulation, baumgarte), reason


def common_backend(
    problem: object, runs: Iterable[tuple[str, tuple[float, float] | None]], backend: str
) -> tuple[str, str]:
    """Choose one back end for several runs, so that their computing times are comparable.

    Args:
        problem: a mechanism or a textbook problem.
        runs: formulation, and Baumgarte's parameters alpha and beta, of each run.
        backend: as for `mbdae.solve`.

    Returns:
        ``"native"`` or ``"python"``; and the reason why one of the runs cannot use the core, or "".

    Raises:
        InputError: for ``backend="native"`` if the core does not support all of them.
        UnknownNameError: for an unknown back end.
    """
    reasons = set()
    for run in runs:
        system, reason = bind(problem, *run, checked_backend(backend))
        reasons.add(reason)
        if isinstance(problem, Mechanism):
            problem.workspaces.release(system)  # type: ignore[arg-type]
    reason_for_python = "; ".join(sorted(reasons - {""}))
    return "python" if backend == "python" or reason_for_python else "native", reason_for_python
