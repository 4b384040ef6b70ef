"""The scene of a live view, as commands of meshcat."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ...mechanism.scene.coarse import coarse
from ...mechanism.scene.drawables import Drawable, Track, aligned_quaternions, drawables, motions, primitive
from ...mechanism.scene.visible import VisiblePoints, bounds
from ...system import Array
from ..replay.surroundings import GROUND, SUN, ground_levels, surroundings
from ..replay.threejs import draw_commands, pose_commands, set_property

if TYPE_CHECKING:
    from ...mechanism.scene.scene import Scene

SUN_POSITION = np.array([0.2, -0.8, 2.8])  # position relative to the mechanism, in extents
CAMERA_POSITION = 0.6 * np.array([0.9, -0.9, 0.55])  # position relative to the mechanism, in extents
COARSE = 4000  # number of triangles of coarse bodies
PULL = Drawable("pull", primitive("cylinder", (1.0, 1.0)), rgba=(0.76, 0.09, 0.36, 1.0), style="mark")


class LiveScene:
    """The drawables of a mechanism, and a line from a pulled point to its target.

    Args:
        scene: scene of the mechanism.
        q: configuration (nq,) at the start, from which the camera is chosen.
        shadows: whether bodies cast shadows.

    Attributes:
        bodies: the supporting joint of each drawable, by name; without fixed drawables and those between two joints.
        camera: position and target in m.
        coarse: whether bodies are drawn with fewer triangles, see `coarsen`.
    """

    def __init__(self, scene: "Scene", q: Array, shadows: bool) -> None:
        self.scene, self.shadows, self.coarse = scene.for_motion(q[None]), shadows, False
        self.drawables = drawables(self.scene)
        self.box, self.extent = bounds(self.scene, q[None]), VisiblePoints(self.scene, q[None]).visible().extent
        pairs = zip(self.drawables, self.scene.carriers, strict=False)
        self._fixed = {d.name for d, joints in pairs if joints == (0,)}
        self._start = motions(self.scene, q[None])
        carriers = zip(self.drawables, self.scene.carriers, strict=False)
        self.bodies = {d.name: joints[0] for d, joints in carriers if len(joints) == 1 and joints[0]}
        middle = self.box.mean(axis=0)
        self.camera = {"position": (middle + self.extent * CAMERA_POSITION).tolist(), "target": middle.tolist()}

    def commands(self) -> Iterator[dict[str, Any]]:
        """Yield the commands that draw the scene, without marks of closures."""
        yield from surroundings(self.extent)
        sun = self.box.mean(axis=0) + self.extent * SUN_POSITION
        yield set_property(f"{SUN}/<object>", "position", sun.tolist())
        yield set_property(f"{SUN}/<object>", "castShadow", self.shadows)
        level = ground_levels(self.box, self.extent, self.scene.ground)["top"]
        yield set_property(GROUND, "position", [*self.box.mean(axis=0)[:2].tolist(), level])
        yield from draw_commands([*(d for d in self.drawables if d.style != "closure"), PULL])
        yield from self._place_fixed()

    def redraw(self) -> Iterator[dict[str, Any]]:
        """Yield the commands that draw all bodies again, for other dimensions."""
        yield from draw_commands([d for d in self.drawables if d.style != "closure"])
        yield from self._place_fixed()

    def _place_fixed(self) -> Iterator[dict[str, Any]]:
        """Yield the commands that place the drawables that do not move."""
        fixed = [(d, m) for d, m in zip(self.drawables, self._start, strict=True) if d.name in self._fixed]
        yield from pose_commands([d for d, _ in fixed], [motion for _, motion in fixed])

    def coarsen(self) -> Iterator[dict[str, Any]]:
        """Yield the commands that draw the bodies with fewer triangles, for a page that is slow."""
        self.drawables, self.coarse = coarse(self.drawables, COARSE), True
        yield from draw_commands([d for d in self.drawables if d.style != "closure"])

    def frame(self, q: Array, line: Array | None) -> Iterator[dict[str, Any]]:
        """Yield the commands that move the scene to q (nq,), and a line (2, 3) if a point is pulled."""
        moved = zip(self.drawables, motions(self.scene, q[None]), strict=True)
        shown = [(d, motion) for d, motion in moved if d.style != "closure" and d.name not in self._fixed]
        yield from pose_commands([d for d, _ in shown], [motion for _, motion in shown])
        yield set_property("/mechanism/pull", "visible", line is not None)
        if line is not None:
            vector, width = line[1] - line[0], 0.5 * self.scene.width
            scale = np.array([[width, width, max(float(np.linalg.norm(vector)), width)]])
            motion = {
                "position": Track(line.mean(axis=0)[None]),
                "rotation": Track(aligned_quaternions(vector[None])),
                "scale": Track(scale),
            }
            yield from pose_commands([PULL], [motion])
