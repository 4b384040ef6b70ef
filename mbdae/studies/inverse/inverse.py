"""Inverse dynamics of closed loops: actuator efforts and joint reactions for a motion."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...mechanism import Mechanism
from ...mechanism.closures.brake import Brake
from ...mechanism.closures.independent_rows import minimum_norm
from ...mechanism.frames import find_joint
from ...mechanism.hybrid.switches import Mode
from ...mechanism.joint_wrenches import joint_wrenches
from ...solution.problem import mechanism_of
from ...system import Array
from ...tolerances import HALF_DIGITS, NEGLIGIBLE, RANK
from ..kinematics.passing import Passed, passages
from ..kinematics.result import Kinematics
from .actuators import Actuators, actuators_of, weights_of
from .prescribed import Prescribed, prescribed, read_motion
from .result import InverseDynamics

__all__ = ["inverse_dynamics"]



def inverse_dynamics(
    mech: Mechanism | str | Path,
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
    drivers count as motions, not as forces. In a run, the rows that are active in its modes carry load: stops, ropes,
    contacts, locked clutches, sticking joints. In any other motion none of them does, except clutches engaged on
    command and closures within their active range; exact friction opposes the velocity, and violated unilateral
    constraints are reported.

    Args:
        mech: the mechanism, or an argument of `mbdae.load`.
        motion: a run (`mbdae.Solution`, or the path of its .npz); a curve of `mbdae.kinematics`, with ``speed``; a
            table of columns ``t`` and joints of one coordinate, or the path of its .csv, interpolated by splines of
            degree 5, from which the closures determine the other joints; or arrays (t, q, v, a).
        actuators: a joint, driver, motor or controller that acts; several times for several. When left out: the input
            of the curve, the mechanism's drivers, or its joints with motors and controllers.
        speed: constant speed of the input in rad/s or m/s.
        weights: actuator=weight, for more actuators than degrees of freedom. Of the squares of efforts; 1 when
            left out.

    Raises:
        UnknownNameError: for an unknown name.
        InputError: for a motion that violates the closures, or actuators that cannot cause it.

    Example:
        >>> turn = kinematics(mech, "crank")                              # doctest: +SKIP
        >>> print(inverse_dynamics(mech, turn, speed=10.0))               # doctest: +SKIP
    """
    mech = mechanism_of(mech, "inverse_dynamics")
    motion = read_motion(motion)
    acting = actuators_of(mech, actuators, motion.drive if isinstance(motion, Kinematics) else "")
    weight = weights_of(acting.names, weights)
    moves = prescribed(mech, motion, speed)
    n, m, carrying = len(moves.t), len(acting.names), acting.carrying
    system = acting.mechanism.system()
    system.sliding.reject("inverse dynamics")
    s, modes, bases = _states(acting.mechanism, moves.states, n), _modes(acting.mechanism, moves), []
    for q, mode in zip(moves.q, modes, strict=True):
        system.enter(mode)
        bases.append(_basis(system.jacobian(q)[carrying], mech.nv))
    usual: dict[Mode, int] = {}
    for mode, (r, _) in zip(modes, bases, strict=True):
        usual[mode] = max(r, usual.get(mode, 0))
    efforts, speeds = np.full((n, m), np.nan), np.full((n, m), np.nan)
    lam, joints = np.full((n, len(carrying)), np.nan), np.full((n, mech.model.njoints - 1, 6), np.nan)
    for i, (t, q, v, vdot) in enumerate(zip(*moves[:4], strict=True)):
        r, Z = bases[i]
        if r < usual[modes[i]]:
            continue  # several motions are possible in this pose: efforts are undetermined
        system.enter(modes[i])
        U, G = system.inertia(t, q), system.jacobian()
        b = U.T @ (U @ vdot) - system.force(t, q, v, s[i])[0]
        S = acting.at(G)
        efforts[i] = _least(Z.T @ S.T, Z.T @ b, weight)
        _check_reached(acting, Z, S, b, efforts[i], t)
        lam[i] = minimum_norm(G[carrying], r, b - S.T @ efforts[i]) if r else 0.0
        speeds[i] = S @ v
        whole = np.zeros(system.ng)
        whole[carrying] = lam[i]
        for row, effort in zip(acting.rows, efforts[i], strict=True):
            if row >= 0:
                whole[row] = effort
        joints[i] = joint_wrenches(system, t, q, v, vdot, whole)
    if not np.isfinite(efforts).any():
        raise InputError("the closures lose rank in all poses of the motion: no effort is determined")
    return InverseDynamics(
        mech, moves.t, moves.q, moves.v, moves.vdot, tuple(acting.names), tuple(acting.units), efforts, speeds,
        lam, joints, moves.over[0], moves.over[1], moves.impacts, _passed(mech, moves), _held(mech, moves),
    )  # fmt: skip


