"""The replay: one HTML file that shows a solution moving, offline and without a server.

The page is ``replay.htm`` with two gzipped blocks filled in: meshcat's viewer, and the scene as meshcat's
own commands. The browser unpacks both; the motion is a meshcat animation in real time.
"""

import base64
import gzip
import html
import re
import warnings
from collections.abc import Iterator
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import umsgpack

from ..errors import InputError
from ..files import write_whole
from .threejs import mesh_data, scene_object, typed

with warnings.catch_warnings():  # meshcat imports its server, unused here, and that a deprecated module
    warnings.simplefilter("ignore", DeprecationWarning)
    import meshcat
    import meshcat.animation
    import meshcat.commands
    from meshcat.path import Path as Node
    from meshcat.transformations import quaternion_matrix

if TYPE_CHECKING:
    from ..mechanism.visuals import Mesh, Scene
    from ..solution import Solution

MIN_FRAMES = 101  # what is short is often looked at slowly


def animate(sol: "Solution", path: str | Path, *, fps: float = 60.0, speed: float = 1.0) -> Path:
    """Writes a solution as a self-contained HTML page that plays in any browser.

    The page starts playing, and repeats. Its script offers ``window.mbdae`` with ``seek(t)``, ``play()``,
    ``pause()``, ``t``, ``start``, ``duration`` and ``viewer``; ``page.html#t=1.5`` opens it at that time,
    standing still.

    Args:
        sol: the solution; shown from its first to its last time.
        path: where the page goes; an existing file is replaced, whole or not at all.
        fps: frames stored per second of viewing.
        speed: seconds of motion per second of viewing; below 1 is slow motion.

    Returns:
        The path written.

    Raises:
        InputError: the solution is empty or not finite, ``fps`` or ``speed`` is not a positive number, or
            the file cannot be written.
    """
    text = page(sol, fps=fps, speed=speed)
    with write_whole(path) as draft:
        draft.write_text(text, "utf-8")
    return Path(path)


def page(sol: "Solution", *, fps: float = 60.0, speed: float = 1.0) -> str:
    """Returns the page that `animate` writes.

    Raises:
        InputError: as `animate`.
    """
    for name, value in (("fps", fps), ("speed", speed)):
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"{name} must be a positive number, not {value!r}")
    mechanism = sol.mechanism
    times, q = _frames(sol, fps / speed)
    scene = mechanism.scene
    placements = scene.placements(q)
    meshes = list(dict.fromkeys(shape.mesh for shape in scene.shapes if shape.mesh is not None))
    payload = {
        "meshes": [mesh_data(mesh) for mesh in meshes],
        "commands": list(_commands(scene, meshes, times, placements)),
        "start": float(times[0]),
        "end": float(times[-1]),
        "speed": float(speed),
        "bounds": _bounds(scene, placements),
    }
    viewer = Path(meshcat.viewer_assets_path(), "dist", "main.min.js").read_bytes()
    filling = {
        "title": html.escape(mechanism.title),
        "viewer": _compressed(viewer),
        "scene": _compressed(umsgpack.packb(payload)),
    }
    return _page(filling)


def frame(text: str, height: int = 480) -> str:
    """Returns a page as an inline frame for a notebook or for another page."""
    style = f"width: 100%; height: {height}px; border: 0"
    return f'<iframe srcdoc="{html.escape(text)}" title="replay" style="{style}"></iframe>'


def notebook(sol: "Solution") -> str:
    """Returns the replay of a solution as a notebook shows it."""
    return frame(page(sol, fps=30.0))


def _frames(sol: "Solution", rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Uniform times (m,) and the configurations (m, nq) there."""
    if len(sol.t) == 0:
        raise InputError("the solution is empty: there is no motion to show")
    if len(sol.t) == 1:
        times, q = np.asarray(sol.t, dtype=float), np.asarray(sol.q, dtype=float)
    else:
        start, end = float(sol.t[0]), float(sol.t[-1])
        times = np.linspace(start, end, max(MIN_FRAMES, int(np.ceil(abs(end - start) * rate)) + 1))
        q = np.array([sol(t)[0] for t in times])
    bad = ~np.isfinite(q).all(axis=1)
    if bad.any():
        raise InputError(f"the solution is not finite at t = {times[bad.argmax()]:g}")
    return times, q


def _commands(
    scene: "Scene", meshes: list["Mesh"], times: np.ndarray, placements: np.ndarray
) -> Iterator[dict[str, Any]]:
    """Yields meshcat's commands, lowered: the objects, where they start, and how they move."""
    animation = meshcat.animation.Animation()
    clock = np.abs(times - times[0])
    for k, (shape, track) in enumerate(zip(scene.shapes, placements.swapaxes(0, 1), strict=True)):
        # The node moves; its object keeps the scale, which an animation of the node would overwrite.
        node = Node(("mechanism", shape.role, shape.name.replace("/", "|")))
        layer = len(scene.shapes) - k if shape.role == "closure" else 0
        yield {"type": "set_object", "path": node.lower(), "object": scene_object(shape, meshes, layer)}
        x, y, z, w = track[0, 3:]
        matrix = quaternion_matrix([w, x, y, z])
        matrix[:3, 3] = track[0, :3]
        yield meshcat.commands.SetTransform(matrix, node).lower()
        if np.ptp(track, axis=0).any():
            clip = meshcat.animation.AnimationClip(fps=1)
            clip.tracks = {
                "position": _Track("position", "vector3", clock, track[:, :3]),
                "quaternion": _Track("quaternion", "quaternion", clock, _continuous(track[:, 3:])),
            }
            animation.clips[node] = clip
    if animation.clips:
        yield meshcat.commands.SetAnimation(animation, play=False, repetitions=float("inf")).lower()


class _Track(meshcat.animation.AnimationTrack):
    """A track as two flat arrays, a fraction of the size of meshcat's list of keys."""

    def lower(self) -> dict[str, Any]:
        times, values = typed(self.frames, "float32"), typed(self.values, "float32")
        return {"name": "." + self.name, "type": self.jstype, "times": times, "values": values}


def _continuous(quaternions: np.ndarray) -> np.ndarray:
    """Unit quaternions (m, 4) with signs such that neighbours are near each other."""
    dots = np.einsum("ij,ij->i", quaternions[1:], quaternions[:-1])
    signs = np.cumprod(np.concatenate([[1.0], np.where(dots < 0, -1.0, 1.0)]))
    return quaternions * signs[:, None]


def _bounds(scene: "Scene", placements: np.ndarray) -> list[list[float]]:
    """Lower and upper corner [m] of the box that holds the whole motion."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for shape, track in zip(scene.shapes, placements.swapaxes(0, 1), strict=True):
        corners = np.array(list(product(*shape.bounds.T)))
        axis, w = track[:, None, 3:6], track[:, None, 6:]
        twist = 2 * np.cross(axis, corners[None])
        world = track[:, None, :3] + corners + w * twist + np.cross(axis, twist)
        low, high = np.minimum(low, world.min((0, 1))), np.maximum(high, world.max((0, 1)))
    return [low.tolist(), high.tolist()] if scene.shapes else [[-0.5] * 3, [0.5] * 3]


def _compressed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode("ascii")


def _page(filling: dict[str, str]) -> str:
    page = files(__package__).joinpath("replay.htm").read_text("utf-8")
    return re.sub(r"{{(\w+)}}", lambda key: filling[key[1]], page)
