"""The derivatives of columns that are read off bodies and forces, family by family, see `mbdae.solution.signals`."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from ...mechanism import Mechanism
from ...mechanism.contacts import rolling
from ...mechanism.effort_signals import effort_units
from ...mechanism.momentum import MOMENTUM
from ...mechanism.signal_derivatives import (
    MotionTangent,
    contact_derivatives,
    driver_power_derivatives,
    effort_derivatives,
    frame_motion_derivatives,
    momentum_derivatives,
    path_derivatives,
    reaction_derivatives,
)
from ...solution.columns import CONTACT, frame_units, moving_frames, reaction_units
from ...system import Array
from ...tolerances import ITERATION_ROUNDING


class DerivativeFamily(NamedTuple):
    """Columns whose derivatives are found together.

    Attributes:
        names: of the columns.
        rows: their partial derivatives, (n, m).
        rated: they depend on accelerations or multipliers.
    """

    names: Callable[[Mechanism], Mapping[str, str] | list[str]]
    rows: Callable[[MotionTangent], Array]
    rated: bool


def _contact_names(mech: Mechanism) -> list[str]:
    return [f"{kind}.{c.name}" for c in rolling(mech) for kind in CONTACT]


def _flat(rows: Array) -> Array:
    return rows.reshape(-1, rows.shape[-1])


def _loads(motion: MotionTangent) -> Array:
    values, derivatives = reaction_derivatives(motion)
    world, own = derivatives
    size = along(values[0], world)
    return _flat(np.concatenate([size[:, :, None], world, own], axis=2))


def _speeds(motion: MotionTangent) -> Array:
    """Positions, and velocities with their magnitudes before them."""
    values, derivatives = frame_motion_derivatives(motion, moving_frames(motion.mechanism))
    return np.concatenate([_flat(derivatives[0]), _with_size(values[1], derivatives[1])])


def _accelerations(motion: MotionTangent) -> Array:
    values, derivatives = frame_motion_derivatives(motion, moving_frames(motion.mechanism))
    return _with_size(values[2], derivatives[2])


def _with_size(x: Array, derivatives: Array) -> Array:
    return _flat(np.concatenate([along(x, derivatives)[:, None], derivatives], axis=1))


def along(x: Array, derivatives: Array) -> Array:
    """Derivatives of the magnitudes of n vectors x (n, ..., 3), from those of their parts (n, ..., 3, m).

    They are 0 where a vector vanishes beside the largest of the n: its remainder has a direction by rounding only.
    """
    size = np.linalg.norm(x, axis=-1, keepdims=True)
    there = size > ITERATION_ROUNDING * size.max(axis=0, initial=0.0)
    return np.einsum("...i,...im->...m", np.divide(x, size, out=np.zeros_like(x), where=there), derivatives)


def _of_frames(mech: Mechanism, rated: bool) -> list[str]:
    return [name for name in frame_units(mech) if name.startswith("acceleration.") == rated]


FAMILIES = (
    DerivativeFamily(lambda mech: [f"contact.{c.name}.{x}" for c in rolling(mech) for x in "xyz"],
           lambda motion: _flat(path_derivatives(motion)), False),
    DerivativeFamily(_contact_names, lambda motion: _flat(contact_derivatives(motion)), True),
    DerivativeFamily(reaction_units, _loads, True),
    DerivativeFamily(lambda mech: [f"power.{d.name}" for d in mech.drivers], driver_power_derivatives, True),
    DerivativeFamily(effort_units, effort_derivatives, False),
    DerivativeFamily(lambda mech: _of_frames(mech, False), _speeds, False),
    DerivativeFamily(lambda mech: _of_frames(mech, True), _accelerations, True),
    DerivativeFamily(lambda mech: MOMENTUM, momentum_derivatives, False),
)  # fmt: skip


def find_column(mech: Mechanism, name: str) -> tuple[DerivativeFamily, int] | None:
    """The family of a column, and its number there; None where it has no derivatives."""
    for family in FAMILIES:
        if name in (names := list(family.names(mech))):
            return family, names.index(name)
    return None