def _modes(mech: Mechanism, moves: Prescribed) -> list[Mode]:
    """Return the active rows at each time: those of a run, or none that can open in a prescribed motion.

    Dry friction opposes a prescribed motion.
    """
    found = [
        moves.modes[switch.name].tolist()
        if switch.name in moves.modes
        else [switch.prescribed(*point) for point in zip(moves.t, moves.q, moves.v, strict=True)]
        for switch in mech.switches
    ]
    return [tuple(states) for states in zip(*found, strict=True)] if found else [()] * len(moves.t)


def _passed(mech: Mechanism, moves: Prescribed) -> tuple[Passed, ...]:
    """Return the unilateral constraints that a prescribed motion violates; none for a run."""
    if moves.modes or not (np.diff(moves.t) > 0).all():
        return ()
    return passages(mech, moves.t, moves.q, moves.v, moves.over[0])


def _held(mech: Mechanism, moves: Prescribed) -> dict[str, float]:
    """Return the static friction of joints that a prescribed motion keeps at rest for a while."""
    brakes = [] if moves.modes else [c for c in mech.constraints if isinstance(c, Brake)]
    out = {}
    for brake in brakes:
        still = moves.v[:, find_joint(mech.model, brake.joint).idx_v] == 0
        if still.all() or (still[1:] & still[:-1]).any():
            out[brake.joint] = brake.static
    return out


def _states(mech: Mechanism, known: Mapping[str, Array], n: int) -> Array:
    """Return states of the remaining forces, (n, ns): those of the motion, or their start values."""
    return np.array([known.get(name, np.full(n, start)) for name, start in mech.states.items()]).T.reshape(n, -1)


def _basis(G: Array, nv: int) -> tuple[int, Array]:
    """Return the rank of G, and an orthonormal basis Z (nv, nv - r) of its null space."""
    if not len(G):
        return 0, np.eye(nv)
    _, sizes, right = np.linalg.svd(G)
    r = int(np.count_nonzero(sizes > RANK * sizes[0]))
    return r, right[r:].T


def _least(A: Array, b: Array, weight: Array) -> Array:
    """Return the x with A x = b that minimises the sum of weight x^2."""
    root = np.sqrt(weight)
    return np.linalg.lstsq(A / root, b, rcond=RANK)[0] / root


def _check_reached(acting: Actuators, Z: Array, S: Array, b: Array, effort: Array, t: float) -> None:
    left = Z.T @ (b - S.T @ effort)
    if np.abs(left).max(initial=0.0) <= HALF_DIGITS * max(np.abs(b).max(), NEGLIGIBLE):
        return
    missing = Z @ left
    joint = acting.mechanism.coordinate_joint(int(np.abs(missing).argmax()))
    raise InputError(
        f"{', '.join(acting.names)} cannot bring about the motion at t = {t:.6g}: {np.abs(missing).max():.3g} N m or N "
        f"are missing, the most at joint {joint!r}: the mechanism has {Z.shape[1]} degrees of freedom"
    )
