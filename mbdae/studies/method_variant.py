"""Variants of methods that studies compare: a method in a formulation, and its notation.

``pherk5`` enforces closures at velocity level (index 2); ``project:pherk5`` also projects the state onto g = 0, G v = 0
after each step; ``ggl:radau5`` enforces closures at both levels; ``index1:dop853`` integrates accelerations,
``index1:DOP853`` with scipy, and ``baumgarte=20,20:dop853`` with Baumgarte's alpha and beta in 1/s. ``ggl:ida`` is
SUNDIALS' BDF on the stabilized form.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InputError, UnknownNameError, as_list
from ..integrate.options.options import complete_settings
from ..integrate.steppers.library_solver import LibrarySolver
from ..integrate.steppers.solvers import SOLVERS, find_method
from ..mechanism import Mechanism
from ..methods import EXPLICIT, METHODS, Tableau, method_from_settings
from ..solution.solution import Problem, Solution
from ..units import quantity

PLACEHOLDER = "pherk6"  # replaced by a custom tableau
FORMULATIONS = ("index2", "project", "ggl", "index1", "baumgarte=ALPHA,BETA")


@dataclass(frozen=True)
class Variant:
    """A method in a formulation, see the module.

    Attributes:
        method: a name of `mbdae.METHODS`, ``"ida"``, a method of scipy for ``"index1"``, or a custom tableau.
        formulation: ``"index2"``, ``"ggl"`` or ``"index1"``, as in `mbdae.solve`.
        project: project the state after each step.
        baumgarte: alpha and beta in 1/s.

    Raises:
        InputError: for an invalid combination of method and formulation.
        UnknownNameError: for an unknown method.
    """

    method: Any
    formulation: str = "index2"
    project: bool = False
    baumgarte: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        found = find_method(self.formulation, self.method)
        if self.project and isinstance(found, LibrarySolver):
            reason = f"{found.name!r} is a solver of another library, whose state is not projected"
            raise InputError(f"{reason}: leave out 'project'")
        if isinstance(found, Tableau):  # given itself, or by its name or file
            object.__setattr__(self, "method", found.name if METHODS.get(found.name) is found else found)

    @classmethod
    def parse(cls, text: str) -> "Variant":
        """Read ``method`` or ``formulation:method``.

        Raises:
            UnknownNameError: for an unknown formulation or method.
            InputError: for an invalid alpha or beta.
        """
        prefix, _, method = text.rpartition(":")
        if prefix in ("", "index2"):
            return cls(method)
        if prefix == "project":
            return cls(method, "index1" if method in EXPLICIT else "index2", project=True)
        if prefix in ("ggl", "index1"):
            return cls(method, prefix)
        if prefix.startswith("baumgarte="):
            return cls(method, "index1", baumgarte=_pair(prefix.removeprefix("baumgarte="), text))
        raise UnknownNameError("formulation", prefix, FORMULATIONS)

    @property
    def prefix(self) -> str:
        """The formulation as written before the colon; empty for index 2."""
        if self.baumgarte:
            return f"baumgarte={self.baumgarte[0]:g},{self.baumgarte[1]:g}"
        return "project" if self.project else self.formulation.removeprefix("index2")

    @property
    def name(self) -> str:
        """Name of the method."""
        return getattr(self.method, "name", self.method)

    @property
    def controlled(self) -> bool:
        """Whether the method has step-size control; if not, it takes fixed steps only."""
        return bool(find_method(self.formulation, self.method).error_power)

    @property
    def family(self) -> str:
        """Family of the method."""
        return find_method(self.formulation, self.method).family

    def __str__(self) -> str:
        return f"{self.prefix}:{self.name}" if self.prefix else self.name

    def arguments(self) -> dict[str, Any]:
        """Return the corresponding arguments of `mbdae.solve`."""
        rest = {"project": self.project, "baumgarte": self.baumgarte}
        return {"method": self.method, "formulation": self.formulation, **rest}


def variants(methods: str | Iterable[str | Variant], formulations: str | Iterable[str] | None = None) -> list[Variant]:
    """Return variants from methods, a list or one name; methods without a formulation get each of ``formulations``.

    Raises:
        InputError: for an empty list, or as for `Variant`.
        UnknownNameError: for an unknown formulation or method.
    """
    out: list[Variant] = []
    prefixes = as_list(formulations or "index2", "formulations is a list of names")
    for m in as_list(methods, "methods is a list of names"):
        if isinstance(m, Variant):
            out.append(m)
        elif isinstance(m, Tableau):
            out += [replace(Variant.parse(f"{f}:{PLACEHOLDER}"), method=m) for f in prefixes]
        elif not isinstance(m, str):
            raise UnknownNameError("method", m, (*METHODS, *EXPLICIT, *SOLVERS))
        else:
            out += [Variant.parse(m)] if ":" in m else [Variant.parse(f"{f}:{m}") for f in prefixes]
    if not out:
        raise InputError("a comparison needs at least one method")
    return list(dict.fromkeys(out))


def default_variant(problem: Problem, **given: Any) -> Variant:
    """Return the variant that `mbdae.solve` uses with these settings; without settings, that of ``mbdae solve MODEL``.

    Raises:
        InputError, UnknownNameError: as for `mbdae.solve`.
    """
    c = complete_settings(problem, given)
    method = c["method"]
    return variant_from_settings({**c, "method": method if isinstance(method, Tableau) else method.name})


def default_variants(problem: Problem, names: Iterable[str], **given: Any) -> list[Variant]:
    """Return the default variants of a study: the default with these settings, then those of a list.

    Formulations that the problem does not support are omitted: textbook problems, stops and stiction require index 2.
    """
    all_supported = isinstance(problem, Mechanism) and not problem.switches
    rest = (v for v in variants(names) if all_supported or v.formulation == "index2")
    return list(dict.fromkeys([default_variant(problem, **given), *rest]))


def variant_from_settings(settings: dict[str, Any]) -> Variant:
    """Return the variant of a solution from its settings."""
    pair = settings.get("baumgarte")
    rest = (settings.get("formulation", "index2"), bool(settings.get("project")))
    method = method_from_settings(settings) if "tableau" in settings else settings["method"]
    return Variant(method, *rest, tuple(pair) if pair else None)


def format_tolerance(x: float) -> str:
    """Return a tolerance as text with all its digits: 1e-04, 2.5e-04."""
    return np.format_float_scientific(x, trim="-", exp_digits=2)


def run_labels(sol: Solution) -> tuple[str, str]:
    """Return the method of a run as the text of a `Variant`, without and with its step size or rtol."""
    method, settings = str(variant_from_settings(sol.settings)), sol.settings
    control = (
        f"h = {quantity(settings['step'], 's', 'g')}"
        if "step" in settings
        else f"rtol {format_tolerance(settings.get('rtol', np.nan))}"
    )
    return method, f"{method}, {control}"


def _pair(text: str, notation: str) -> tuple[float, float]:
    try:
        alpha, beta = (float(x) for x in text.split(","))
    except ValueError:
        raise InputError(f"{notation!r}: expected two numbers in 1/s, as in baumgarte=20,20:RK45") from None
    return alpha, beta
