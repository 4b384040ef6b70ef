"""Derivatives of the wrenches of closures and of forces between frames."""

import numpy as np

from ...system import Array
from ..forces.force import PairElement, WrenchPartials
from ..tree.frames import cross
from .friction import friction_wrench
from .motion_tangent import MotionTangent


def wrench_cross(a: Array, F: Array) -> Array:
    """Return the dual cross products a x* F of motions a and wrenches F, column by column, (6, m)."""
    v, w, f, n = a[:3], a[3:], F[:3], F[3:]
    return np.concatenate([cross(w, f), cross(w, n) + cross(v, f)])


def closure_wrench(motion: MotionTangent, name: str) -> tuple[Array, Array]:
    """Return the wrench of a closure on its second frame, about the world's origin, (6,), and its tangents (6, m)."""
    constraints, parameters = motion.system.constraints, motion.parameters
    pair, rows = constraints.frame_rows[name]
    pair.locate()
    Xa, Xb = motion.pair(pair)
    F, dF = np.zeros(6), np.zeros_like(Xa)
    for span, row, w in rows:
        row.wrenches(pair, w)  # writes w
        lam = motion.lam[span]
        Da, Db = (np.tensordot(lam, D, 1) for D in row.partials(pair))
        F += w.dot(lam)
        dF += Da.dot(Xa) + Db.dot(Xb) + w.dot(motion.d.lam[span])
    span, index = constraints.spans[name], [c.name for c in motion.mechanism.constraints].index(name)
    for p, changed, dp in zip(parameters.all, parameters.rows, motion.d.p, strict=True):
        if index not in p.specs:
            continue
        found = {}
        for k, perturbed in changed.perturbed.items():
            perturbed.jacobian()
            found[k] = perturbed.W[:, perturbed.spans[name]].dot(motion.lam[span])
        dF += np.outer(p.quotient(found), dp)
    if motion.system.closure_friction.regularized_interfaces(name):
        friction, change = friction_wrench(motion, name)
        F, dF = F + friction, dF + change
    return F, dF


def law_wrench(motion: MotionTangent, law: PairElement, index: int) -> tuple[Array, Array]:
    """Return the wrench of a force on its second frame, about the world's origin, (6,), and its derivatives (6, m).

    Args:
        motion: the motion, with its tangent.
        law: a law between two frames.
        index: index of the law.
    """
    law.pair.locate()
    Xa, Xb = motion.pair(law.pair)
    V, dV = motion.relative(law.pair)
    dF = np.outer(law.wrench_time_rate(motion.t) + np.zeros(6), motion.d.t)  # the rate may be the number 0
    terms = law.wrench_partials(motion.t, V)
    for term in terms:
        dF += term.Da.dot(Xa) + term.Db.dot(Xb) + term.C.dot(dV)
    for i, perturbed in motion.perturbed_laws(index):
        found = {}
        for k, other in perturbed.items():
            other.pair.locate()  # type: ignore[attr-defined]
            found[k] = _sum(other.wrench_partials(motion.t, V))  # type: ignore[attr-defined]
        dF += np.outer(motion.parameters.all[i].quotient(found), motion.d.p[i])
    return _sum(terms), dF


def _sum(terms: tuple[WrenchPartials, ...]) -> Array:
    return np.sum([term.F for term in terms], axis=0)
