"""Verification of the claimed orders of a method, by its family."""

from ..alpha import GeneralizedAlpha
from ..runge_kutta import RungeKutta
from ..variational import Composition
from .alpha import AlphaReport, check_alpha
from .composition import CompositionReport, check_composition
from .condition_report import ConditionReport
from .conditions import check_conditions

Report = ConditionReport | CompositionReport | AlphaReport


def check_claims(method: RungeKutta | Composition | GeneralizedAlpha) -> Report:
    """Check the claimed orders of a method, as `check_conditions`, `check_composition` or `check_alpha` does."""
    if isinstance(method, GeneralizedAlpha):
        return check_alpha(method)
    return check_composition(method) if isinstance(method, Composition) else check_conditions(method)
