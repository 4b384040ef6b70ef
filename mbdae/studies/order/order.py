"""Observed orders against claimed orders, on any mechanism and on textbook problems."""

from typing import Any

from ...errors import InputError, as_list
from ...integrate.options.span import checked_span
from ...integrate.run.run_setup import common_backend
from ...integrate.steppers.solvers import SOLVERS
from ...mechanism import Mechanism, ModelSource
from ...mechanism.tree.coordinate_units import quantity_units
from ...methods import METHODS, Method, unsupported_reason
from ...methods import method as find_method
from ...methods.uncompiled import uncompiled
from ...solution.problem import problem_of
from ...solution.solution import Problem
from .measurement import MIN_OUTPUTS, Measurement, Progress, run_until_interrupted
from .result import OrderStudy

__all__ = ["order"]


def order(
    problem: Problem | ModelSource,
    methods: Any = None,
    *,
    T: float | None = None,
    steps: int | None = None,
    progress: Progress | None = None,
) -> OrderStudy:
    """Measure the orders of methods on a problem with fixed steps and compare them with their claims.

    An error is the largest one over common times, error(h) ~ C h^p; p is the least-squares slope of log error versus
    log h, of at least four refinements above rounding and the uncertainty of a reference by another method. lam is that
    of the hidden constraint, 0 = G v' + gamma, own lam that of the method. After Ctrl-C it returns the finished
    methods.

    Args:
        problem: a mechanism (started from its model file's state), a textbook problem, or the name or path of one.
        methods: a name or several, or tableaus; when left out ``"all"`` that support the problem.
        T: end time in s; that of the model when left out.
        steps: coarsest number of steps, at least five. When left out that of the model file, or fewer if the order
            cannot be estimated otherwise.
        progress: called with the name of each run.

    Raises:
        UnknownNameError: for an unknown method.
        InputError: for invalid T or steps, a method without fixed steps, or an invalid problem.
    """
    problem = problem_of(problem, "order")
    chosen = _chosen(problem, as_list(methods or "all", "methods is a list of names"))
    mech = problem if isinstance(problem, Mechanism) else None
    settings = mech.order if mech else None
    _, T = checked_span(T if T is not None else (settings.T if settings else problem.duration), end=True)
    add_coarser_steps, steps = steps is None, steps if steps is not None else (settings.steps if settings else 40)
    if steps < MIN_OUTPUTS:
        raise InputError(f"steps must be at least {MIN_OUTPUTS}, got {steps = }")
    start = mech.assemble(mech.order.q, mech.order.v) if mech and (mech.order.q or mech.order.v) else None
    backend, python_reason = common_backend(problem, [("index2", None)], "auto")
    measure = Measurement(problem, T, steps, start, progress or (lambda name: None), backend)
    measure.add_coarser_steps = add_coarser_steps
    orders, missing = run_until_interrupted(chosen, measure.judge)
    return OrderStudy(problem.title, T, orders, backend, uncompiled(chosen.values(), python_reason), missing,
                      units=quantity_units(mech) if mech else {})  # fmt: skip


def _chosen(problem: Problem, names: list[Any]) -> dict[str, Method]:
    """Return methods by name; for ``["all"]`` those that support the problem."""
    return {m.name: m for m in map(_fixed_step_method, _supported_methods(problem) if names == ["all"] else names)}


def _fixed_step_method(name: str | Method) -> Method:
    """Return a method that takes fixed steps.

    Raises:
        InputError: for a solver with step-size control only.
    """
    if isinstance(name, str) and name in SOLVERS:
        raise InputError(f"method {name!r} controls the step size, orders are those of fixed steps")
    return find_method(name)


def _supported_methods(problem: Problem) -> list[Method]:
    """Return the methods that support a problem."""
    system = problem.system()
    return [m for m in METHODS.values() if not unsupported_reason(m, system)]
