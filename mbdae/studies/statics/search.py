"""Search for an equilibrium in one mode."""

import numpy as np

from ...errors import EquilibriumError, StepError
from ...mechanism.equilibrium.equilibrium_equations import ForceBalance, Statics
from ...mechanism.equilibrium.linearization import require_steady
from ...system import Array
from .trust_region import TrustRegion


def find_equilibrium(statics: Statics, q: Array, find: str) -> tuple[ForceBalance, float, int]:
    """Search from a configuration; return the balance, its residual, and the number of trial steps.

    Raises:
        EquilibriumError: if no equilibrium is found.
        InputError: for speeds that are not steady, or a force between points that coincide.
    """
    mech = statics.mech
    try:
        search = TrustRegion(statics, statics.point(q, np.array(list(mech.states.values()))))
        statics.system.laws.require_directions()
        found = search.run(find)
    except StepError as e:
        raise EquilibriumError(f"no equilibrium: {e}", q.tolist(), np.inf, "") from e
    best = search.best
    if not found:
        unbalanced = np.abs(best.free.Z @ best.rho) / statics.sizes.l
        worst = mech.coordinate_joint(int(unbalanced.argmax()))
        where = f"{search.residual:.2e} of the largest force is unbalanced, most at joint {worst!r}"
        text = f"no {'stable ' * (find == 'stable')}equilibrium found in {search.iterations} iterations: {where}"
        raise EquilibriumError(text, best.q.tolist(), search.residual, worst)
    if statics.v.any():
        require_steady(statics, best)
    return best, search.residual, search.iterations
