"""Picture of a mechanism: triangles with one light source, drawn from back to front."""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from ...solution.solution import Solution
from ...system import Array
from ...tolerances import TINY
from ..figures import WIDTH, empty_figure, fixed_layout
from .glb import GREY, SPRING, aligned_quaternions
from .solids import coil, coloured_surfaces, solid

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...mechanism.scene.scene import Scene

FRAMES = 60  # of a motion, from which the view is chosen
FLAT = 0.3  # of the widest extent: thinner scenes are drawn in orthographic projection along their thinnest axis
MAX_HEIGHT = 3.6  # inches
LIGHT = np.array([-0.35, 0.5, 0.79])  # direction to the light: right, up, towards the viewer


@fixed_layout
def posture(sol: Solution) -> "Figure":
    """Draw a mechanism at the start of a run, in the best view of its motion; with axes for a planar one."""
    from matplotlib.collections import PolyCollection

    sample = np.unique(np.linspace(0, len(sol.t) - 1, min(len(sol.t), FRAMES)).astype(int))
    scene = sol.mechanism.scene.travelled(sol.q[sample])
    thin = _plane(scene, sol.q[sample])
    view = _view(thin)
    found = list(_triangles(scene, sol.q[0]))
    corners = np.concatenate([c for c, _ in found]) @ view.T
    colours = np.concatenate([np.tile(rgba, (len(c), 1)) for c, rgba in found])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), TINY)[:, None]
    colours[:, :3] *= (0.5 + 0.5 * np.abs(normals @ LIGHT))[:, None]
    order = np.argsort(corners[:, :, 2].mean(axis=1))
    width, height, _ = np.ptp(corners.reshape(-1, 3), axis=0)
    figure = empty_figure(WIDTH, np.clip(0.9 * WIDTH * height / width, 0.8, MAX_HEIGHT - 0.5) + 0.5)
    ax: Any = figure.subplots()
    drawn = PolyCollection(corners[order][:, :, :2], facecolors=colours[order], edgecolors="face", linewidths=0.2)
    drawn.set_rasterized(True)
    ax.add_collection(drawn)
    ax.set_aspect("equal")
    ax.autoscale_view()
    if thin < 0:
        ax.set_axis_off()
    else:
        across, up = (name for k, name in enumerate("xyz") if k != thin)
        ax.set(xlabel=f"${across}$ (m)", ylabel=f"${up}$ (m)")
    return figure


def _view(thin: int) -> Array:
    """Return the axes of the picture (3, 3): right, up, and towards the viewer."""
    back = np.array([1, -1, 0.6]) if thin < 0 else np.eye(3)[thin] * (-1 if thin == 1 else 1)
    back /= np.linalg.norm(back)
    right = np.cross(np.eye(3)[1 if thin == 2 else 2], back)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(back, right), back])


def _plane(scene: "Scene", q: Array) -> int:
    """Return the normal axis of a planar motion q (m, nq); -1 for a spatial one."""
    placements = scene.placements(q)
    moving = [k for k, s in enumerate(scene.shapes) if np.ptp(placements[:, k], axis=0).any() and s.role != "closure"]
    points = np.concatenate([
        _transformed(np.array(list(product(*scene.shapes[k].bounds.T))), placement)
        for k in moving or range(len(scene.shapes))
        for placement in placements[:, k]
    ])  # fmt: skip
    size = np.ptp(points, axis=0)
    return int(size.argmin()) if size.min() < FLAT * size.max() else -1


def _triangles(scene: "Scene", q: Array) -> Iterator[tuple[Array, tuple[float, ...]]]:
    """Yield corners (n, 3, 3) in the world [m] and colours of all surfaces at q (nq,)."""
    for shape, placement in zip(scene.shapes, scene.placements(q), strict=True):
        for surface in coloured_surfaces(shape) if shape.role != "closure" else ():
            yield (
                _transformed(surface.points * shape.scale, placement)[surface.faces],
                shape.rgba or surface.rgba or GREY,
            )
    for spring, (begin, end) in zip(scene.springs, scene.end_points(scene.springs, q[None])[0], strict=True):
        length, (rotation,) = float(np.linalg.norm(end - begin)), aligned_quaternions((end - begin)[None])
        if spring.coil and length > 0:
            surface = coil(2.4 * scene.width, 0.5 * scene.width, length)
            yield _transformed(surface.points, [*begin, *rotation])[surface.faces], SPRING
        if spring.tube and length > 0:
            surface = solid("cylinder", (scene.width, length))
            yield _transformed(surface.points, [*(begin + end) / 2, *rotation])[surface.faces], GREY


def _transformed(points: Array, placement: Sequence[float] | Array) -> Array:
    """Return points (n, 3) of a frame with pose x, y, z and quaternion x, y, z, w, in the world."""
    return Rotation.from_quat(placement[3:]).apply(points) + placement[:3]
