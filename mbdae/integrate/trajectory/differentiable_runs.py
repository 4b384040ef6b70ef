"""Check whether a run can be recomputed and differentiated."""

from ...errors import InputError
from ...mechanism import Mechanism
from ...methods import Tableau, method_from_settings
from ...methods.radau import RadauIIA
from ...solution.solution import Solution
from ..steppers.solvers import SOLVERS

DIFFERENTIABLE = Tableau, RadauIIA


def require_differentiable(sol: Solution) -> Mechanism:
    """Return the mechanism of a run that can be recomputed and differentiated.

    Raises:
        InputError: for other runs; the message names the unsupported feature.
    """
    mech, s = sol.mechanism, sol.settings
    form = s.get("formulation")
    own = form in ("index2", "ggl") and s["method"] not in SOLVERS
    if not own or not isinstance(method_from_settings(s), DIFFERENTIABLE):
        known = "half-explicit methods and Radau IIA in formulations 'index2' and 'ggl'"
        raise InputError(f"derivatives of runs are those of {known}, got {s['method']!r} in {form!r}")
    if not sol.ended:
        raise InputError(f"the run stopped before its end ({sol.status}): {sol.message}")
    if len(sol.modes) > 1 or sol.impacts:
        where = float(sol.nodes[0][sol.modes[1][0]]) if len(sol.modes) > 1 else sol.impacts[0].t
        raise InputError(
            f"{_first_switch(sol)!r} switches at t = {where:.9g} s: no derivative of runs in which rows do"
        )
    if sol.singular:
        raise InputError(f"the run passes a singular configuration at t = {sol.singular[0].t:.9g} s: no derivative")
    return mech


def _first_switch(sol: Solution) -> str:
    """Return the name of the switch that changes first."""
    if sol.impacts:
        return sol.impacts[0].where[0]
    changes = zip(sol.mechanism.switches, sol.modes[0][1], sol.modes[1][1], strict=True)
    return next((s.name for s, a, b in changes if a != b), sol.mechanism.switches[0].name)
