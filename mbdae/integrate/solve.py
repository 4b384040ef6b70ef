"""Integrate a mechanism or a textbook problem."""

from collections.abc import Sequence
from time import perf_counter

from ..mechanism import ModelSource
from ..mechanism.inputs import Inputs
from ..methods import MethodLike
from ..solution.problem import problem_of
from ..solution.solution import Problem, Solution
from ..system import Array
from .events.event import Events
from .options.options import RunOptions
from .run.loop import Progress, run_to_end
from .run.result import make_solution
from .run.run_setup import prepare


def solve(
    problem: Problem | ModelSource,
    t_span: float | Sequence[float] | None = None,
    q: Array | None = None,
    v: Array | None = None,
    s: Array | None = None,
    *,
    method: MethodLike | None = None,
    formulation: str | None = None,
    project: bool | str | None = None,
    baumgarte: tuple[float, float] | None = None,
    step: float | None = None,
    rtol: float | None = None,
    atol: float | Array | None = None,
    first_step: float | None = None,
    max_step: float | None = None,
    max_steps: int | None = None,
    jumps: Sequence[float] = (),
    t_eval: Array | None = None,
    events: Events = None,
    progress: Progress | None = None,
    backend: str = "auto",
) -> Solution:
    """Integrate a mechanism or a textbook problem over a time span.

        q' = v,   M(q) v' = f(t, q, v) + G(q)^T lam,   0 = G(q) v + g_t(t, q);      y' = f(t, y, z),   0 = g(t, y)

    Half-explicit methods satisfy the constraint at every stage (Brasey, Hairer, SIAM J. Numer. Anal. 30 (1993); Murua,
    Computing 59 (1997); Arnold, BIT 38 (1998)), Radau IIA methods by collocation (Hairer, Wanner II, VII.4).

    Defaults come from the ``[solve]`` table of a mechanism file (`mbdae.mechanism.model_settings.SolveSettings`).

    Args:
        problem: a mechanism, a `mbdae.Hessenberg` problem (with its own start), or an argument of `mbdae.load`.
        t_span: end, or start and end in s; the end may lie before the start. From 0 to the model's duration if
            omitted.
        q: consistent start configuration (nq,); the model's start if omitted.
        v: consistent start velocity (nv,); the model's start if omitted.
        s: start values (ns,) of the states of actuators and controllers; their defaults if omitted.
        method: a name of `mbdae.METHODS`, a `mbdae.Tableau`, or the file of one, ``"mine.toml"``; ``"ida"``, SUNDIALS'
            BDF (``pip install "mbdae[sundials]"``); pherk6 if omitted; for ``"index1"`` dop853, or one of scipy's
            RK45, DOP853, Radau, LSODA.
        formulation: ``"index2"``: closures enforced at velocity level, and see ``project``; ``"ggl"``: also at position
            level, by a second multiplier; ``"index1"``: neither, accelerations are integrated as a baseline.
            Mechanisms only.
        project: project the state onto g = 0 and G v = 0 after each step, over all rows and in the mass metric; for
            ``"index2"``, and dop853. ``"auto"`` projects for ``"index2"`` with step-size control, and not with fixed
            steps, which serve to study methods. Without projection, g and redundant rows drift with the errors of the
            method.
        baumgarte: alpha and beta in 1/s, for ``"index1"``: 0 = G v' + gamma + 2 alpha G v + beta^2 g.
        step: fixed step in s; if omitted, the step size is controlled, and singular configurations are crossed. If a
            fixed step would end in a singular configuration, three shorter steps replace two.
        rtol: relative tolerance per step of q and v; 1e-8 if omitted.
        atol: absolute tolerance, a number or one for each component of (q, v) in the tangent; 0.01 rtol if omitted.
        first_step: first step in s; estimated if omitted.
        max_step: largest step in s.
        max_steps: largest number of steps taken or rejected; unlimited if omitted.
        jumps: times at which forces that depend on t jump: steps end there. The times of jumps of controllers and
            of functions of time in mechanism files are known.
        t_eval: times to report, in the span's order, interpolated as by ``sol(t)``; all steps if omitted.
        events: signals and levels, ``"q.slider = 0.3"``, functions event(t, q, v) -> float (textbook problems:
            event(t, y)), or `mbdae.Event` of either; zeros are recorded, and a terminal event ends the run.
        progress: called with the completed fraction, after each step or several times a second.
        backend: ``"native"``: the compiled core, for mechanisms; ``"python"``; or ``"auto"``: the core if it is
            available and supports the problem. ``stats["backend"]`` reports which.

    Returns:
        The solution; after a failure, up to the last node: see `status` and `message`. Runs with status ``"finished"``
        or ``"event"`` are successful; a ``"doubtful"`` run reached its end, but a check of its accuracy or of its
        assumptions failed; runs with any other status of `mbdae.errors.STATUS` stopped before the end.

    Raises:
        InputError: for invalid arguments, or an inconsistent start.
        UnknownNameError: for an unknown method.
    """
    problem = problem_of(problem, "solve")
    options = RunOptions.from_arguments(
        problem, t_span, t_eval, jumps, events, backend, method=method, formulation=formulation, project=project,
        baumgarte=baumgarte, step=step, rtol=rtol, atol=atol, first_step=first_step, max_step=max_step,
        max_steps=max_steps,
    )  # fmt: skip
    inputs = Inputs.of_run(problem)
    run = prepare(inputs.begin(s) if inputs else problem, options, (q, v, s), kinds=())
    started = perf_counter()
    status, message = run_to_end(run, progress)
    seconds = perf_counter() - started
    recorded = inputs.recorded(*run.nodes()[:2]) if inputs else problem
    out = make_solution(run, recorded, status, message, seconds)
    run.release()
    return out
