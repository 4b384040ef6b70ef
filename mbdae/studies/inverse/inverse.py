"""Inverse dynamics of closed loops: actuator efforts and joint reactions for a motion."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...errors import InputError
from ...mechanism import Mechanism, ModelSource
from ...mechanism.closures.brake import Brake
from ...mechanism.closures.independent_rows import minimum_norm
from ...mechanism.hybrid.switches import Mode
from ...mechanism.signals.joint_wrenches import joint_wrenches
from ...mechanism.tree.frames import find_joint
from ...solution.problem import mechanism_of
from ...system import Array
from ...tolerances import HALF_DIGITS, NEGLIGIBLE, RANK
from ..kinematics.result import Kinematics
from ..kinematics.violations import Violation, unilateral_violations
from .actuators import Actuators, actuators_of, effort_weights
from .prescribed import Prescribed, prescribed, read_motion
from .result import InverseDynamics

__all__ = ["inverse_dynamics"]


def inverse_dynamics(
    mech: Mechanism | ModelSource,
    motion: Any,
    actuators: str | Sequence[str] | None = None,
    *,
    speed: float | None = None,
    weights: Mapping[str, float] | None = None,
) -> InverseDynamics:
    """Return the actuator efforts for a motion, and the reactions in all joints.

        b = M v' - f,   Z^T S^T tau = Z^T b with |W^1/2 tau| least,   then G^T lam = b - S^T tau with |lam| least

    with an orthonormal basis Z of the null space of the closures' G: efforts and multipliers are not mixed. Weight,
    springs, dampers and all other forces are included, except for motors and controllers of the actuated joints;
    drivers count as motions, not as forces. Along a run, the rows that are active in its modes transmit forces: stops,
    ropes, contacts, locked clutches, sticking joints. Along any other motion they do not, except clutches engaged on
    command and closures within their active range; exact friction opposes the velocity, and violated unilateral
    constraints are reported. Flexible bodies whose modes a curve or a table does not move are rigid: the
    reactions of their modes do no work.

    Args:
        mech: the mechanism, or an argument of `mbdae.load`.
        motion: a run (`mbdae.Solution`, or the path of its .npz); a curve of `mbdae.kinematics`, with ``speed``; a
            table of columns ``t`` and joints of one coordinate, or the path of its .csv or .parquet, interpolated by
            splines of degree 5, from which the closures determine the other joints; or arrays (t, q, v, a).
        actuators: a joint, driver, motor or controller; several times for several. When left out, the input of the
            curve, the mechanism's drivers, or its joints with motors and controllers.
        speed: constant speed of the input in rad/s or m/s.
        weights: actuator=weight, weights of the squared efforts if there are more actuators than degrees of freedom;
            1 when left out.

    Raises:
        UnknownNameError: for an unknown name.
        InputError: for a motion that violates the closures, or actuators that cannot produce it.

    Example:
        >>> curve = kinematics(mech, "crank")                              # doctest: +SKIP
        >>> print(inverse_dynamics(mech, curve, speed=10.0))              # doctest: +SKIP
    """
    mech = mechanism_of(mech, "inverse_dynamics")
    motion = read_motion(mech, motion)
    chosen = actuators_of(mech, actuators, motion.drive if isinstance(motion, Kinematics) else "")
    weight = effort_weights(chosen.names, weights)
    desired = prescribed(mech, motion, speed)
    n, m, undriven = len(desired.t), len(chosen.names), chosen.undriven
    system = chosen.mechanism.system()
    system.closure_friction.reject("inverse dynamics")
    free = _free_coordinates(chosen, desired)
    s, modes, bases = _states(chosen.mechanism, desired.states, n), _modes(chosen.mechanism, desired), []
    for q, mode in zip(desired.q, modes, strict=True):
        system.enter(mode)
        bases.append(_basis(system.jacobian(q)[undriven], free))
    regular_rank: dict[Mode, int] = {}
    for mode, (r, _) in zip(modes, bases, strict=True):
        regular_rank[mode] = max(r, regular_rank.get(mode, 0))
    efforts, speeds = np.full((n, m), np.nan), np.full((n, m), np.nan)
    lam, joints = np.full((n, len(undriven)), np.nan), np.full((n, mech.model.njoints - 1, 6), np.nan)
    for i, (t, q, v, vdot) in enumerate(zip(*desired[:4], strict=True)):
        r, Z = bases[i]
        if r < regular_rank[modes[i]]:
            continue  # singular pose: efforts are undetermined
        system.enter(modes[i])
        U, G = system.inertia(t, q), system.jacobian()
        b = U.T @ (U @ vdot) - system.force(t, q, v, s[i])[0]
        S = chosen.rows_at(G)
        efforts[i] = _weighted_minimum_norm(Z.T @ S.T, Z.T @ b, weight)
        _require_balance(chosen, Z, S, b, efforts[i], t)
        lam[i] = minimum_norm(G[np.ix_(undriven, free)], r, (b - S.T @ efforts[i])[free]) if r else 0.0
        speeds[i] = S @ v
        all_lam = np.zeros(system.ng)
        all_lam[undriven] = lam[i]
        for row, effort in zip(chosen.driver_rows, efforts[i], strict=True):
            if row >= 0:
                all_lam[row] = effort
        joints[i] = joint_wrenches(system, t, q, v, vdot, all_lam)
    if not np.isfinite(efforts).any():
        raise InputError("the closures lose rank in all poses of the motion: no effort is determined")
    return InverseDynamics(
        mech, desired.t, desired.q, desired.v, desired.vdot, tuple(chosen.names), tuple(chosen.units), efforts, speeds,
        lam, joints, desired.over[0], desired.over[1], desired.impacts, _violated(mech, desired),
        _static_friction(mech, desired), chosen.replaced,
    )  # fmt: skip


def _modes(mech: Mechanism, desired: Prescribed) -> list[Mode]:
    """Return the mode at each time: that of a run, or of a prescribed motion without active unilateral rows.

    Dry friction opposes a prescribed motion.
    """
    found = [
        desired.modes[switch.name].tolist()
        if switch.name in desired.modes
        else [switch.prescribed(*point) for point in zip(desired.t, desired.q, desired.v, strict=True)]
        for switch in mech.switches
    ]
    return [tuple(states) for states in zip(*found, strict=True)] if found else [()] * len(desired.t)


def _violated(mech: Mechanism, desired: Prescribed) -> tuple[Violation, ...]:
    """Return the unilateral constraints that a prescribed motion violates; none for a run."""
    if desired.modes or not (np.diff(desired.t) > 0).all():
        return ()
    return unilateral_violations(mech, desired.t, desired.q, desired.v, desired.over[0])


def _static_friction(mech: Mechanism, desired: Prescribed) -> dict[str, float]:
    """Return the static friction of joints that a prescribed motion keeps at rest over an interval."""
    brakes = [] if desired.modes else [c for c in mech.constraints if isinstance(c, Brake)]
    out = {}
    for brake in brakes:
        at_rest = desired.v[:, find_joint(mech.model, brake.joint).idx_v] == 0
        if at_rest.all() or (at_rest[1:] & at_rest[:-1]).any():
            out[brake.joint] = brake.static
    return out


def _states(mech: Mechanism, known: Mapping[str, Array], n: int) -> Array:
    """Return the states of the remaining forces along the motion, (n, ns); start values if they are unknown."""
    return np.array([known.get(name, np.full(n, start)) for name, start in mech.states.items()]).T.reshape(n, -1)


def _free_coordinates(chosen: Actuators, desired: Prescribed) -> Array:
    """Return the indices of all coordinates except modes that the motion locks and no actuator moves, (n,)."""
    model = chosen.mechanism.model
    locked = [find_joint(model, name).idx_v for name in desired.rigid]
    return np.setdiff1d(np.arange(model.nv), [i for i in locked if not chosen.joint_rows[:, i].any()])


def _basis(G: Array, free: Array) -> tuple[int, Array]:
    """Return the rank r of columns ``free`` (n,) of G, and an orthonormal basis Z (nv, n - r) of their null space."""
    nv = G.shape[1]
    if not len(G):
        return 0, np.eye(nv)[:, free]
    _, sigmas, right = np.linalg.svd(G[:, free])
    r = int(np.count_nonzero(sigmas > RANK * sigmas[0]))
    Z = np.zeros((nv, len(free) - r))
    Z[free] = right[r:].T
    return r, Z


def _weighted_minimum_norm(A: Array, b: Array, weight: Array) -> Array:
    """Return the x with A x = b that minimizes the sum of weight x^2."""
    root = np.sqrt(weight)
    return np.linalg.lstsq(A / root, b, rcond=RANK)[0] / root


def _require_balance(chosen: Actuators, Z: Array, S: Array, b: Array, effort: Array, t: float) -> None:
    residual = Z.T @ (b - S.T @ effort)
    if np.abs(residual).max(initial=0.0) <= HALF_DIGITS * max(np.abs(b).max(), NEGLIGIBLE):
        return
    missing = Z @ residual
    joint = chosen.mechanism.coordinate_joint(int(np.abs(missing).argmax()))
    raise InputError(
        f"{', '.join(chosen.names)} cannot produce the motion at t = {t:.6g}: {np.abs(missing).max():.3g} N m or N "
        f"are missing, the most at joint {joint!r}: the mechanism has {Z.shape[1]} degrees of freedom"
    )
