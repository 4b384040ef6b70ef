"""Appearance of a mechanism: primitive shapes, and their placements at a configuration.

A `Scene` contains data for any viewer, independent of Pinocchio: the shapes, and their placements
`Scene.placements(q)` at each instant.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ...errors import InputError
from ..tree.pinocchio_data import make_data
from ..tree.tree_terms import update_motions
from .flexible_models import with_scaled_deformation
from .meshes import Mesh

Anchor = tuple[int, pin.SE3]  # a joint, and a placement fixed in its frame


class Mark(NamedTuple):
    """A closure in a scene, with two anchors that coincide while the loop is closed.

    Attributes:
        name: name of the closure.
        first: joint and placement of the first anchor.
        second: joint and placement of the second anchor.
        rod: length of the massless rod of a distance closure [m], 0 for none.
        axis: axis of a hinge, (3,) in the first anchor; None for rotation about several axes.
        coincide: whether both anchors coincide in the closed loop, so that their distance is a violation.
    """

    name: str
    first: Anchor
    second: Anchor
    rod: float = 0.0
    axis: np.ndarray | None = None
    coincide: bool = True


class Rod(NamedTuple):
    """A straight rigid rod between two anchors.

    Attributes:
        name: name of its closure, or of its flexible body.
        first: joint and placement of the first anchor.
        second: joint and placement of the second anchor.
        length: length in m.
    """

    name: str
    first: Anchor
    second: Anchor
    length: float


class Strut(NamedTuple):
    """A force element between two points.

    Attributes:
        name: name of the force.
        first: joint and placement of the first anchor.
        second: joint and placement of the second anchor.
        length: rest length [m]; 0 when unknown.
        coil: whether it is drawn as a coil.
        tube: whether it is drawn as a telescopic tube: dampers, cylinders.
    """

    name: str
    first: Anchor
    second: Anchor
    length: float = 0.0
    coil: bool = True
    tube: bool = False


@dataclass(frozen=True, eq=False)
class Shape:
    """One rigid shape in its local frame (axes of symmetry along z).

    Attributes:
        name: unique within a scene.
        role: ``"visual"``, ``"link"``, ``"joint"``, ``"ground"``, ``"rail"`` or ``"closure"``.
        kind: ``"box"``, ``"sphere"``, ``"ellipsoid"``, ``"cylinder"``, ``"cone"``, ``"capsule"`` or
            ``"mesh"``.
        size: [m] box: three edges; sphere: radius; ellipsoid: three radii; cylinder, cone: radius and
            length; capsule: radius and length between the centres of its caps; mesh: empty.
        rgba: colour, each in [0, 1]; None for a mesh with the colours of its file.
        bounds: (2, 3) lower and upper corner of the shape, in its frame [m].
        mesh: the triangles of a mesh.
        scale: (3,) factors from mesh coordinates to metres, negative for mirrored axes.
    """

    name: str
    role: str
    kind: str
    size: tuple[float, ...]
    rgba: tuple[float, ...] | None
    bounds: np.ndarray
    mesh: Mesh | None = None
    scale: tuple[float, ...] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Scene:
    """The shapes of a mechanism, and their placements.

    Attributes:
        shapes: n shapes.
        anchors: anchors of each shape: one if it is fixed to a joint, two if it extends between them.
        width: radius of generated links [m].
        marks: closures between frames, whose anchors are shapes of the role ``"closure"``.
        springs: s elements between two points, whose length changes with the motion.
        ground: height of the ground [m]; None if unspecified.
    """

    shapes: tuple[Shape, ...]
    _model: pin.Model
    anchors: tuple[tuple[Anchor, ...], ...]
    width: float
    marks: tuple[Mark, ...] = ()
    springs: tuple[Strut, ...] = ()
    ground: float | None = None
    _rails: Mapping[int, int] = field(default_factory=dict)  # joint on each rail, by the index of its shape

    @property
    def carriers(self) -> list[tuple[int, ...]]:
        """Joints of each shape: one, or two for a shape between two joints."""
        return [tuple(joint for joint, _ in anchors) for anchors in self.anchors]

    def with_scaled_deformation(self, factor: float | None) -> "Scene":
        """Return the scene with displacements of flexible bodies multiplied by a factor; unchanged for None."""
        return replace(self, _model=with_scaled_deformation(self._model, factor))

    def placements(self, q: np.ndarray) -> np.ndarray:
        """Return the placements of the shapes in the world.

        Args:
            q: (nq,) a configuration, or (m, nq) several.

        Returns:
            (n, 7) or (m, n, 7): x, y, z [m] and the unit quaternion x, y, z, w of each shape.

        Raises:
            InputError: q has another length.
        """
        q = np.asarray(q, dtype=float)
        if q.ndim not in (1, 2) or q.shape[-1] != self._model.nq:
            raise InputError(f"q must have shape ({self._model.nq},) or (m, {self._model.nq}), not {q.shape}")
        data = make_data(self._model)
        out = np.empty((*q.shape[:-1], len(self.shapes), 7))
        for row, pose in zip(np.atleast_2d(q), out.reshape(-1, len(self.shapes), 7), strict=True):
            update_motions(self._model, data, row)
            for k, anchors in enumerate(self.anchors):
                ends = [data.oMi[joint] * placement for joint, placement in anchors]
                placement = ends[0] if len(ends) == 1 else _towards(ends[0], ends[1], self.shapes[k].size[1])
                pose[k] = pin.SE3ToXYZQUAT(placement)
        return out

    def end_points(self, pairs: Iterable[Mark | Strut], q: np.ndarray) -> np.ndarray:
        """Return the end points of closures or springs.

        Args:
            pairs: s elements of ``marks`` or ``springs``.
            q: (m, nq) configurations.

        Returns:
            (m, s, 2, 3) points of the world [m].
        """
        anchors = [(pair.first, pair.second) for pair in pairs]
        data, out = make_data(self._model), np.empty((len(q), len(anchors), 2, 3))
        for row, points in zip(q, out, strict=True):
            update_motions(self._model, data, row)
            for k, pair in enumerate(anchors):
                points[k] = [(data.oMi[joint] * placement).translation for joint, placement in pair]
        return out

    def for_motion(self, q: np.ndarray) -> "Scene":
        """Return the scene for a motion, with rails as long as the strokes of their sliders, and lengths of springs.

        Springs of unknown rest length get the median length of the motion; springs of zero length are omitted.

        Args:
            q: (m, nq) configurations of the motion.
        """
        shapes, anchors = list(self.shapes), list(self.anchors)
        for k, joint in self._rails.items():
            at = q[:, self._model.idx_qs[joint]]
            (radius, length), ((ground, middle),) = shapes[k].size, anchors[k]
            half = min(length, np.ptp(at) + 14 * self.width) / 2
            offset = self._model.jointPlacements[joint].translation - middle.translation
            shift = (at.min() + at.max()) / 2 + middle.rotation[:, 2] @ offset
            bounds = shapes[k].bounds * [1, 1, 2 * half / length]
            shapes[k] = replace(shapes[k], size=(radius, 2 * half), bounds=bounds)
            anchors[k] = ((ground, middle * pin.SE3(np.eye(3), np.array([0.0, 0.0, shift]))),)
        lengths = np.linalg.norm(np.diff(self.end_points(self.springs, q), axis=2)[:, :, 0], axis=2)
        median = [float(np.median(x)) for x in lengths.T]
        springs = [s._replace(length=s.length or x) for s, x in zip(self.springs, median, strict=True)]
        springs = [s for s in springs if s.length > 0]
        return replace(self, shapes=tuple(shapes), anchors=tuple(anchors), springs=tuple(springs))


def _towards(first: pin.SE3, second: pin.SE3, length: float) -> pin.SE3:
    """Return the frame at the middle of a rod of given length, from one point towards another, with z along the rod."""
    d = second.translation - first.translation
    rotation = pin.Quaternion.FromTwoVectors(pin.ZAxis, d) if d.any() else pin.Quaternion.Identity()
    return pin.SE3(rotation, first.translation + rotation * np.array([0.0, 0.0, length / 2]))
