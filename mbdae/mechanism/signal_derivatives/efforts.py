"""Derivatives of force outputs: torques and forces, powers, deflections."""

import numpy as np

from ...system import Array
from ..forces.bushing import BushingElement
from ..forces.elements import ForceElements
from ..forces.force import ForceElement, PairElement
from ..signals.effort_signals import brake_rows, named_laws
from ..tree.frames import point_velocities, unit_gap
from ..tree.manifold import inverse_jacobian, skew
from .motion_tangent import MotionTangent
from .wrenches import law_wrench


def effort_derivatives(motion: MotionTangent) -> Array:
    """Return the derivatives of the columns of `mbdae.mechanism.signals.effort_signals.efforts`, (n, m)."""
    bound = [law for law, _ in motion.system.laws.bound]
    out: list[Array] = []
    for law in named_laws(motion.mechanism, motion.system.laws).values():
        index = next(i for i, known in enumerate(bound) if known is law)
        out += _frame_force(motion, law, index) if isinstance(law, PairElement) else _joint_force(motion, law, index)
        out += _deflections(motion, law, index)
    return np.array(out).reshape(-1, len(motion.d.t))


def driver_power_derivatives(motion: MotionTangent) -> Array:
    """Return the derivatives of the columns of `mbdae.mechanism.signals.effort_signals.driver_powers`, (n, m)."""
    mech, constraints, parameters = motion.mechanism, motion.system.constraints, motion.parameters
    _, rates, accelerations = constraints.motion(motion.t)
    names, out = [c.name for c in mech.constraints], []
    for driver in mech.drivers:
        i = mech.rows_of(driver.name).start
        lam, row = motion.lam[i], rates[i] * motion.d.lam[i] + motion.lam[i] * accelerations[i] * motion.d.t
        for p, changed, dp in zip(parameters.all, parameters.rows, motion.d.p, strict=True):
            if names.index(driver.name) in p.specs:
                perturbed = {k: c.motion(motion.t)[1][c.spans[driver.name]] for k, c in changed.perturbed.items()}
                row = row + lam * p.quotient(perturbed)[0] * dp
        out.append(row)
    return np.array(out).reshape(-1, len(motion.d.t))


def friction_power_derivatives(motion: MotionTangent) -> Array:
    """Return the derivatives of the columns of `mbdae.mechanism.signals.effort_signals.friction_powers`, (n, m)."""
    rows, d = brake_rows(motion.mechanism).values(), motion.d
    return np.array([motion.v[i] * d.lam[row] + motion.lam[row] * d.v[i] for row, i in rows])


def _joint_force(motion: MotionTangent, law: ForceElement, index: int) -> list[Array]:
    """Return the derivatives of a force along coordinates, and of its power."""
    t, q, v, d, nv = motion.t, motion.q, motion.v, motion.d, len(motion.v)
    span = motion.system.laws.bound[index][1]
    element, s = ForceElements([law], motion.model), motion.s[span]
    tau, _ = element.generalized_force(t, q, v, s)
    by_state = element.partials(t, q, v, s)[:nv]
    dtau = by_state @ np.concatenate([d.q, d.v, d.s[span]]) + np.outer(element.time_partials(t, q, v, s)[:nv], d.t)
    for i, laws in motion.perturbed_laws(index):
        found = {k: ForceElements([other], motion.model).generalized_force(t, q, v, s)[0] for k, other in laws.items()}
        dtau += np.outer(motion.parameters.all[i].quotient(found), d.p[i])
    return [*dtau[law.acting_components(nv)], v @ dtau + tau @ d.v]


def _frame_force(motion: MotionTangent, law: PairElement, index: int) -> list[Array]:
    """Return the derivatives of a force between two frames, and of its power."""
    F, dF = law_wrench(motion, law, index)
    V, dV = motion.relative(law.pair)
    power = V @ dF + F @ dV
    if law.tension:
        return [-unit_gap(law.pair)[1] @ dF[:3], power]
    p, dp = law.pair.pb, point_velocities(motion.pair(law.pair)[1], law.pair.pb)
    lever = np.cross(dp.T, F[:3]) + np.cross(p, dF[:3].T)
    out = []
    for value, change in ((F[:3], dF[:3]), (F[3:] - np.cross(p, F[:3]), dF[3:] - lever.T)):
        out += [value @ change / (np.linalg.norm(value) or 1.0), *change]
    return [*out, power]


def _deflections(motion: MotionTangent, law: ForceElement, index: int) -> list[Array]:
    """Return the derivatives of the deflections of the springs of a force."""
    if not law.deflections:
        return []
    if isinstance(law, PairElement):
        law.pair.locate()
        Xa, Xb = motion.pair(law.pair)
        Ra, pa, pb = law.pair.Ra, law.pair.pa, law.pair.pb
        if isinstance(law, BushingElement):
            theta = law.relative_pose()[1]
            J_inv = np.array([inverse_jacobian(-skew(theta), e) for e in np.eye(3)]).T  # J_l(theta)^-1
            velocity = point_velocities(Xb, pb) - point_velocities(Xa, pa) - np.cross(Xa[3:].T, pb - pa).T
            out = np.concatenate([Ra.T @ velocity, J_inv @ (Ra.T @ (Xb - Xa)[3:])])
        else:
            out = (unit_gap(law.pair)[1] @ (point_velocities(Xb, pb) - point_velocities(Xa, pa)))[None]
    else:
        out = motion.d.q[[i for i, _ in law.deflections]]
    for i, laws in motion.perturbed_laws(index):
        found = {k: other.deflection(motion.q) for k, other in laws.items()}
        out = out + np.outer(motion.parameters.all[i].quotient(found), motion.d.p[i])
    return list(out)
