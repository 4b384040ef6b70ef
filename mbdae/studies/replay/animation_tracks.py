"""Animation tracks of a replay for the page: bodies, ghosts, paths of points, and forces."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, as_list
from ...mechanism.contacts import contact_path, rolling_closures
from ...mechanism.frames import frame_paths, joint_paths
from ...system import Array
from ...tolerances import COINCIDENT
from ..figures import COLOURS
from .threejs import node, typed

if TYPE_CHECKING:
    from ...mechanism import Mechanism
    from ...mechanism.scene.scene import Scene
    from ...solution.solution import Solution

GHOSTS = ("#e8590c", "#0c8599", "#9c36b5", "#5c940d", "#c2255c")
ARROW = "#c2185b"
CONTACT_PREFIX = "contact."


def poses(scene: "Scene", placements: Array) -> Iterator[dict[str, Any]]:
    """Yield the poses of each shape: x, y, z and a quaternion for each frame, or once if it does not move."""
    for shape, track in zip(scene.shapes, placements.swapaxes(0, 1), strict=True):
        moves = np.ptp(track, axis=0).any()  # NaN does, too
        values = np.hstack([track[:, :3], continuous(track[:, 3:])]) if moves else track[:1]
        yield {"path": node(shape), "values": typed(values, "float32"), "box": shape.bounds.tolist()}


def springs(scene: "Scene", q: Array) -> list[dict[str, Any]]:
    """Return springs and dampers, and their end points at configurations q (m, nq)."""
    ends = scene.end_points(scene.springs, q).swapaxes(0, 1).reshape(len(scene.springs), len(q), 6)
    out = []
    for s, track in zip(scene.springs, ends, strict=True):
        moves = np.ptp(track, axis=0).any()
        length = s.length or float(np.median(np.linalg.norm(track[:, 3:] - track[:, :3], axis=1)))
        if length > 0:
            points = typed(track if moves else track[:1], "float32")
            out.append({"name": s.name, "coil": s.coil, "tube": s.tube, "length": length, "ends": points})
    return out


def gaps(scene: "Scene", q: Array) -> list[dict[str, Any]]:
    """Return closures with the largest visible gap in m over configurations q (m, nq), None if it is not visible."""
    sample = q[np.unique(np.linspace(0, len(q) - 1, min(len(q), 400)).astype(int))]
    distances = np.linalg.norm(np.diff(scene.end_points(scene.marks, sample), axis=2)[:, :, 0], axis=2)
    return [
        {"name": m.name, "open": float(np.abs(distances[:, k] - m.rod).max()) if m.coincide or m.rod else None}
        for k, m in enumerate(scene.marks)
    ]


def bodies(scene: "Scene", model: Any) -> list[dict[str, str]]:
    """Return bodies that the camera can follow, the heaviest first, each with the path of one of its shapes."""
    weight = {name: model.inertias[i].mass for i, name in enumerate(model.names) if i}
    out: dict[str, str] = {}
    for shape, carriers in zip(scene.shapes, scene.carriers, strict=True):
        if len(carriers) == 1 and carriers[0] and shape.role in ("visual", "link", "joint"):
            out.setdefault(model.names[carriers[0]], node(shape))
    return [{"name": n, "path": out[n]} for n in sorted(out, key=lambda n: -weight[n])]


def ghosts(sol: "Solution", others: Mapping[str, "Solution"], times: Array) -> list[dict[str, Any]]:
    """Return other solutions at the same times (m,), each in its colour.

    Raises:
        InputError: for a solution of another mechanism.
    """
    return [
        {"name": name, "colour": GHOSTS[i % len(GHOSTS)], **_ghost(sol, name, other, times)}
        for i, (name, other) in enumerate(others.items())
    ]


def choices(sol: "Solution", others: Mapping[str, "Solution"], times: Array) -> list[dict[str, Any]]:
    """Return solutions at the same times (m,), of which one is shown at a time.

    Raises:
        InputError: for a solution of another mechanism.
    """
    return [{"name": name, **_ghost(sol, name, other, times)} for name, other in others.items()]


def _ghost(sol: "Solution", name: str, ghost: "Solution", times: Array) -> dict[str, Any]:
    """Return poses of the moving bodies and springs of another solution, NaN outside its time span."""
    mech, other = sol.mechanism, ghost.mechanism
    if not _same_joints(mech, other):
        raise InputError(f"ghost {name!r} is of {other.title!r}, whose joints are not those of {mech.title!r}")
    low, high = sorted((ghost.t[0], ghost.t[-1])) if len(ghost.t) else (np.inf, -np.inf)
    slack = COINCIDENT * (high - low)
    inside = (times >= low - slack) & (times <= high + slack)
    if not inside.any():
        raise InputError(f"ghost {name!r} has no time in common with {times[0]:g} to {times[-1]:g} s")
    q = np.array([ghost(t)[0] for t in np.clip(times[inside], low, high)])
    placements = np.full((len(times), len(mech.scene.shapes), 7), np.nan)
    placements[inside] = mech.scene.placements(q)
    moving = np.ptp(placements[inside], axis=0).any(axis=1)
    bodies = [shape.role != "closure" for shape in mech.scene.shapes]
    found = poses(mech.scene, placements)
    return {
        "poses": [pose for pose, m, b in zip(found, moving, bodies, strict=True) if m and b],
        "springs": springs(mech.scene, q) if inside.all() else [],
    }


def _same_joints(a: "Mechanism", b: "Mechanism") -> bool:
    """Return whether two mechanisms have the same joints at the same placements."""
    p, r = (np.array([x.homogeneous for x in m.model.jointPlacements]) for m in (a, b))
    return a.joint_names == b.joint_names and a.nq == b.nq and np.allclose(p, r)


def traces(mechanism: "Mechanism", names: str | Sequence[str], q: Array) -> list[dict[str, Any]]:
    """Return paths of the origins of frames at configurations q (m, nq); ``contact.<closure>`` is a contact point.

    Raises:
        UnknownNameError: for a frame or rolling closure that does not exist.
    """
    listed = as_list(names, "traces is a list of frames")
    found = [
        contact_path(mechanism, name.removeprefix(CONTACT_PREFIX), q)
        if name.startswith(CONTACT_PREFIX)
        else frame_paths(mechanism.model, [name], q)[0]
        for name in listed
    ]
    return [
        {"name": name, "colour": COLOURS[i % len(COLOURS)], "points": typed(track, "float32")}
        for i, (name, track) in enumerate(zip(listed, found, strict=True))
    ]


def arrows(sol: "Solution", names: bool | str | Sequence[str], times: Array) -> dict[str, Any]:
    """Return forces in N of closures on the bodies of their second frames, and of joints on their child bodies.

    Values and points of application (m, 3) each; and the largest force.

    Raises:
        UnknownNameError: for a name that does not exist.
        InputError: for a coupling, or without closures between frames.
    """
    if names is False or (names is not True and not names):
        return {"largest": 0.0, "forces": []}
    mech = sol.mechanism
    joined = {c.name: c.frames for c in mech.constraints if c.frames}
    if names is True and not joined:
        raise InputError(f"{mech.title!r} has no closures between frames: there are no forces to draw; name a joint")
    sample = sol.resampled(times)
    chosen = joined if names is True else as_list(names, "arrows is True, or a list of closures and joints")
    found = [sample.reaction(name) for name in chosen]
    at = [_application_points(mech, r.name, sample.q) for r in found]
    forces = [
        {
            "name": r.name + ("" if all(r.unique[:3]) else " (minimum norm)"),
            "colour": ARROW,
            "points": typed(points, "float32"),
            "values": typed(r.force_world, "float32"),
        }
        for r, points in zip(found, at, strict=True)
    ]
    lengths = [np.linalg.norm(r.force_world, axis=1) for r in found]
    return {"largest": float(np.nanmax(lengths, initial=0.0)), "forces": forces}


def _application_points(mech: "Mechanism", name: str, q: Array) -> Array:
    """Return the points (m, 3) at which the force of a closure or a joint acts."""
    if name in {c.name for c in rolling_closures(mech)}:
        return contact_path(mech, name, q)
    frames = next((c.frames for c in mech.constraints if c.name == name), None)
    if frames:
        return frame_paths(mech.model, [frames[1]], q)[0]
    return joint_paths(mech.model, [name], q)[0]


def continuous(quaternions: Array) -> Array:
    """Return unit quaternions (m, 4) with signs such that successive ones are close."""
    dots = np.einsum("ij,ij->i", quaternions[1:], quaternions[:-1])
    signs = np.cumprod(np.concatenate([[1.0], np.where(dots < 0, -1.0, 1.0)]))
    return quaternions * signs[:, None]
