"""Characteristic rate of a mechanism, which makes speeds comparable with zero in any unit of time."""

from typing import TYPE_CHECKING

import numpy as np

from ...errors import MbdaeError

if TYPE_CHECKING:
    from ..mechanism import Mechanism


def characteristic_rate(mech: "Mechanism") -> float:
    """Return w > 0 in 1/s: speeds are compared with w, and with w l where they are in m/s.

    w is the largest of |v| and |v'|^1/2 at the start, in rad and characteristic lengths l, and (|gravity| / l)^1/2; 1
    if all are zero.
    """
    scales = mech.coordinate_scales
    squares = [gravity_rate(mech) ** 2]
    try:
        # without assembly `start` checks the values with this rate
        q, v = mech.start if mech.start_values.assemble else mech.unassembled_start
        squares += ((v / scales) ** 2).tolist()
        y = np.concatenate([q, v, list(mech.states.values()), [0.0]])
        with mech.workspaces.borrowed() as system:
            squares += np.abs(system.derivative(0.0, y)[0][mech.nv : 2 * mech.nv] / scales).tolist()
    except MbdaeError:  # the start violates closures or is singular
        pass
    return float(np.sqrt(max(squares, default=0.0))) or 1.0


def gravity_rate(mech: "Mechanism") -> float:
    """Return (|gravity| / l)^1/2 in 1/s with the characteristic length l: a lower bound that costs no evaluation."""
    return float(np.sqrt(np.linalg.norm(mech.gravity) / mech.characteristic_length))
