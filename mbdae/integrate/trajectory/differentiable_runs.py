"""Check whether a run can be recomputed and differentiated."""

from math import inf

from ...errors import InputError
from ...mechanism import Mechanism
from ...mechanism.forces.fmu import FMU
from ...methods import Tableau, method_from_settings
from ...methods.radau import RadauIIA
from ...solution.solution import Solution
from ..steppers.solvers import SOLVERS

DIFFERENTIABLE = Tableau, RadauIIA


def has_jumps(sol: Solution) -> bool:
    """Return whether a run has impacts, events at which the state jumps, or changes of mode."""
    return bool(sol.impacts or sol.resets or len(sol.modes) > 1)


def require_differentiable(sol: Solution) -> Mechanism:
    """Return the mechanism of a run that can be recomputed and differentiated.

    Raises:
        InputError: for an unsupported run; the message names the feature.
    """
    mech, s = sol.mechanism, sol.settings
    form = s.get("formulation")
    is_mbdae_method = form in ("index2", "ggl") and s["method"] not in SOLVERS
    if not is_mbdae_method or not isinstance(method_from_settings(s), DIFFERENTIABLE):
        supported = "half-explicit methods and Radau IIA in formulations 'index2' and 'ggl'"
        raise InputError(f"derivatives of runs are those of {supported}, got {s['method']!r} in {form!r}")
    for force in mech.forces:
        if isinstance(force, FMU):
            raise InputError(f"force {force.name!r} is an FMU: runs with it are not differentiable")
    if not sol.ended:
        raise InputError(f"the run stopped before its end ({sol.status}): {sol.message}")
    if sol.singular:
        raise InputError(f"the run passes a singular configuration at t = {sol.singular[0].t:.9g} s: no derivative")
    _require_separate_impacts(sol)
    return mech


def _require_separate_impacts(sol: Solution) -> None:
    """Check that no contact came to rest by an accumulation of bounces.

    Raises:
        InputError: names the contact and the time.
    """
    last = dict[str, float]()
    switches = {s.name: s for s in sol.mechanism.switches}
    for impact in sol.impacts:
        for name in impact.where:
            switch = switches.get(name)
            if switch and switch.restitution and impact.t - last.get(name, -inf) < switch.rest:
                when = f"at t = {impact.t:.9g} s"
                raise InputError(f"{name!r} comes to rest by an accumulation of bounces {when}: no derivative")
            last[name] = impact.t
