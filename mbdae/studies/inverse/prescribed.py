"""Prescribed motions: runs, tables of joint coordinates, curves of poses at constant speed, or q, v and v'."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.interpolate import make_interp_spline

from ...arguments import as_numbers
from ...errors import InputError, UnknownNameError
from ...mechanism import Mechanism
from ...mechanism.assembly.assembly import start_configuration
from ...mechanism.assembly.position_search import close_position
from ...mechanism.closures.closure_error import largest_error
from ...mechanism.tree.coordinate_units import coordinate_units
from ...mechanism.tree.frames import find_joint
from ...mechanism.tree.tree_terms import mode_joints
from ...solution.solution import Solution
from ...system import Array
from ...tolerances import COARSE, RANK, SEARCH_TOLERANCE
from ..data_files import check_headings, read_columns
from ..kinematics.result import Kinematics

if TYPE_CHECKING:
    import pinocchio as pin

    from ...mechanism.formulations.index2 import Index2System

DEGREE = 5  # degree of the interpolating spline, whose accelerations are splines of degree 3
ITERATIONS = 20


class Prescribed(NamedTuple):
    """A motion of a mechanism.

    Attributes:
        t: times in s, (n,).
        q: configurations, (n, nq).
        v: velocities, (n, nv).
        vdot: accelerations, (n, nv).
        states: states of forces by name, (n,) each, if known.
        over: abscissa of figures, (n,), and its name with unit.
        modes: states of switches of a run by name, (n,) each.
        impacts: times of impacts in s, (k,).
        rigid: modes of flexible bodies that the motion locks, as if the bodies were rigid.
    """

    t: Array
    q: Array
    v: Array
    vdot: Array
    states: dict[str, Array]
    over: tuple[Array, str]
    modes: dict[str, Array] = {}  # noqa: RUF012
    impacts: tuple[float, ...] = ()
    rigid: tuple[str, ...] = ()


def prescribed(mech: Mechanism, motion: object, speed: float | None) -> Prescribed:
    """Return a motion of a mechanism as arrays, see `mbdae.inverse_dynamics`.

    Raises:
        InputError: for an invalid motion, one of another mechanism, or one that violates the closures.
        UnknownNameError: for a column that is not a joint of one coordinate.
    """
    if speed is not None and not isinstance(motion, Kinematics):
        raise InputError("speed needs a curve of mbdae.kinematics: other motions have times")
    if isinstance(motion, Kinematics):
        return _from_curve(mech, motion, speed)
    if isinstance(motion, Solution):
        return _from_run(mech, motion)
    if isinstance(motion, Mapping):
        return _from_table(mech, motion)
    if isinstance(motion, Sequence) and len(motion) == 4:
        return _from_arrays(mech, motion)
    valid = "a Solution, a Kinematics, a table of columns, the path of one of them, or (t, q, v, a)"
    raise InputError(f"a motion is {valid}, got {motion!r:.60}")


def _from_curve(mech: Mechanism, found: Kinematics, speed: float | None) -> Prescribed:
    _require_same_joints(mech, found.mechanism)
    if speed is None:
        raise InputError(f"give the constant speed of {found.drive!r}, in {found.unit}/s")
    last = found.segments[0].last
    unknown = ~np.isfinite(found.curvature[:last]).all(axis=1)
    if unknown.any():
        where = f"{found.drive} = {found.u[:last][unknown][0]:.9g}"
        raise InputError(f"efforts are not determined at the branch point {where}: give a span that does not reach it")
    run = found.run(speed=speed)
    rates = np.array([run.rates[i] for i in range(len(run.t))])
    over = found.u[:last] if run.q[0] is found.q[0] or (run.q[0] == found.q[0]).all() else found.u[:last][::-1]
    name = f"{found.drive} ({found.unit})"
    rigid = tuple(x for x in mode_joints(mech.model) if x in found.locked)
    return Prescribed(run.t, run.q, run.v, rates[:, mech.nv : 2 * mech.nv], {}, (over, name), rigid=rigid)


def _from_run(mech: Mechanism, sol: Solution) -> Prescribed:
    _require_same_joints(mech, sol.mechanism)
    valid = np.isfinite(sol.vdot).all(axis=1)
    states = {name: sol.s[valid, i] for i, name in enumerate(sol.mechanism.states)}
    t = np.asarray(sol.t)[valid]
    if not len(t):
        raise InputError("the run has no times with finite accelerations")
    nodes = np.arange(len(sol.t)) if sol.steps is None else sol.before(sol.t)
    found = np.array([sol.mode(int(i)) for i in nodes[valid]]) if sol.modes else np.empty((len(t), 0), int)
    modes = {switch.name: found[:, switch.index] for switch in sol.mechanism.switches} if sol.modes else {}
    impacts = tuple(x.t for x in sol.impacts)
    return Prescribed(t, sol.q[valid], sol.v[valid], sol.vdot[valid], states, (t, "t (s)"), modes, impacts)


def _require_same_joints(mech: Mechanism, other: Mechanism) -> None:
    if mech.joint_names != other.joint_names or mech.nq != other.nq:
        raise InputError(f"the motion is of {other.title!r}, whose joints are not those of {mech.title!r}")


def _from_arrays(mech: Mechanism, motion: Sequence[object]) -> Prescribed:
    t = np.atleast_1d(as_numbers(motion[0]))
    q, v, a = (np.atleast_2d(as_numbers(x)) for x in motion[1:])
    if t.ndim != 1 or not len(t) or not np.isfinite(t).all():
        raise InputError(f"t of a motion is finite and has shape (n,), got {motion[0]!r:.60}")
    for name, x, width in (("q", q, mech.nq), ("v", v, mech.nv), ("a", a, mech.nv)):
        if x.shape != (len(t), width) or not np.isfinite(x).all():
            raise InputError(f"{name} of a motion is finite and has shape ({len(t)}, {width}), got {x.shape}")
    free = Mechanism(mech.model, mech.closures)
    system = free.system()
    speed, acceleration = (float(np.abs(x / free.coordinate_scales).max()) for x in (v, a))
    sizes = 1.0, speed, acceleration + speed**2
    for i in range(len(t)) if free.ng else ():
        for values, size, unit in zip(
            _constraint_violations(system, q[i], v[i], a[i]), sizes, ("", "/s", "/s^2"), strict=True
        ):
            error = largest_error(free, values, unit)
            if error.relative > COARSE * size:
                raise InputError(f"the motion violates closure {error.name!r} by {error.text} at t = {t[i]:.9g}")
    return Prescribed(t, q, v, a, {}, (t, "t (s)"))


def _constraint_violations(system: "Index2System", q: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
    g, G = system.closures(q, 0.0)
    return g, G @ v, G @ a + system.gamma(q, v, 0.0)


def read_motion(mech: Mechanism, motion: object) -> Any:
    """Return a motion, read from a file if it is the path of a run or a table.

    Raises:
        InputError: for a file that is missing or invalid, or a unit that is not one of its joint.
    """
    if not isinstance(motion, str | Path):
        return motion
    if not Path(motion).exists():
        valid = "a run, a curve of mbdae.kinematics, a table, or the path of a run or a table"
        raise InputError(f"no file {str(motion)!r}: a motion is {valid}")
    if Path(motion).suffix == ".npz":
        return Solution.load(motion)
    columns, heading_units, _ = read_columns(motion)
    known = {"t": "s"} | coordinate_units(mech)
    joint_units = {name.removeprefix("q."): unit for name, unit in known.items()}
    check_headings(str(motion), heading_units, known | joint_units)
    return columns


def _from_table(mech: Mechanism, columns: Mapping[str, object]) -> Prescribed:
    """Return the motion of all joints from splines of degree 5 through the columns, and the closures."""
    single = {n: j for n in mech.joint_names if (j := find_joint(mech.model, n)).nv == 1}
    t, given = _joint_columns(columns, single)
    _check_columns(t, given)
    degree = next(k for k in (DEGREE, 3, 2) if k < len(t))
    curves = make_interp_spline(t, np.array(list(given.values())).T, k=degree)
    targets = np.stack([curves(t, k) for k in range(3)])
    rigid = tuple(x for x in mode_joints(mech.model) if x not in given)
    start = start_configuration(mech)
    at_start = [_coordinate(start, single[n]) for n in rigid]
    constant = np.stack([np.tile(x, (len(t), 1)) for x in (at_start, *np.zeros((2, len(rigid))))])
    joints = [single[n] for n in (*given, *rigid)]
    motion = _consistent_motion(mech, joints, np.concatenate([targets, constant], axis=2))
    return Prescribed(t, *motion, {}, (t, "t (s)"), rigid=rigid)


def _joint_columns(columns: Mapping[str, object], single: Mapping[str, object]) -> tuple[Array, dict[str, Array]]:
    """Return the times of a table, and its columns by joint name: those with the prefix ``q.`` if there are any.

    Raises:
        UnknownNameError: for a column that is not a joint of one coordinate.
        InputError: for missing times or joints.
    """
    known = {n: as_numbers(x) for n, x in columns.items()}
    if "t" not in known:
        raise InputError(f"a table of a motion has a column t, got {', '.join(known) or 'none'}")
    t = known.pop("t")
    prefixed = any(n.startswith("q.") for n in known)
    given = {n.removeprefix("q."): x for n, x in known.items() if n.startswith("q.") or not prefixed}
    if unknown := [name for name in given if name not in single]:
        raise UnknownNameError("joint of one coordinate", unknown[0], single)
    if not given:
        raise InputError(f"a table of a motion has columns of joints: {', '.join(single)}")
    return t, given


def _check_columns(t: Array, given: Mapping[str, Array]) -> None:
    if t.ndim != 1 or len(t) < 3:
        raise InputError(f"the times of a motion are a column of three numbers at least, got {t.size}")
    for name, x in {"t": t, **given}.items():
        if x.shape != t.shape:
            raise InputError(f"column {name!r} of a motion has {x.size} values at {len(t)} times")
        if not np.isfinite(x).all():
            raise InputError(f"column {name!r} of a motion has no finite value in row {np.isfinite(x).argmin() + 1}")
    if not (increasing := np.diff(t) > 0).all():
        first, second = t[(i := int(np.argmin(increasing)))], t[i + 1]
        impact = " (a run has the time of an impact twice: give its .npz)" if first == second else ""
        raise InputError(f"the times of a motion must increase, got {first:.9g} and then {second:.9g}{impact}")


def _consistent_motion(mech: Mechanism, joints: list["pin.JointModel"], targets: Array) -> tuple[Array, Array, Array]:
    """Return q, v and v' that satisfy the closures, and fit joint values u, u', u'' (3, n, k) by least squares."""
    free = Mechanism(mech.model, mech.closures, start=mech.start_values)
    system, n = free.system(), targets.shape[1]
    iv = [j.idx_v for j in joints]
    out = np.empty((n, mech.nq)), np.empty((n, mech.nv)), np.empty((n, mech.nv))
    q = close_position(system, start_configuration(mech), np.array([], int), 0.0)
    for i in range(n):
        found = _at_targets(system, q, joints, targets[0, i])
        q, G = found.q, found.G
        if i == 0:
            _check_dof(free, G, iv)
        if not (found.distance < COARSE and np.abs(found.g / free.row_scales).max(initial=0.0) < COARSE):
            raise InputError(f"the joints cannot follow the table at point {i + 1} with closed loops: they miss it by "
                             f"{found.distance:.3g} rad or characteristic lengths")  # fmt: skip
        v = _solve(G, np.zeros(len(G)), iv, targets[1, i])
        gamma = system.gamma(q, v, 0.0)
        G = system.jacobian(q)
        out[0][i], out[1][i], out[2][i] = q, v, _solve(G, -gamma, iv, targets[2, i])
    return out


class _TargetPose(NamedTuple):
    """A configuration (nq,), g and G of the iterate before it, and the distance of the joints from their targets."""

    q: Array
    g: Array
    G: Array
    distance: float


def _at_targets(system: "Index2System", q: Array, joints: list["pin.JointModel"], target: Array) -> _TargetPose:
    """Return the configuration with g = 0 and joints closest to their targets (k,), by Gauss-Newton steps from q."""
    iv, continuous = [j.idx_v for j in joints], np.array([j.nq == 2 for j in joints])
    scales = system.mechanism.coordinate_scales
    for _ in range(ITERATIONS):
        g, G = system.closures(q, 0.0)
        error = target - np.array([_coordinate(q, j) for j in joints])
        error = np.where(continuous, (error + np.pi) % (2 * np.pi) - np.pi, error)
        x = _solve(G, -g, iv, error)
        size = float(np.abs(x / scales).max())
        q = system.manifold.integrate(q, x / max(1.0, 2.0 * size))
        if size < SEARCH_TOLERANCE:
            break
    return _TargetPose(q, g, G, float(np.abs(error / scales[iv]).max()))


def _coordinate(q: Array, joint: "pin.JointModel") -> float:
    """Return the coordinate of a joint; the angle of a joint whose coordinates are (cos, sin)."""
    k = joint.idx_q
    return float(q[k] if joint.nq == 1 else np.arctan2(q[k + 1], q[k]))


def _check_dof(free: Mechanism, G: Array, iv: list[int]) -> None:
    """Require that these velocity components determine the motion.

    Raises:
        InputError: for nonholonomic rows, or undetermined degrees of freedom.
    """
    names = ", ".join(free.coordinate_joint(k) for k in iv)
    if not free.positional.all() and _remaining_dof(G[free.positional], iv):
        nonholonomic = free.row_names[int(np.argmin(free.positional))]
        raise InputError(f"{nonholonomic!r} has nonholonomic rows: its position depends on the path, not on {names} "
                         "alone: give a run, or (t, q, v, a)")  # fmt: skip
    if dof := _remaining_dof(G, iv):
        raise InputError(f"{dof} degrees of freedom are undetermined when {names} follow the table: name more joints")


def _solve(G: Array, rhs: Array, iv: list[int], target: Array) -> Array:
    """Return x with G x = rhs and x[iv] closest to a target (k,)."""
    if not len(G):
        Z, x = np.eye(G.shape[1]), np.zeros(G.shape[1])
    else:
        left, sigmas, right = np.linalg.svd(G)
        r = int(np.count_nonzero(sigmas > RANK * sigmas[0]))
        x, Z = (left[:, :r].T @ rhs / sigmas[:r]) @ right[:r], right[r:].T
    return x + Z @ np.linalg.lstsq(Z[iv], target - x[iv], rcond=RANK)[0]


def _remaining_dof(G: Array, iv: list[int]) -> int:
    """Return the degrees of freedom that remain if some coordinates are prescribed."""
    rows = np.vstack([G, np.eye(G.shape[1])[iv]])
    sigmas = np.linalg.svd(rows, compute_uv=False)
    return G.shape[1] - int(np.count_nonzero(sigmas > RANK * sigmas[0]))
