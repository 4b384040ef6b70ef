"""Columns of a solution: coordinates, multipliers, forces in joints and closures, residuals and energies."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import InputError, UnknownNameError
from ..mechanism import Reaction, joint_reaction, reaction, reaction_names, reaction_wrenches
from ..mechanism.equations.characteristic_rate import gravity_rate
from ..mechanism.forces.coulomb_friction import CoulombFriction
from ..mechanism.signals.contacts import contact, contact_path, rolling_closures
from ..mechanism.tree.coordinate_units import component_suffixes
from ..mechanism.tree.frames import WORLD, find_joint, frame_motions, frame_names
from ..system import Array
from ..tolerances import AGREEMENT, COARSE, SOLUTION_ROUNDING
from .sampling import residuals_and_energies

if TYPE_CHECKING:
    from ..mechanism import Mechanism
    from .solution import Solution

TWO_PI = 2 * np.pi
CONTACT = ("normal", "longitudinal", "lateral", "friction")
WRENCH_UNITS, WORLD_AXES, LOCAL_AXES = {"force": "N", "torque": "N m"}, "xyz", "123"
MOTIONS = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2"}  # units of motions of frames
MOVING = COARSE  # fraction of the rate of gravity, a cheap first check: faster mechanisms are not at rest


class Residuals(NamedTuple):
    """Constraint residuals and energies at the times of a solution.

    Attributes:
        g: position residuals of all rows (m, or rad for directions), (n, ng).
        Gv: velocity residuals G v + g_t of all rows (m/s, rad/s), (n, ng).
        kinetic: kinetic energy in J, (n,).
        potential: potential energy of gravity and springs in J, (n,).
    """

    g: Array
    Gv: Array
    kinetic: Array
    potential: Array


def energy_balance(sol: "Solution", kinetic: Array, potential: Array, work: Array) -> tuple[Array, float]:
    """Return E - E_0 - W in J, (n,), and the reference energy in J, which is 0 at rest.

    Args:
        sol: the run.
        kinetic: kinetic energy at some of its times in J, (n,).
        potential: potential energy in J, (n,).
        work: work of non-conservative forces in J, (n,).
    """
    error, exchanged = energy_error(kinetic, potential, work)
    return error, 0.0 if _is_at_rest(sol, float(exchanged)) else float(exchanged)


def _is_at_rest(sol: "Solution", exchanged: float) -> bool:
    """Return whether speeds at all nodes, and the energy exchanged in J, are within the errors of the run.

    Speeds are compared with the characteristic rate, the energy with the kinetic energy at such speeds, which a slow
    motion may exceed.
    """
    mech, y = sol.mechanism, sol.nodes[1]
    fastest = np.abs(y[:, mech.nq : mech.nq + mech.nv] / mech.coordinate_scales).max(initial=0.0)
    accuracy = max(AGREEMENT, sol.settings.get("rtol", 0.0))
    if fastest > max(MOVING, accuracy) * gravity_rate(mech) > 0.0 or not fastest <= accuracy * mech.characteristic_rate:
        return False
    v = mech.characteristic_rate * mech.coordinate_scales
    return exchanged <= max(accuracy**2, SOLUTION_ROUNDING) * float(v @ mech.mass_matrix(y[-1, : mech.nq]) @ v) / 2


def energy_error(kinetic: Array, potential: Array, work: Array) -> tuple[Array, Array]:
    """Return E - E_0 - W in J, (..., n), and the energy exchanged in J, (...), at n times of a run or of several runs.

    Args: as for `energy_balance`.
    """
    work_done, total = work - work[..., :1], kinetic + potential
    max_work, max_kinetic, high, low = np.array([np.abs(work_done), kinetic, potential, -potential]).max(-1)
    return total - total[..., :1] - work_done, np.maximum(np.maximum(max_work, max_kinetic), high + low)


def require_times(sol: "Solution") -> None:
    """Check that a solution has times.

    Raises:
        InputError: if the run ended before the first of ``t_eval``.
    """
    if not len(sol.t):
        title = sol.problem.title
        raise InputError(f"the solution of {title!r} has no times: the run ended before the first of t_eval")


def residuals(sol: "Solution") -> Residuals:
    """Evaluate the closures and the energies of a mechanism's solution at its times.

    Raises:
        InputError: for a solution without times.
    """
    require_times(sol)
    with np.errstate(over="ignore", invalid="ignore"):  # overflow of a diverging run
        g, Gv, energies = residuals_and_energies(sol)
    return Residuals(g, Gv, *energies.T)


def coordinates(sol: "Solution") -> dict[str, Array]:
    """Return the columns ``q.*`` and then ``v.*`` of `mbdae.solution.signals.signals`."""
    mech = sol.mechanism
    q: dict[str, Array] = {}
    v: dict[str, Array] = {}
    for name in mech.joint_names:
        j, (q_suffixes, v_suffixes) = find_joint(mech.model, name), component_suffixes(mech, name)
        v |= {f"v.{name}{suffix}": sol.v[:, j.idx_v + k] for k, suffix in enumerate(v_suffixes)}
        if (j.nq, j.nv) == (2, 1):
            q[f"q.{name}"] = unwrapped(sol, j.idx_q, j.idx_v)
        else:
            q |= {f"q.{name}{suffix}": sol.q[:, j.idx_q + k] for k, suffix in enumerate(q_suffixes)}
    return {**q, **v}


def contact_paths(sol: "Solution") -> dict[str, Array]:
    """Return the columns ``contact.*``, the contact points of rolling bodies."""
    paths = {c.name: contact_path(sol.mechanism, c.name, sol.q) for c in rolling_closures(sol.mechanism)}
    return {f"contact.{name}.{x}": points[:, k] for name, points in paths.items() for k, x in enumerate("xyz")}


def contact_forces(sol: "Solution") -> dict[str, Array]:
    """Return the contact forces of rolling closures, and the friction coefficients required not to slip."""
    contacts = {c.name: contact(sol.mechanism, c.name, sol.t, sol.q, sol.lam) for c in rolling_closures(sol.mechanism)}
    return {f"{kind}.{name}": getattr(x, kind) for name, x in contacts.items() for kind in CONTACT}


def force_rows(mech: "Mechanism") -> dict[str, list[int]]:
    """Return closures and drivers between frames, each with its rows in m.

    The multipliers of these rows are components of a force in orthogonal directions. Closures with regularized friction
    are excluded, since friction is not one of their multipliers.
    """
    regularized = {f.closure for f in mech.forces if isinstance(f, CoulombFriction) and not f.is_exact}
    names = [c.name for c in mech.constraints if c.frames and c.name not in regularized]
    return {name: [i for i in mech.rows_of(name) if mech.row_units[i] == "m"] for name in names}


def frame_columns(sol: "Solution") -> dict[str, Array]:
    """Return the columns of positions, velocities and accelerations of frames."""
    names = moving_frames(sol.mechanism)
    out: dict[str, Array] = {}
    motions = frame_motions(sol.mechanism.model, names, sol.q, sol.v, sol.vdot)
    for kind, values in zip(MOTIONS, motions, strict=True):
        for name, x in zip(names, values, strict=True):
            out |= {f"{kind}.{name}": np.linalg.norm(x, axis=1)} if kind != "position" else {}
            out |= {f"{kind}.{name}.{axis}": x[:, k] for k, axis in enumerate(WORLD_AXES)}
    return out


def frame_units(mech: "Mechanism") -> dict[str, str]:
    """Return units of the columns of frames, in the order of `frame_columns`."""
    out: dict[str, str] = {}
    for kind, unit in MOTIONS.items():
        for name in moving_frames(mech):
            out |= {f"{kind}.{name}": unit} if kind != "position" else {}
            out |= {f"{kind}.{name}.{axis}": unit for axis in WORLD_AXES}
    return out


def moving_frames(mech: "Mechanism") -> list[str]:
    """Return names of all frames except the world."""
    return [name for name in frame_names(mech.model) if name != WORLD]


def row_names(mech: "Mechanism") -> list[str]:
    """Return names ``lam.<closure>.<row>`` of the rows of all closures, rows counted from 1."""
    return [f"lam.{c.name}.{k + 1}" for c in mech.constraints for k in range(c.m)]


def reaction_of(sol: "Solution", name: str) -> Reaction:
    """Return the reaction of a closure, or of a joint if no closure has its name, see `Solution.reaction`."""
    mech = sol.mechanism
    if name in mech.joint_names and name not in mech.row_names:
        return joint_reaction(mech, name, sol.t, sol.q, sol.v, sol.vdot, sol.lam)
    names = [c.name for c in mech.constraints]
    if name not in names:
        raise UnknownNameError("closure, driver or joint", name, [*names, *mech.joint_names])
    return reaction(mech, name, sol.t, sol.q, sol.lam, sol.v)


def reaction_units(mech: "Mechanism") -> dict[str, str]:
    """Return units of the columns of joint and closure wrenches: magnitude, world axes, local axes."""
    suffixes = ("", *(f".{axis}" for axis in (*WORLD_AXES, *LOCAL_AXES)))
    return {
        f"{kind}.{name}{suffix}": unit
        for name in reaction_names(mech)
        for kind, unit in WRENCH_UNITS.items()
        for suffix in suffixes
    }


def reaction_columns(sol: "Solution") -> dict[str, Array]:
    """Return columns of joint and closure wrenches, see `mbdae.mechanism.signals.joint_wrenches.reaction_wrenches`."""
    n, mech = len(sol.t), sol.mechanism
    world, local = (x.reshape(n, -1, 3) for x in reaction_wrenches(mech, sol.t, sol.q, sol.v, sol.vdot, sol.lam))
    columns = np.concatenate([np.linalg.norm(world, axis=2)[:, :, None], world, local], axis=2)
    return dict(zip(reaction_units(mech), columns.reshape(n, -1).T, strict=True))


def unwrapped(sol: "Solution", iq: int, iv: int) -> Array:
    """Return the angle of an unbounded revolute joint (cosine and sine in q) at the times of a solution, in rad, (n,).

    The angle is unwrapped from step to step with the mean velocity, so that fast rotations are counted correctly.
    """
    ts, ys, _ = sol.nodes
    ts, ys = np.asarray(ts), np.asarray(ys)
    angle = np.arctan2(ys[:, iq + 1], ys[:, iq])
    w = ys[:, sol.mechanism.nq + iv]
    rotations = np.diff(ts) * (w[1:] + w[:-1]) / 2
    for i, rotation in enumerate(rotations):
        angle[i + 1] = _nearest_branch(angle[i + 1], angle[i] + rotation)
    if sol.steps is None:
        return angle
    ascending = slice(None) if len(ts) < 2 or ts[-1] > ts[0] else slice(None, None, -1)
    guess = np.interp(sol.t, ts[ascending], angle[ascending])
    return _nearest_branch(np.arctan2(sol.q[:, iq + 1], sol.q[:, iq]), guess)


def _nearest_branch(angle: Array, guess: Array) -> Array:
    """Return the angle plus the multiple of 2 pi that makes it closest to a guess."""
    return angle + TWO_PI * np.round((guess - angle) / TWO_PI)
