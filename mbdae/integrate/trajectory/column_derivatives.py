"""Derivatives of signals of bodies and forces, in groups; see `mbdae.solution.signals`."""

from collections.abc import Callable, Mapping
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from ...mechanism import Mechanism
from ...mechanism.signal_derivatives import (
    MotionTangent,
    contact_derivatives,
    deformation_derivatives,
    driver_power_derivatives,
    effort_derivatives,
    frame_motion_derivatives,
    friction_power_derivatives,
    gap_derivatives,
    momentum_derivatives,
    path_derivatives,
    reaction_derivatives,
    shaking_derivatives,
    unilateral_rows,
)
from ...mechanism.signals.contacts import rolling_closures
from ...mechanism.signals.deformation import deformation_units
from ...mechanism.signals.effort_signals import brake_rows, effort_units
from ...mechanism.signals.momentum import MOMENTUM, SHAKING
from ...solution.columns import CONTACT, frame_units, moving_frames, reaction_units
from ...system import Array
from ...tolerances import ITERATION_ROUNDING


class DerivativeGroup(NamedTuple):
    """Columns whose derivatives are computed together.

    Attributes:
        names: names of the columns.
        rows: their partial derivatives, (n, m).
        needs_rates: whether they depend on accelerations or multipliers.
    """

    names: Callable[[Mechanism], Mapping[str, str] | list[str]]
    rows: Callable[[MotionTangent], Array]
    needs_rates: bool


def _contact_names(mech: Mechanism) -> list[str]:
    return [f"{kind}.{c.name}" for c in rolling_closures(mech) for kind in CONTACT]


def _flattened(rows: Array) -> Array:
    return rows.reshape(-1, rows.shape[-1])


def _reactions(motion: MotionTangent) -> Array:
    values, derivatives = reaction_derivatives(motion)
    world, local = derivatives
    size = magnitude_derivatives(values[0], world)
    return _flattened(np.concatenate([size[:, :, None], world, local], axis=2))


def _positions_and_velocities(motion: MotionTangent) -> Array:
    """Return derivatives of positions, then of velocities, whose magnitudes come first."""
    values, derivatives = frame_motion_derivatives(motion, moving_frames(motion.mechanism))
    return np.concatenate([_flattened(derivatives[0]), _with_magnitude(values[1], derivatives[1])])


def _accelerations(motion: MotionTangent) -> Array:
    values, derivatives = frame_motion_derivatives(motion, moving_frames(motion.mechanism))
    return _with_magnitude(values[2], derivatives[2])


def _with_magnitude(x: Array, derivatives: Array) -> Array:
    return _flattened(np.concatenate([magnitude_derivatives(x, derivatives)[:, None], derivatives], axis=1))


def magnitude_derivatives(x: Array, derivatives: Array) -> Array:
    """Return derivatives of the magnitudes of n vectors x (n, ..., 3), from those of their components (n, ..., 3, m).

    They are 0 for vectors that vanish relative to the largest one, since their direction is rounding.
    """
    size = np.linalg.norm(x, axis=-1, keepdims=True)
    nonzero = size > ITERATION_ROUNDING * size.max(axis=0, initial=0.0)
    return np.einsum("...i,...im->...m", np.divide(x, size, out=np.zeros_like(x), where=nonzero), derivatives)


def _frame_columns(mech: Mechanism, accelerations: bool) -> list[str]:
    return [name for name in frame_units(mech) if name.startswith("acceleration.") == accelerations]


DERIVATIVE_GROUPS = (
    DerivativeGroup(lambda mech: [f"contact.{c.name}.{x}" for c in rolling_closures(mech) for x in "xyz"],
           lambda motion: _flattened(path_derivatives(motion)), False),
    DerivativeGroup(_contact_names, lambda motion: _flattened(contact_derivatives(motion)), True),
    DerivativeGroup(reaction_units, _reactions, True),
    DerivativeGroup(lambda mech: list(unilateral_rows(mech)), gap_derivatives, False),
    DerivativeGroup(lambda mech: [f"power.{d.name}" for d in mech.drivers], driver_power_derivatives, True),
    DerivativeGroup(lambda mech: [f"power.{name}" for name in brake_rows(mech)], friction_power_derivatives, True),
    DerivativeGroup(effort_units, effort_derivatives, False),
    DerivativeGroup(lambda mech: _frame_columns(mech, False), _positions_and_velocities, False),
    DerivativeGroup(lambda mech: _frame_columns(mech, True), _accelerations, True),
    DerivativeGroup(lambda mech: MOMENTUM, momentum_derivatives, False),
    DerivativeGroup(lambda mech: deformation_units(mech.model), deformation_derivatives, False),
    DerivativeGroup(lambda mech: SHAKING, lambda motion: _with_magnitude(*shaking_derivatives(motion)), True),
)  # fmt: skip


Derivatives = dict[str, tuple[DerivativeGroup, int]]
_DERIVATIVES: WeakKeyDictionary[Mechanism, Derivatives] = WeakKeyDictionary()  # mechanisms are immutable


def find_column(mech: Mechanism, name: str) -> tuple[DerivativeGroup, int] | None:
    """Return the group of a column, and its index in the group; None if it has no derivatives."""
    if mech not in _DERIVATIVES:  # a name belongs to the first group that contains it
        columns = [(name, (group, i)) for group in DERIVATIVE_GROUPS for i, name in enumerate(group.names(mech))]
        _DERIVATIVES[mech] = dict(reversed(columns))
    return _DERIVATIVES[mech].get(name)
