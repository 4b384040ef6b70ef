"""Motions of a replay besides that of the mechanism: ghosts, selectable solutions, paths of points, and forces."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...errors import InputError, as_list
from ...mechanism.scene.drawables import Drawable, Motion, Track, aligned_quaternions, drawables, motions, primitive
from ...mechanism.scene.flexible_models import with_scaled_deformation
from ...mechanism.scene.visible import sampled
from ...mechanism.signals.contacts import contact_path, rolling_closures
from ...mechanism.tree.frames import frame_paths, joint_paths
from ...system import Array
from ...tolerances import COINCIDENT, NEGLIGIBLE, TINY
from ..figures import COLOURS
from .threejs import buffer_attribute, buffer_geometry, node_path, set_object, set_property, typed_array

if TYPE_CHECKING:
    from ...mechanism import Mechanism
    from ...mechanism.scene.scene import Scene
    from ...solution.solution import Solution

GHOSTS = ("#e8590c", "#0c8599", "#9c36b5", "#5c940d", "#c2255c")
GHOST_OPACITY = 0.45
ARROW = "#c2185b"
LONGEST, SHAFT = 0.3, 0.004  # largest length of an arrow, radius of its shaft, in extents of the mechanism
TRACE, SEGMENTS = 0.0027, 6000  # radius in extents, and largest number of segments of a path
SMOOTH = 0.1  # largest angle in rad between segments of a path
CONTACT_PREFIX = "contact."


class MovingDrawables(NamedTuple):
    """Drawables and their motions, below a path of the viewer's tree."""

    drawables: list[Drawable]
    motions: list[Motion]
    root: str


def rgba_of(colour: str, opacity: float = 1.0) -> tuple[float, ...]:
    """Return red, green, blue and opacity of ``"#rrggbb"``."""
    return (*(int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)), opacity)


def closure_gaps(scene: "Scene", q: Array) -> list[dict[str, Any]]:
    """Return closures with the largest visible gap in m over configurations q (m, nq); None if none can be visible."""
    distances = np.linalg.norm(np.diff(scene.end_points(scene.marks, sampled(q, 400)), axis=2)[:, :, 0], axis=2)
    marks = [node_path(d.name) for d in drawables(scene) if d.style == "closure"]
    return [
        {
            "name": m.name,
            "open": float(np.abs(distances[:, k] - m.rod).max()) if m.coincide or m.rod else None,
            "paths": [path for path in marks if path[:-2].endswith(f"/{m.name.replace('/', '|')}")],
        }
        for k, m in enumerate(scene.marks)
    ]


def followable_bodies(scene: "Scene", model: Any) -> dict[str, int]:
    """Return bodies that the camera can follow, the heaviest first, each with one of its shapes."""
    weight = {name: model.inertias[i].mass for i, name in enumerate(model.names) if i}
    out: dict[str, int] = {}
    for k, (shape, carriers) in enumerate(zip(scene.shapes, scene.carriers, strict=True)):
        if len(carriers) == 1 and 0 < carriers[0] < model.njoints and shape.role in ("visual", "link", "joint"):
            out.setdefault(model.names[carriers[0]], k)
    return {n: out[n] for n in sorted(out, key=lambda n: -weight[n])}


def ghosts(
    sol: "Solution", scene: "Scene", solutions: Mapping[str, "Solution"], times: Array
) -> list[tuple[str, str, MovingDrawables]]:
    """Return further solutions in a scene at the same times (m,): names, colours, and moving drawables.

    Raises:
        InputError: for a solution of another mechanism.
    """
    out = []
    for i, (name, other) in enumerate(solutions.items()):
        colour = GHOSTS[i % len(GHOSTS)]
        q, inside = _configurations(sol, name, other, times)
        own = scene.for_motion(q[inside])
        found = zip(drawables(own), motions(own, q), strict=True)
        shown = Track(inside[:, None].astype(float))
        moving = [
            (p._replace(rgba=rgba_of(colour, GHOST_OPACITY), style="ghost"), {**m, "visible": shown})
            for p, m in found
            if p.style == "body" and any(np.ptp(t.values[inside], axis=0).any() for t in m.values())
        ]
        drawn, tracks = [p for p, _ in moving], [m for _, m in moving]
        out.append((name, colour, MovingDrawables(drawn, tracks, f"/mechanism/ghost {i + 1}")))
    return out


