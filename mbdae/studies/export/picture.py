"""Picture of an exported mechanism, in the best view of its motion."""

from ...errors import MbdaeError
from ...integrate.solve import solve
from ...mechanism import Mechanism
from ..figures import png
from ..replay.figure import posture

STEPS = 300  # maximum number of steps of the motion that determines the view


def picture(mech: Mechanism) -> bytes:
    """Return a picture of a mechanism at its start, as PNG; empty if it cannot move from its start."""
    try:
        return png(posture(solve(mech, (0.0, mech.duration), max_steps=STEPS)))
    except MbdaeError:
        return b""
