"""A parameter as a direction in the coefficients of flexible bodies: inertia of the modes, stiffness and damping.

Inertia forces are linear in the coefficients C, H0, Mq, Hj, I1, I2 and in the second-order coefficients of a
body; their derivative is the force of a body with the rates of these coefficients. Shapes of modes at nodes, on which
closures and forces depend, must not change.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from ...system import Array
from ..flexible.modal_body import SECOND_ORDER, ModalBody
from ..tree.tree_terms import bound_bodies, flexible_bodies

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System
    from .parameter_direction import Parameter

INERTIA = "C", "H0", "Mq", "Hj", "I1", "I2", *SECOND_ORDER


def modal_rates(p: "Parameter") -> dict[int, ModalBody]:
    """Return the bodies by index whose modal inertia a parameter changes, with rates in place of coefficients.

    Raises:
        InputError: if the parameter changes shapes of modes, or the frames of a mechanism with flexible bodies.
    """
    bodies = flexible_bodies(p.mech.model)
    if bodies and (p.placements or p.frames):
        text = f"parameter {p.name!r} moves frames of a mechanism with the flexible body {bodies[0].name!r}"
        raise InputError(f"{text}: no derivative; use a parameter of material, section, inertia, gravity or a force")
    out = {}
    for i, body in enumerate(bodies):
        shapes = _shapes(body.modal)
        if any(not np.array_equal(shapes, _shapes(_modal(m, i))) for m in p.trials):
            text = f"parameter {p.name!r} changes the shapes of modes of {body.name!r}: no derivative"
            raise InputError(f"{text}; those of young, density, damping, and of a section without shear exist")
        rates: dict[str, Any] = {x: p.rate(lambda m, i=i, x=x: _modal(m, i).array(x)) for x in INERTIA}  # type: ignore[misc]
        if any(x.any() for x in rates.values()):
            out[i] = replace(body.modal, **rates, nodes={})
    return out


def changes_elasticity(p: "Parameter") -> bool:
    """Return whether a parameter changes stiffness or damping of a flexible body."""
    nominal = [(body.modal.stiffness, body.modal.damping) for body in flexible_bodies(p.mech.model)]
    return any(
        not np.array_equal(pair, (_modal(m, i).stiffness, _modal(m, i).damping))
        for i, pair in enumerate(nominal)
        for m in p.trials
    )


def modal_partials(p: "Parameter", system: "Index2System", q: Array, v: Array, vdot: Array) -> Array:
    """Return the derivative of M v' + nle by flexible bodies and gravity, (nv,); motions are current."""
    out, bodies = np.zeros(system.nv), bound_bodies(system.workspace)
    for i, modal in p.modal.items():
        bodies[i].add_force(modal, system.workspace, q, v, vdot, system.model.gravity.linear, out)
    for body in bodies if p.gravity.any() else ():
        body.add_weight(system.workspace, q, p.gravity, out)
    return out


def _modal(mech: object, i: int) -> ModalBody:
    return flexible_bodies(mech.model)[i].modal  # type: ignore[attr-defined]


def _shapes(modal: ModalBody) -> Array:
    arrays = [x for node in modal.nodes.values() for x in (node.r, node.Phi, node.Psi, node.Phi2) if x is not None]
    return np.concatenate([np.ravel(x) for x in arrays]) if arrays else np.empty(0)
