"""Selection of the methods of a comparison, and of the runs of each."""

from collections.abc import Iterable, Sequence

import numpy as np

from ...errors import InputError, as_list, is_number, require
from ...integrate.run.run_setup import common_backend
from ...integrate.steppers.ida import IDA
from ...integrate.steppers.solvers import find_method
from ...mechanism import Mechanism
from ...methods import EXPLICIT, unsupported_reason
from ...methods import METHODS as ALL_METHODS
from ...solution.solution import Problem
from ..method_variant import Variant, default_variants, variants
from .reference_motion import Trial

ALL = "all"
METHODS = ("pherk6", "pherk5", "herk5", "hedop5", "radau9", "ggl:pherk5", "index1:dop853")  # after the default
TOLERANCES = tuple(10.0**-k for k in range(3, 11))


def selected(
    problem: Problem,
    methods: str | Iterable[str | Variant] | None,
    formulations: str | Iterable[str] | None,
    rtol: Sequence[float] | None,
    steps: Sequence[int] | None,
    backend: str,
) -> tuple[list[Variant], dict[str, str]]:
    """Return the methods to compare, and the methods that ``"all"`` omits with the reasons.

    Raises:
        InputError: for a method given by name that does not suit the problem, or if none does.
    """
    names = None if methods is None else as_list(methods, "methods is a list of names")
    controlled, fixed = steps is None or rtol is not None, steps is not None
    if names is None and formulations is None:
        chosen = default_variants(problem, METHODS, **({"rtol": TOLERANCES[0]} if controlled else {"step": 1.0}))
    elif names == [ALL]:
        return suitable(problem, all_variants(formulations), fixed, backend)
    else:
        chosen = variants(METHODS if names is None else names, formulations)
    for v in chosen:
        if reason := _reason(problem, v, fixed):
            raise InputError(reason)
    if reason := _reason_of_formulations(problem, chosen):
        raise InputError(reason)
    return chosen, {}


def all_variants(formulations: str | Iterable[str] | None = None) -> list[Variant]:
    """Return all methods of `mbdae.METHODS` in the formulations; by default also ``ida`` and index-1 methods."""
    further = [] if formulations else [IDA.name, *(f"index1:{name}" for name in EXPLICIT)]
    return variants([*variants(ALL_METHODS, formulations), *further])


def suitable(
    problem: Problem, candidates: Iterable[Variant], fixed: bool, backend: str
) -> tuple[list[Variant], dict[str, str]]:
    """Return the candidates that suit a problem, and the omitted candidates with the reasons.

    Args:
        problem: the problem.
        candidates: methods.
        fixed: whether numbers of steps are given for methods without step-size control.
        backend: back end of all runs; the compiled core omits methods whose steps Python computes.

    Raises:
        InputError: if none does.
    """
    native = common_backend(problem, [("index2", None)], backend)[0] == "native"
    omitted: dict[str, str] = {}
    candidates = list(candidates)
    for v in candidates:
        reason = _reason(problem, v, fixed) or _reason_of_formulations(problem, [v])
        if not reason and native and not find_method(v.formulation, v.method).in_core:
            reason = f"steps of {v.name!r} are computed in Python: compare with the back end 'python'"
        if reason:
            omitted[str(v)] = reason
    if not (chosen := [v for v in candidates if str(v) not in omitted]):
        raise InputError("no method suits: " + "; ".join(omitted.values()))
    return chosen, omitted


def _reason(problem: Problem, v: Variant, fixed: bool) -> str:
    """Return why a method does not suit a problem, or requires numbers of steps; "" if it is suitable."""
    method = find_method(v.formulation, v.method)
    try:
        if reason := unsupported_reason(method, problem.system(v.formulation)):
            return reason
    except InputError as e:
        return str(e)
    if not fixed and not method.error_power:
        return f"method {method.name!r} takes fixed steps: compare with numbers of steps"
    return ""


def _reason_of_formulations(problem: Problem, chosen: list[Variant]) -> str:
    """Return a message on methods whose formulations do not support the switches of the problem, or ""."""
    unsupported = [str(v) for v in chosen if v.formulation != "index2"]
    if not (unsupported and isinstance(problem, Mechanism) and problem.switches):
        return ""
    name = problem.switches[0].name
    message = f"{name!r}: unilateral constraints and switches need formulation 'index2'"
    return f"{message}, leave out {', '.join(unsupported)}"


def trials_of(methods: list[Variant], rtol: Sequence[float] | None, steps: Sequence[int] | None) -> list[Trial]:
    """Return the runs of each method: with tolerances, or with numbers of steps if it needs them or only these are set.

    Raises:
        InputError: for invalid tolerances or numbers of steps.
    """
    numbers = [] if steps is None else checked_steps(steps)
    tolerances = [] if rtol is None and numbers else checked_tolerances(TOLERANCES if rtol is None else rtol)
    controlled = [m for m in methods if tolerances and m.controlled]
    if controlled == methods and numbers:
        raise InputError("every method controls its steps: give tolerances or numbers of steps, not both")
    out = []
    for m in methods:
        out += [Trial(m, r) for r in tolerances] if m in controlled else [Trial(m, None, n) for n in numbers]
    return out


def checked_steps(steps: Sequence[int], name: str = "steps") -> list[int]:
    """Return numbers of steps, in increasing order.

    Raises:
        InputError: for numbers that are not whole or below 1, or none.
    """
    require(steps, Sequence | np.ndarray, f"{name} is a list of whole numbers")
    if not len(steps) or not all(is_number(n) and n >= 1 and n == int(n) for n in steps):
        raise InputError(f"{name} are whole numbers of at least 1, got {steps!r}")
    return sorted({int(n) for n in steps})


def checked_tolerances(rtol: Sequence[float]) -> list[float]:
    """Return tolerances, the loosest first.

    Raises:
        InputError: for numbers that are not between 0 and 1, or none.
    """
    require(rtol, Sequence | np.ndarray, "rtol is a list of numbers")
    if not len(rtol) or not all(is_number(r) and 0 < r < 1 for r in rtol):
        raise InputError(f"rtol is a list of numbers between 0 and 1, got {rtol!r}")
    return sorted({float(r) for r in rtol}, reverse=True)
