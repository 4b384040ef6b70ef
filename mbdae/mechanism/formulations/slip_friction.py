"""Friction of slipping joints and sliding contacts, as multipliers of their inactive rows.

A slipping joint has lam = -kinetic sign(v), a sliding contact lam = -mu |F| d along its no-slip rows.
"""

from typing import TYPE_CHECKING

import numpy as np

from ...system import Array

if TYPE_CHECKING:
    from .index2 import Index2System


def has_slip_friction(s: "Index2System") -> bool:
    """Return whether inactive rows have friction in the mode."""
    return s.closure_friction.can_stick or bool(_joint_friction(s).any())


def with_slip_friction(s: "Index2System", q: Array, v: Array, lam: Array) -> Array:
    """Return the multipliers of all rows (ng,), with friction in inactive rows."""
    out = lam + _joint_friction(s)
    if s.closure_friction.can_stick:
        s.jacobian(q)
        out = s.closure_friction.with_sliding_friction(v, out)
    return out


def _joint_friction(s: "Index2System") -> Array:
    """Return the friction of slipping joints, (ng,)."""
    out = np.zeros(s.ng)
    for switch, state in zip(s.mechanism.switches, s.mode, strict=True):
        if friction := switch.slip_friction(state):
            out[switch.row] = friction
    return out
