"""The source of M, nle and J in runs of the compiled core."""

from contextlib import suppress

from ... import backend
from ...errors import NotCompiled
from ...mechanism import Mechanism
from ...mechanism.formulations.compiled_systems import COMPILED


def inertia_source(mech: Mechanism) -> str:
    """Return the core's sweep through the tree, planar where bodies move in parallel planes; empty without the core.

    Pinocchio serves where the core does not know a kind of joint, or a feature.
    """
    if (native := backend.load()) is None:
        return ""
    with suppress(NotCompiled):
        if native.sweeps(mech.model):
            planar = COMPILED["index2"](mech, native=native).core.planar
            return f"the core's {'planar ' if planar else ''}sweep through the tree"
    return "Pinocchio"
