"""Comparison of methods and tolerances on one problem: errors relative to a reference, work, and time."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...integrate.options.span import checked_span
from ...integrate.run.run_setup import common_backend
from ...integrate.steppers.solvers import find_method
from ...mechanism import Mechanism, ModelSource
from ...methods.uncompiled import uncompiled
from ...solution.problem import problem_of
from ...solution.solution import Problem
from ...system import Array
from ...tolerances import INTERPOLATION, SUM_ROUNDING
from ..method_variant import Variant, variants
from .comparison import Comparison
from .comparison_runs import ComparisonRuns, Progress
from .reference_motion import ReferenceMotion
from .selection import selected, trials_of

__all__ = ["compare"]

REFERENCE = ("pherk6", "radau9")


def compare(
    problem: Problem | ModelSource,
    t_span: float | Sequence[float] | None = None,
    q: Array | None = None,
    v: Array | None = None,
    *,
    methods: str | Iterable[str | Variant] | None = None,
    formulations: str | Iterable[str] | None = None,
    rtol: Sequence[float] | None = None,
    steps: Sequence[int] | None = None,
    reference: Sequence[str | Variant] = REFERENCE,
    reference_rtol: float = 1e-12,
    outputs: int = 20,
    repeats: int = 3,
    max_steps: int = 100_000,
    workers: int = 1,
    timed_together: bool = False,
    progress: Progress | None = None,
    path: str | Path | None = None,
    fresh: bool = False,
    backend: str = "auto",
) -> Comparison:
    """Run many methods on one mechanism or textbook problem and measure errors, drift, work and time.

    Errors are the largest differences from a reference over common times, of q in the tangent, v, and lam by the hidden
    constraint; of y and z of a textbook problem. The reference is the exact solution if known, else a run with tight
    tolerance; a second run by a method of another family estimates its uncertainty.

    After Ctrl-C it returns the finished runs. With ``path``, every finished run is stored in that file, and the same
    call resumes from it.

    Args:
        problem: a mechanism, a textbook problem, or the name or path of one, see `mbdae.load`.
        t_span: end, or start and end in s; from 0 to the model's duration when left out.
        q: consistent start configuration (nq,); the model's when left out.
        v: consistent start velocity (nv,); the model's when left out.
        methods: names, or tableaus, alone or with a formulation in front: ``"pherk5"``, ``"project:pherk5"``,
            ``"ggl:radau5"``, ``"index1:dop853"``, ``"baumgarte=20,20:dop853"``, see `mbdae.studies.method_variant`; a
            textbook problem has index 2 only. ``"all"`` for all of `mbdae.METHODS`, and ``dop853`` with index 1, except
            those that do not suit the problem, the back end or the step-size control: the result names these with
            their reasons. When left out, the default of `mbdae.solve`, with its projection, and
            those of `mbdae.studies.comparison.selection.METHODS` whose formulation the problem supports.
        formulations: for methods without one: index2, project, ggl. ``"index2"`` when left out.
        rtol: relative tolerances, 1e-4,1e-6; 1e-3 to 1e-10 when left out. atol is 0.01 rtol.
        steps: numbers of fixed steps, instead of tolerances; with tolerances only for methods without step-size
            control.
        reference: two methods of different families; errors are differences from the first.
        reference_rtol: their tolerance; if they cannot satisfy it, the next power of ten that they can.
        outputs: number of common times, equidistant, including the end.
        repeats: number of repetitions for the median wall time. Repetitions cycle through all runs; runs longer than
            2 s are timed once. 0: no times.
        max_steps: runs with more steps are aborted.
        workers: processes; times are still measured one by one, after all runs. Scripts need
            ``if __name__ == "__main__":``.
        timed_together: measure times in the processes, while other runs compute.
        progress: called with the completed fraction and the name of the next run.
        path: a .json or .csv file of the finished runs, which is read first if it exists; wall times are measured
            again if they are of another machine.
        fresh: do not resume from the file, but replace it once the first run is finished.
        backend: common back end of all runs, so that their times are comparable: ``"auto"`` takes the compiled core if
            it supports every method of the comparison, and Python otherwise.

    Raises:
        InputError: for wrong arguments, a reference that cannot be computed, or a file with another comparison.
        UnknownNameError: for an unknown method or formulation.
    """
    problem = problem_of(problem, "compare")
    motion = motion_of(problem, t_span, q, v, outputs, max_steps)
    chosen, omitted = selected(problem, methods, formulations, rtol, steps, backend)
    trials = trials_of(chosen, rtol, steps)
    kinds = {str(t.variant): t.variant for t in trials}.values()
    runs = [(v.formulation, v.baumgarte) for v in kinds]
    shared, python_reason = common_backend(problem, runs, backend)
    python_reason = uncompiled([find_method(v.formulation, v.method) for v in kinds], python_reason)
    shared = "python" if python_reason else shared
    motion = replace(motion, backend=shared, python_reason=python_reason)
    pair = variants(reference)
    if len(pair) != 2 or not SUM_ROUNDING < reference_rtol < INTERPOLATION:
        raise InputError(f"a reference is two methods and a tolerance below 1e-5, got {reference!r}, {reference_rtol}")
    if workers < 1 or repeats < 0:
        raise InputError(f"workers must be at least 1 and repeats not negative, got {workers}, {repeats}")
    timed = repeats > 0 and (timed_together or workers == 1)
    passes = max(1, repeats + (not timed))
    file = Path(path) if path else None
    comparison_runs = ComparisonRuns(motion, trials, pair, reference_rtol, file, progress, passes, fresh)
    comparison_runs.meta["omitted"] = omitted
    complete = False
    try:
        comparison_runs.compute_reference()
        comparison_runs.measure_errors(workers, timed=timed)
        comparison_runs.measure_times(repeats, workers if timed_together else 1)
        complete = True
    except KeyboardInterrupt:
        if not comparison_runs.uncertainty:
            raise
    return comparison_runs.result(complete)


def motion_of(
    problem: Problem,
    t_span: float | Sequence[float] | None,
    q: Array | None,
    v: Array | None,
    outputs: int,
    max_steps: int,
) -> ReferenceMotion:
    """Return the motion of a comparison; arguments as for `compare`.

    Raises:
        InputError: for an invalid span, or fewer than one output or step.
    """
    t0, t1 = checked_span(problem.duration if t_span is None else t_span)
    if outputs < 1 or max_steps < 1:
        raise InputError(f"expected at least one output and one step, got {outputs = }, {max_steps = }")
    y, n = problem.point(q, v, t0), problem.nq if isinstance(problem, Mechanism) else 0
    start = (y[:n], y[n : n + problem.nv]) if isinstance(problem, Mechanism) else ()
    times = np.linspace(t0, t1, outputs + 1)[1:]
    return ReferenceMotion(problem, start, (t0, t1), times, max_steps)