def choices(
    sol: "Solution", scene: "Scene", solutions: Mapping[str, "Solution"], times: Array
) -> Iterator[tuple[str, tuple[list[Motion], Array]]]:
    """Yield selectable solutions at the same times (m,): names, motions of the drawables, and q.

    Raises:
        InputError: for a solution of another mechanism.
    """
    for name, other in solutions.items():
        q, _ = _configurations(sol, name, other, times)
        yield name, (motions(scene, q), q)


def _configurations(sol: "Solution", name: str, ghost: "Solution", times: Array) -> tuple[Array, Array]:
    """Return configurations (m, nq) of a ghost at times (m,), and whether they are within its time span."""
    mech, other = sol.mechanism, ghost.mechanism
    if not _same_joints(mech, other):
        raise InputError(f"ghost {name!r} is of {other.title!r}, whose joints are not those of {mech.title!r}")
    low, high = sorted((ghost.t[0], ghost.t[-1])) if len(ghost.t) else (np.inf, -np.inf)
    slack = COINCIDENT * (high - low)
    inside = (times >= low - slack) & (times <= high + slack)
    if not inside.any():
        raise InputError(f"ghost {name!r} has no time in common with {times[0]:g} to {times[-1]:g} s")
    return np.array([ghost(t)[0] for t in np.clip(times, low, high)]), inside


def _same_joints(a: "Mechanism", b: "Mechanism") -> bool:
    """Return whether two mechanisms have the same joints at the same placements."""
    p, r = (np.array([x.homogeneous for x in m.model.jointPlacements]) for m in (a, b))
    return a.joint_names == b.joint_names and a.nq == b.nq and np.allclose(p, r)


def traces(
    mechanism: "Mechanism",
    names: str | Sequence[str],
    configurations: Callable[[Array], Array],
    times: Array,
    deformation: float | None = None,
) -> list[dict[str, Any]]:
    """Return paths of the origins of frames over times (m,), refined until they are smooth.

    Args:
        mechanism: the mechanism.
        names: names of frames; ``contact.<closure>`` is a contact point.
        configurations: times (k,) to configurations (k, nq).
        times: equidistant times.
        deformation: factor on displacements of flexible bodies.

    Raises:
        UnknownNameError: for a frame or rolling closure that does not exist.
    """
    frames, model = as_list(names, "traces is a list of frames"), with_scaled_deformation(mechanism.model, deformation)

    def paths(q: Array) -> list[Array]:
        return [
            contact_path(mechanism, name.removeprefix(CONTACT_PREFIX), q)
            if name.startswith(CONTACT_PREFIX)
            else frame_paths(model, [name], q)[0]
            for name in frames
        ]

    found = paths(configurations(times)) if frames else []
    while len(times) <= SEGMENTS // 2 and any(_largest_corner(track) > SMOOTH for track in found):
        times = np.linspace(times[0], times[-1], 2 * len(times) - 1)
        found = paths(configurations(times))
    return [
        {"name": name, "colour": COLOURS[i % len(COLOURS)], "points": track}
        for i, (name, track) in enumerate(zip(frames, found, strict=True))
    ]


def _largest_corner(points: Array) -> float:
    """Return the largest angle in rad between successive visible segments of a path (m, 3)."""
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    steps = steps[lengths > NEGLIGIBLE * np.ptp(points, axis=0).max(initial=0.0)]
    directions = steps / np.linalg.norm(steps, axis=1)[:, None]
    cosines = np.einsum("ij,ij->i", directions[1:], directions[:-1])
    return float(np.arccos(np.clip(cosines, -1.0, 1.0)).max(initial=0.0))


