"""Free coordinates of a mechanism, each with closed poses over it while the remaining ones are locked."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...errors import MbdaeError
from ...mechanism import Mechanism
from ...mechanism.assembly.position_search import close_position
from ...mechanism.tree.coordinate_units import coordinate_units
from ...mechanism.tree.frames import find_joint
from ...system import Array
from ...tolerances import HALF_DIGITS, INPUT_DIGITS, RANK, VISIBLE
from ..kinematics.kinematics import kinematics

if TYPE_CHECKING:
    from ...mechanism.formulations.index2 import Index2System

POSES = 121  # number of poses of a slider, approximately
MAX_SLIDERS = 16  # largest number of sliders of a page


@dataclass(frozen=True, eq=False)
class Slider:
    """Poses over one coordinate, with the remaining free coordinates at their start.

    Attributes:
        joint: name of the joint.
        unit: ``"rad"`` or ``"m"``.
        u: the coordinate, (n,), along the curve of poses: it reverses at a dead point, or ends there if there are
            several sliders.
        q: configurations, (n, nq).
        start: index of the pose nearest to the start.
        dead_points: values at which the coordinate reverses.
        ended: reason why the poses end: ``"closed"`` (periodic), ``"limits"`` of the joint, ``"range"``, ``"dead"``
            points, ``"open"`` where the loops cannot be closed beyond, or an end of `mbdae.kinematics`.
        beyond: name of a joint that is beyond its limits in each pose, ``""`` for none, (n,).
    """

    joint: str
    unit: str
    u: Array
    q: Array
    start: int
    dead_points: tuple[float, ...]
    ended: str
    beyond: tuple[str, ...]


def sliders(mech: Mechanism, q: Array) -> list[Slider]:
    """Return the independent coordinates at a closed configuration q (nq,), at most `MAX_SLIDERS`.

    Among the joints with one coordinate, driven ones and those in the start table come first, then the remaining ones
    in order; a joint is selected if it is independent of the earlier ones. A single slider covers the whole range of
    its coordinate, through dead points.
    """
    free = Mechanism(mech.model, mech.closures, mech.forces, start=mech.start_values, title=mech.title)
    names = independent(mech, free.system(), q)[:MAX_SLIDERS]
    found = [_slider(free, name, [n for n in names if n != name], q) for name in names]
    return [_between_dead_points(s) for s in found] if len(found) > 1 else found


def independent(mech: Mechanism, system: "Index2System", q: Array) -> list[str]:
    """Return independent joints of one coordinate at q, as many as there are degrees of freedom, or fewer."""
    G = system.jacobian(q)
    _, sigmas, right = np.linalg.svd(G) if len(G) else (0, np.zeros(0), np.eye(mech.nv))
    rank = int(np.count_nonzero(sigmas > RANK * sigmas.max(initial=0.0)))
    motions = right[rank:].T.copy()
    preferred = [d.joint for d in mech.drivers if d.joint] + list(mech.start_values.q)
    joints = [n for n in dict.fromkeys([*preferred, *mech.joint_names]) if find_joint(mech.model, n).nv == 1]
    out = []
    for name in joints:
        row = motions[find_joint(mech.model, name).idx_v]
        size = np.linalg.norm(row)
        if size > VISIBLE:
            out.append(name)
            motions -= np.outer(motions @ row, row) / size**2
    return out


def _slider(mech: Mechanism, name: str, locked_joints: list[str], q: Array) -> Slider:
    joint = find_joint(mech.model, name)
    unit = coordinate_units(mech)[f"v.{name}"].removesuffix("/s")
    dead: tuple[float, ...] = ()
    system = mech.system()
    u, poses = _single_motion(mech, name, q)
    if max(_max_violation(system, pose) for pose in (poses[0], poses[len(poses) // 3], poses[-1])) < HALF_DIGITS:
        ended = "limits" if limits_of(mech, name) is not None else "closed" if unit == "rad" else "range"
    else:
        try:
            found = kinematics(mech, name, hold=locked_joints, q=q, points=POSES)
            u, poses, ended = found.u, found.q, found.segments[0].ended
            ended = "closed" if unit == "rad" and abs(abs(u[-1] - u[0]) - 2 * np.pi) < INPUT_DIGITS else ended
            dead = tuple(sorted({round(float(x), 12) for x, _ in found.dead_points}))
        except MbdaeError:  # another mobility, an unlimited stroke, or a singular pose
            u, poses, ended = _sequential_poses(mech, name, locked_joints, q)
    nearest = np.flatnonzero(u == u[np.abs(u - value_of(q, joint)).argmin()])
    start = nearest[np.argmin([round(np.linalg.norm(mech.manifold.difference(q, poses[k])), 6) for k in nearest])]
    return Slider(name, unit, u, poses, int(start), dead, ended, tuple(_beyond(mech, poses)))


def _between_dead_points(slider: Slider) -> Slider:
    """Return the poses around the start between two dead points, over which the coordinate increases.

    The sliders then determine the coordinates one to one, so that several can be moved together.
    """
    n, start, k = len(slider.u), slider.start, np.arange(len(slider.u))
    u = slider.u
    if slider.ended == "closed":  # one period, with the start in the middle
        rounds, k = np.divmod(start + k - n // 2, n - 1)
        u, start = u[k] + rounds * (u[-1] - u[0]), n // 2
    ascending = np.diff(u) > 0
    reversals = np.flatnonzero(ascending[1:] != ascending[:-1]) + 1
    first, last = max([0, *reversals[reversals <= start]]), min([n - 1, *reversals[reversals > start]])
    chosen = np.arange(first, last + 1)[:: 1 if u[last] > u[first] else -1]
    ends = u[chosen[[0, -1]]]
    return replace(
        slider,
        u=u[chosen],
        q=slider.q[k[chosen]],
        start=int(np.flatnonzero(chosen == start)[0]),
        dead_points=tuple(d for d in slider.dead_points if np.abs(ends - d).min() < INPUT_DIGITS * np.ptp(u)),
        ended="dead" if slider.ended == "closed" and len(reversals) else slider.ended,
        beyond=tuple(slider.beyond[i] for i in k[chosen]),
    )


def _single_motion(mech: Mechanism, name: str, q: Array) -> tuple[Array, Array]:
    """Return poses in which one joint moves alone, over its limits, or over +-pi or +-0.5 m."""
    joint = find_joint(mech.model, name)
    start, limits = value_of(q, joint), limits_of(mech, name)
    default = start + np.array([-1, 1]) * (np.pi if _is_rotary(mech, name) else 0.5)
    low, high = default if limits is None else limits
    u = np.linspace(low, high, POSES)
    u[np.abs(u - start).argmin()] = start
    steps = np.zeros((POSES, mech.nv))
    steps[:, joint.idx_v] = u - start
    return u, np.array([mech.manifold.integrate(q, step) for step in steps])


def _sequential_poses(mech: Mechanism, name: str, locked_joints: list[str], q: Array) -> tuple[Array, Array, str]:
    """Return poses that are closed one after another from q to both sides, as far as possible, and how they end."""
    joint, system = find_joint(mech.model, name), mech.system()
    locked = np.array([find_joint(mech.model, n).idx_v for n in (name, *locked_joints)])
    targets, found, ended = _single_motion(mech, name, q)[0], {value_of(q, joint): q}, "range"
    for sweep in (targets[targets > value_of(q, joint)], targets[targets < value_of(q, joint)][::-1]):
        pose = q
        for u in sweep:
            step = np.zeros(mech.nv)
            step[joint.idx_v] = u - value_of(pose, joint)
            try:
                new = close_position(system, mech.manifold.integrate(pose, step), locked, 0.0)
            except MbdaeError:
                ended = "open"
                break
            if np.linalg.norm(mech.manifold.difference(pose, new)) > 20 * abs(step[joint.idx_v]) + 0.3:
                ended = "open"  # the nearest closed pose belongs to another branch
                break
            found[float(u)] = pose = new
    order = sorted(found)
    return np.array(order), np.array([found[u] for u in order]), ended


def _beyond(mech: Mechanism, poses: Array) -> Iterator[str]:
    low, high = mech.model.lowerPositionLimit, mech.model.upperPositionLimit
    single = {find_joint(mech.model, n).idx_q: n for n in mech.joint_names if limits_of(mech, n) is not None}
    slack = INPUT_DIGITS * mech.q_scales
    for pose in poses:
        yield next((n for i, n in single.items() if not low[i] - slack[i] <= pose[i] <= high[i] + slack[i]), "")


def limits_of(mech: Mechanism, name: str) -> Array | None:
    """Return the limits of a joint; None without limits."""
    joint = find_joint(mech.model, name)
    if joint.nq != 1:
        return None
    found = np.array([mech.model.lowerPositionLimit[joint.idx_q], mech.model.upperPositionLimit[joint.idx_q]])
    return found if np.abs(found).max() < 1e3 and found[0] < found[1] else None


def _is_rotary(mech: Mechanism, name: str) -> bool:
    return coordinate_units(mech)[f"v.{name}"].startswith("rad")


def value_of(q: Array, joint: object) -> float:
    """Return the coordinate of a joint with one coordinate; an angle in (-pi, pi] for an unbounded one."""
    at, nq = joint.idx_q, joint.nq  # type: ignore[attr-defined]
    return float(q[at]) if nq == 1 else float(np.arctan2(q[at + 1], q[at]))


def _max_violation(system: "Index2System", q: Array) -> float:
    g = system.closures(q, 0.0)[0]
    return float(np.abs(g / system.mechanism.row_scales).max(initial=0.0))
