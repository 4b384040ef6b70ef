"""Validated options of a run, from its arguments, settings of the mechanism file, and defaults."""

from collections.abc import Hashable, Mapping, Sequence
from math import inf
from numbers import Integral
from typing import Any, NamedTuple

import numpy as np

from ...arguments import as_numbers
from ...errors import InputError, UnknownNameError, is_number, require
from ...mechanism import Mechanism
from ...mechanism.model_settings import CONTROL_SETTINGS
from ...methods import EXPLICIT, METHODS, ExplicitMethod, Tableau
from ...solution.solution import Problem
from ...system import Array
from ..events.event import Event, Events, as_events
from ..steppers.library_solver import LibrarySolver
from ..steppers.solvers import find_method
from .defaults import DEFAULTS
from .span import checked_span, checked_times, end_of_tables

METHOD_SETTINGS = "formulation", "project", "baumgarte"
STEP_SIZES = "step", "first_step", "max_step"


class RunOptions(NamedTuple):
    """Options of a run, see the arguments of `mbdae.solve`.

    Attributes:
        method: a method, or a solver of another library, which has a stepper but not the interface of methods.
        t1: end of the span.
        t_eval: output times; None for the nodes of the run.
        end: end of the run: t1, or the end of the table of a driver that is not extrapolated.
        project: whether positions are projected after each step.
    """

    method: Any
    formulation: str
    project: bool
    baumgarte: tuple[float, float] | None
    t0: float
    t1: float
    end: float
    step: float | None
    rtol: Any
    atol: float | Array | None
    first_step: float | None
    max_step: float
    max_steps: int | None
    jumps: Sequence[float]
    events: tuple[Event, ...]
    backend: str
    t_eval: Array | None

    @classmethod
    def from_settings(
        cls, problem: Problem, t_span: float | Sequence[float] | None, settings: Mapping[str, Any]
    ) -> "RunOptions":
        """Return the options for arguments of `mbdae.solve` by name, without events and output times.

        Raises:
            UnknownNameError, InputError: as `from_arguments`.
        """
        given = {"jumps": (), "backend": "auto", **settings}
        return cls.from_arguments(problem, t_span, None, given.pop("jumps"), None, given.pop("backend"), **given)

    @classmethod
    def from_arguments(
        cls,
        problem: Problem,
        t_span: float | Sequence[float] | None,
        t_eval: Array | None,
        jumps: Sequence[float],
        events: Events,
        backend: str,
        **given: Any,
    ) -> "RunOptions":
        """Return the options for the arguments of a run, by the names of `DEFAULTS`; None means not given.

        Raises:
            InputError: for invalid arguments.
            UnknownNameError: for an unknown method or option.
        """
        given = _given_options(given)
        if "max_steps" in given and not isinstance(given["max_steps"], Integral):
            raise InputError(f"max_steps must be an integer, got {given['max_steps']!r}")
        if "step" in given and (controls := [name for name in CONTROL_SETTINGS if name in given]):
            raise InputError(f"step fixes the size of all steps: give it, or {', '.join(controls)}, not both")
        c = complete_settings(problem, given)
        t0, t1 = checked_span((0.0, problem.duration) if t_span is None else t_span, may_be_empty=True)
        end = end_of_tables(problem.drivers, t0, t1)
        times = None if t_eval is None else checked_times(t_eval, t0, end)
        c |= {"jumps": jumps, "events": as_events(events), "backend": backend, "t_eval": times}
        return cls(**c, t0=t0, t1=t1, end=end)

    @property
    def sign(self) -> float:
        """Direction of time, 1 or -1."""
        return 1.0 if self.t1 >= self.t0 else -1.0

    def record(self) -> dict[str, Any]:
        """Return the options that are stored with the solution."""
        custom = isinstance(self.method, Tableau) and METHODS.get(self.method.name) is not self.method
        return {
            "method": self.method.name,
            "formulation": self.formulation,
            "project": self.project,
            "baumgarte": self.baumgarte,
            "t_span": [self.t0, self.t1],
        } | ({"tableau": self.method.to_dict()} if custom else {})


def _given_options(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Return the given options, with step sizes in double precision and absolute tolerances as an array.

    Raises:
        InputError: for a size or number of steps that is not positive, or a tolerance that is negative.
        UnknownNameError: for an unknown option.
    """
    if unknown := arguments.keys() - DEFAULTS.keys():
        raise UnknownNameError("option", min(unknown), DEFAULTS)
    given = {name: x for name, x in arguments.items() if x is not None}
    if sizes := {name: x for name, x in given.items() if name in STEP_SIZES or name == "max_steps"}:
        require_positive(**sizes)
        given |= {name: float(x) for name, x in sizes.items() if name in STEP_SIZES}
    if "atol" in given:
        given["atol"] = atol = as_numbers(arguments["atol"])
        if not (np.isfinite(atol).all() and (atol >= 0).all()):
            raise InputError(f"atol must be finite and not negative, one number or several, got {arguments['atol']!r}")
    return given


def require_positive(**values: float | None) -> None:
    """Reject values that are not positive numbers; None means not given. Steps are finite.

    Raises:
        InputError: naming the argument.
    """
    for name, value in values.items():
        if value is None:
            continue
        if not (is_number(value) and value > 0) and (name in ("step", "first_step") or value != inf):
            raise InputError(f"{name} must be a positive number, got {value!r}")


def complete_settings(problem: Problem, given: Mapping[str, object]) -> dict[str, Any]:
    """Complete the settings of a run by those of the mechanism file and the defaults; None means not given.

    Raises:
        UnknownNameError, InputError: for an invalid method, or one that cannot project.
    """
    arguments = {name: x for name, x in given.items() if x is not None}
    from_file = problem.settings.given if isinstance(problem, Mechanism) else {}
    if from_file:
        overridden = set(METHOD_SETTINGS if "method" in arguments or "formulation" in arguments else ())
        overridden |= set(CONTROL_SETTINGS if "step" in arguments else ())
        overridden |= {"step"} if any(name in arguments for name in CONTROL_SETTINGS) else set()
        from_file = {name: x for name, x in from_file.items() if name not in overridden}
    c = DEFAULTS | from_file | arguments
    require(c["formulation"], str, "formulation is a name")
    try:
        c["method"] = find_method(c["formulation"], c["method"])
    except UnknownNameError as e:
        in_file = "method" in from_file and "method" not in arguments
        raise UnknownNameError(f"solve.{e.kind}", e.name, e.valid) if in_file else e from None
    c["project"] = _projects_positions(problem, c["project"], c["formulation"], c["method"], c["step"])
    return c


def _projects_positions(
    problem: Problem, project: bool | str, formulation: str, method: Any, step: float | None
) -> bool:
    """Return whether positions are projected after each step.

    Raises:
        InputError: for an invalid value, or a problem, formulation or method without projection.
    """
    if not isinstance(project, Hashable) or project not in (True, False, "auto"):
        raise InputError(f"project is True, False or 'auto', got {project!r}")
    one_step = formulation == "index2" and not isinstance(method, LibrarySolver)
    if project == "auto":
        return isinstance(problem, Mechanism) and one_step and step is None and problem.ng > 0
    if project and not isinstance(problem, Mechanism):
        raise InputError("project=True is for mechanisms: the method itself satisfies 0 = g of a textbook problem")
    if project and not one_step and not isinstance(method, ExplicitMethod):
        explicit = f"{', '.join(EXPLICIT)} of 'index1'"
        valid = f"project=True is for one-step methods of formulation 'index2', and for {explicit}"
        raise InputError(f"{valid}; got {method.name!r} of {formulation!r}")
    return bool(project)
