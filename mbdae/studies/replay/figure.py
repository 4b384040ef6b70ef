"""Picture of a mechanism: triangles with one light source, drawn from back to front."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ...mechanism.scene.drawables import GREY, drawables, motions
from ...mechanism.scene.visible import VisiblePoints, sampled
from ...solution.solution import Solution
from ...system import Array
from ...tolerances import TINY
from ...units import displayed
from ..figures import WIDTH, empty_figure, fixed_layout
from .threejs import transform

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...mechanism.scene.scene import Scene

MAX_HEIGHT = 3.6  # inches
LIGHT = np.array([-0.35, 0.5, 0.79])  # direction to the light: right, up, towards the viewer


@fixed_layout
def posture(sol: Solution) -> "Figure":
    """Draw a mechanism at the start of a run, in the best view of its motion; with axes for a planar one."""
    from matplotlib.collections import PolyCollection

    q = sampled(sol.q)
    scene = sol.mechanism.scene.for_motion(q)
    thin = VisiblePoints(scene, q).visible().thin
    view = _view(thin)
    found = list(_triangles(scene, sol.q[0]))
    corners, unit = displayed(np.concatenate([c for c, _ in found]) @ view.T, "m")
    colours = np.concatenate([np.tile(rgba, (len(c), 1)) for c, rgba in found])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), TINY)[:, None]
    colours[:, :3] *= (0.5 + 0.5 * np.abs(normals @ LIGHT))[:, None]
    order = np.argsort(corners[:, :, 2].mean(axis=1))
    width, height, _ = np.ptp(corners.reshape(-1, 3), axis=0)
    figure = empty_figure(WIDTH, np.clip(0.9 * WIDTH * height / width, 0.8, MAX_HEIGHT - 0.5) + 0.5)
    ax: Any = figure.subplots()
    triangles = PolyCollection(corners[order][:, :, :2], facecolors=colours[order], edgecolors="face", linewidths=0.2)
    triangles.set_rasterized(True)
    ax.add_collection(triangles)
    ax.set_aspect("equal")
    ax.autoscale_view()
    if thin < 0:
        ax.set_axis_off()
    else:
        across, up = (name for k, name in enumerate("xyz") if k != thin)
        ax.set(xlabel=f"${across}$ ({unit})", ylabel=f"${up}$ ({unit})")
    return figure


def _view(thin: int) -> Array:
    """Return the axes of the picture (3, 3): right, up, and towards the viewer.

    ``thin`` is the index of the thinnest axis of a flat scene; -1 if the scene is not flat.
    """
    viewer = np.array([1, -1, 0.6]) if thin < 0 else np.eye(3)[thin] * (-1 if thin == 1 else 1)
    viewer /= np.linalg.norm(viewer)
    right = np.cross(np.eye(3)[1 if thin == 2 else 2], viewer)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(viewer, right), viewer])


def _triangles(scene: "Scene", q: Array) -> Iterator[tuple[Array, tuple[float, ...]]]:
    """Yield corners (n, 3, 3) in the world [m] and colours of all surfaces at q (nq,)."""
    for drawable, motion in zip(drawables(scene), motions(scene, q[None]), strict=True):
        pose_now = {key: track.values[0] for key, track in motion.items()}
        pose = transform(pose_now["position"], pose_now["rotation"], drawable.scale * pose_now.get("scale", np.ones(3)))
        stretch = pose_now.get("stretch", 0.0)
        for surface in drawable.solid.surfaces if drawable.style == "body" else ():
            displacement = drawable.solid.stretch
            points = surface.points if displacement is None else surface.points + stretch * displacement
            yield (points @ pose[:3, :3].T + pose[:3, 3])[surface.faces], drawable.rgba or surface.rgba or GREY
