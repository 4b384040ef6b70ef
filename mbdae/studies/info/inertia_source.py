"""Source of mass matrix, nonlinear effects and joint Jacobians in runs of the compiled core."""

from contextlib import suppress

from ... import backend
from ...errors import NotCompiled
from ...mechanism import Mechanism
from ...mechanism.formulations.compiled_systems import COMPILED


def inertia_source(mech: Mechanism) -> str:
    """Describe the source: the core's tree sweep, planar if all bodies move in parallel planes; "" without the core.

    Pinocchio is the source if the core does not support a kind of joint or another feature.
    """
    if (native := backend.load()) is None:
        return ""
    with suppress(NotCompiled):
        if native.sweeps(mech.model):
            planar = COMPILED["index2"](mech, native=native).core.planar
            return f"the core's {'planar ' if planar else ''}sweep through the tree"
    return "Pinocchio"