def path_commands(path: str, points: Array, colour: str, radius: float) -> Iterator[dict[str, Any]]:
    """Yield the commands that draw a path (m, 3): a thin line, and bars that are shown up to the current time."""
    rgba, mark = int(colour[1:], 16), {"transparent": True, "depthTest": False}
    line = {"uuid": "line", "type": "LineBasicMaterial", "color": rgba, "opacity": 0.5, **mark}
    data = {"attributes": {"position": buffer_attribute(points)}}
    yield set_object(f"{path} line", {
        "geometries": [{"uuid": "g", "type": "BufferGeometry", "data": data}],
        "materials": [line],
        "object": {"uuid": "o", "type": "Line", "geometry": "g", "material": "line", "renderOrder": 499},
    })  # fmt: skip
    ends = points[np.unique(np.linspace(0, len(points) - 1, min(len(points), SEGMENTS + 1)).astype(int))]
    steps = np.diff(ends, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    z = np.where(lengths[:, None] > 0, steps / np.maximum(lengths, TINY)[:, None], [0.0, 0.0, 1.0])
    x = np.cross(z, np.eye(3)[np.abs(z).argmin(axis=1)])
    x /= np.linalg.norm(x, axis=1)[:, None]
    matrices = np.zeros((len(steps), 4, 4))  # transposed: three.js stores columns
    matrices[:, :, :3] = np.stack(
        [radius * x, radius * np.cross(z, x), (lengths + radius)[:, None] * z, (ends[1:] + ends[:-1]) / 2], axis=1
    )
    matrices[:, 3, 3] = 1
    solid = {"uuid": "g", "type": "BufferGeometry", "data": buffer_geometry(primitive("box", (1.6, 1.6, 1.0)))}
    yield set_object(path, {
        "geometries": [solid],
        "materials": [{"uuid": "m", "type": "MeshBasicMaterial", "color": rgba, **mark}],
        "object": {
            "uuid": "o", "type": "InstancedMesh", "geometry": "g", "material": "m", "renderOrder": 500,
            "frustumCulled": False, "count": len(steps),
            "instanceMatrix": {"array": typed_array(matrices, "float32")},
        },
    })  # fmt: skip
    for name in (path, f"{path} line"):
        yield set_property(f"{name}/<object>", "castShadow", False)


def path_clips(path: str, points: Array, times: Array) -> list[dict[str, Any]]:
    """Return the animation of a path (m, 3) of `path_commands` over times (m,) in s."""
    if len(points) < 2:
        return []
    n_segments = min(len(points) - 1, SEGMENTS)
    track = {"name": ".count", "type": "number", "values": [0, n_segments], "times": [0.0, float(times[-1])]}
    return [{"path": f"{path}/<object>", "clip": {"fps": 1, "tracks": [track]}}]


def arrows(
    sol: "Solution", names: bool | str | Sequence[str], times: Array, deformation: float | None = None
) -> dict[str, Any]:
    """Return forces in N of closures on the bodies of their second frames, and of joints on their child bodies.

    Values and points of application (m, 3) each, with displacements of flexible bodies times a factor; and the largest
    force.

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
    forces = [
        {
            "name": r.name + ("" if all(r.unique[:3]) else " (minimum norm)"),
            "colour": ARROW,
            "points": _application_points(mech, r.name, sample.q, deformation),
            "values": r.force_world,
        }
        for r in found
    ]
    lengths = [np.linalg.norm(r.force_world, axis=1) for r in found]
    return {"largest": float(np.nanmax(lengths, initial=0.0)), "forces": forces}


def arrow_drawables(forces: Mapping[str, Any], extent: float) -> MovingDrawables:
    """Return shafts and heads of the arrows of forces, each from its point of application."""
    out, width = MovingDrawables([], [], "/mechanism/force"), SHAFT * extent
    for force in forces["forces"]:
        length = np.linalg.norm(force["values"], axis=1) * LONGEST * extent / (forces["largest"] or 1.0)
        rotation = aligned_quaternions(force["values"])
        unit = force["values"] / np.maximum(np.linalg.norm(force["values"], axis=1), TINY)[:, None]
        tip, shown = np.minimum(9 * width, 0.6 * length), Track((length > 0.1 * width)[:, None].astype(float))
        for name, kind, low, high, radius in (
            ("shaft", "cylinder", 0 * tip, length - tip, np.full_like(tip, width)),
            ("head", "cone", length - tip, length, tip / 3),
        ):
            size = np.maximum(np.column_stack([radius, radius, high - low]), COINCIDENT * extent)
            middle = force["points"] + unit * ((low + high) / 2)[:, None]
            name = f"{force['name'].replace('/', '|')} {name}"
            rgba = rgba_of(force["colour"])
            out.drawables.append(Drawable(name, primitive(kind, (1.0, 1.0)), rgba=rgba, style="mark"))
            out.motions.append({
                "position": Track(middle), "rotation": Track(rotation), "scale": Track(size), "visible": shown,
            })  # fmt: skip
    return out


def _application_points(mech: "Mechanism", name: str, q: Array, deformation: float | None) -> Array:
    """Return the points (m, 3) at which the force of a closure or a joint acts."""
    if name in {c.name for c in rolling_closures(mech)}:
        return contact_path(mech, name, q)
    frames = next((c.frames for c in mech.constraints if c.name == name), None)
    if frames:
        return frame_paths(with_scaled_deformation(mech.model, deformation), [frames[1]], q)[0]
    return joint_paths(mech.model, [name], q)[0]
