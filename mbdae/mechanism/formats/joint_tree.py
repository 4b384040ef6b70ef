"""Copies of joint trees: in depth-first order, with locked or replaced joints, or merged from several trees."""

from collections.abc import Callable, Mapping

import numpy as np
import pinocchio as pin

from ...errors import InputError, UnknownNameError
from ..closures.closure import Axis, Z
from ..model_settings import coordinates
from ..tree.frames import find_joint
from ..tree.joints import PER_COORDINATE, PER_VELOCITY, is_depth_first, joint_transform, subspace

JOINT_MODELS: dict[str, Callable[[], pin.JointModel]] = {
    "spherical": pin.JointModelSpherical,
    "planar": pin.JointModelPlanar,
    "translation": pin.JointModelTranslation,
    "free": pin.JointModelFreeFlyer,
}


class Tree:
    """A model and its visuals, extended together.

    Attributes:
        model: the joints, bodies and frames.
        visuals: the visual geometry.
    """

    def __init__(self, name: str = "") -> None:
        self.model, self.visuals = pin.Model(), pin.GeometryModel()
        self.model.name = name

    def graft(
        self,
        model: pin.Model,
        visuals: pin.GeometryModel | None = None,
        *,
        parent: pin.Frame | None = None,
        placement: pin.SE3 | None = None,
        prefix: str = "",
        kinds: Mapping[str, str] | None = None,
        rotations: Mapping[str, pin.SE3] | None = None,
        locked: Mapping[str, np.ndarray] | None = None,
    ) -> "Tree":
        """Append a copy of a model, with joints in depth-first order, and return the tree.

        Args:
            model: the model, which remains unchanged.
            visuals: its visuals, which remain unchanged.
            parent: frame of this tree to which the copy is attached; the world if omitted.
            placement: placement of the world of the copy in the parent frame.
            prefix: added to the name of every joint, frame and visual.
            kinds: new kinds of joints, by their old names, at the same placement.
            rotations: placements of joints in their old frames, by their old names; bodies keep their placement.
            locked: configurations of joints to lock, by their old names.

        Raises:
            UnknownNameError: for an unknown joint.
            InputError: for a duplicate name.
        """
        kinds, rotations, locked = kinds or {}, rotations or {}, locked or {}
        for name in (*kinds, *rotations, *locked):
            find_joint(model, name)
        base = (parent.placement if parent else pin.SE3.Identity()) * (placement or pin.SE3.Identity())
        new_index = {0: parent.parentJoint if parent else 0}  # new index of each old joint
        placements = {0: base}  # placement of each old joint frame in the new joint frame
        append_body(self.model, new_index[0], model.inertias[0], base)
        for j in _depth_first_order(model, 0):
            old, name = model.joints[j], model.names[j]
            new_parent, placement = new_index[model.parents[j]], placements[model.parents[j]] * model.jointPlacements[j]
            if name in locked:
                new_index[j], placements[j] = new_parent, placement * joint_transform(old, locked[name])
            else:
                new = replacement_joint(old, name, kinds[name]) if name in kinds else old
                rotation = rotations.get(name, pin.SE3.Identity())
                new_index[j] = self._add_joint(new_parent, new, placement * rotation, prefix + name)
                placements[j] = rotation.inverse()
                _copy_arrays(self.model, self.model.joints[new_index[j]], model, old)
            append_body(self.model, new_index[j], model.inertias[j], placements[j])
        frames = self._copy_frames(model, new_index, placements, prefix, set(locked), parent)
        for g in visuals.geometryObjects if visuals is not None else ():
            self._copy_visual(g, new_index, placements, prefix, frames)
        return self

    def _add_joint(self, new_parent: int, joint: pin.JointModel, placement: pin.SE3, name: str) -> int:
        if name != "universe" and self.model.existJointName(name):
            raise InputError(f"two joints are called {name!r}: give one source a prefix")
        return int(self.model.addJoint(new_parent, joint, placement, name))

    def _copy_frames(
        self,
        model: pin.Model,
        new_index: dict[int, int],
        placements: dict[int, pin.SE3],
        prefix: str,
        locked: set[str],
        parent: pin.Frame | None,
    ) -> dict[int, int]:
        """Copy the frames, and return their new indices."""
        frames = {0: self.model.getFrameId(parent.name, parent.type) if parent else 0}
        existing = {(f.name, f.type) for f in self.model.frames}
        for i, f in enumerate(list(model.frames)[1:], 1):
            name, j = prefix + f.name, int(f.parentJoint)
            kind = pin.FrameType.FIXED_JOINT if f.type == pin.FrameType.JOINT and f.name in locked else f.type
            if (name, kind) in existing:
                raise InputError(f"two frames are called {name!r}: give one source a prefix")
            parent_frame, placement = frames.get(int(f.parentFrame), 0), placements[j] * f.placement
            copy = pin.Frame(name, new_index[j], parent_frame, placement, kind, f.inertia)
            frames[i] = int(self.model.addFrame(copy, False))
        return frames

    def _copy_visual(
        self,
        geometry: pin.GeometryObject,
        new_index: dict[int, int],
        placements: dict[int, pin.SE3],
        prefix: str,
        frames: dict[int, int],
    ) -> None:
        g, joint = geometry.copy(), int(geometry.parentJoint)
        g.name, g.parentJoint = prefix + g.name, new_index[joint]
        g.placement, g.parentFrame = placements[joint] * g.placement, frames.get(int(g.parentFrame), 0)
        self.visuals.addGeometryObject(g)


def append_body(model: pin.Model, joint: int, inertia: pin.Inertia, placement: pin.SE3) -> None:
    """Add a body to a joint; the first body in the joint's frame is added without rounding."""
    if not (inertia.mass or inertia.inertia.any()):
        return
    if model.inertias[joint] == pin.Inertia.Zero() and placement == pin.SE3.Identity():
        model.inertias[joint] = inertia
    else:
        model.appendBodyToJoint(joint, inertia, placement)


def resolve_joints(
    model: pin.Model,
    visuals: pin.GeometryModel | None,
    kinds: Mapping[str, str],
    lock: Mapping[str, object],
    normals: Mapping[str, Axis] | None = None,
) -> tuple[pin.Model, pin.GeometryModel | None]:
    """Return the model with replaced and locked joints, in depth-first order.

    Pinocchio's planar joint moves in its frame's xy plane: the frame of a joint with a normal, or one that replaces a
    joint with an axis, is rotated accordingly.

    Args:
        model: the model, which remains unchanged.
        visuals: its visuals, which remain unchanged.
        kinds: new kinds of joints by name.
        lock: values of locked joints by name.
        normals: normals of the planes of planar joints, in the joint frames, by name.

    Raises:
        UnknownNameError, InputError: for an unknown joint or a wrong number of values.
    """
    gravity, name = model.gravity, model.name
    axes = {n: axis for n, axis in (normals or {}).items() if kinds.get(n, "planar") == "planar"}
    axes |= {n: _axis(find_joint(model, n)) for n, kind in kinds.items() if kind == "planar" and n not in axes}
    if kinds or axes:
        rotations = {n: rotation_from_z(axis) for n, axis in axes.items()}
        tree = Tree(name).graft(model, visuals, kinds=kinds, rotations=rotations)
        model, visuals = tree.model, tree.visuals
    if lock:
        q = coordinates(model, lock)[0]
        joints = {n: find_joint(model, n) for n in lock}
        values = {n: q[j.idx_q : j.idx_q + j.nq] for n, j in joints.items()}
        tree = Tree(name).graft(model, visuals, locked=values)
        model, visuals = tree.model, tree.visuals
    model, visuals = depth_first(model, visuals)
    model.gravity = gravity
    return model, visuals


def depth_first(
    model: pin.Model, visuals: pin.GeometryModel | None = None
) -> tuple[pin.Model, pin.GeometryModel | None]:
    """Return the model with its joints in depth-first order; the same object if they already are."""
    if is_depth_first(model):
        return model, visuals
    tree = Tree(model.name).graft(model, visuals)
    tree.model.gravity = model.gravity
    return tree.model, None if visuals is None else tree.visuals


def replacement_joint(old: pin.JointModel, name: str, kind: str) -> pin.JointModel:
    """Return a joint of another kind as a replacement.

    A revolute joint keeps the axis; a universal joint rotates about axes of the joint frame, x then y unless its name
    specifies otherwise.

    Raises:
        InputError: for a revolute joint that replaces a joint without an axis of rotation.
    """
    if kind in JOINT_MODELS:
        return JOINT_MODELS[kind]()
    if kind.startswith("universal"):
        first, second = (np.eye(3)["xyz".index(c)] for c in (kind.removeprefix("universal_") if "_" in kind else "xy"))
        return pin.JointModelUniversal(first, second)
    if kind != "revolute":
        raise UnknownNameError("kind of joint", kind, [*JOINT_MODELS, "revolute", "universal"])
    axis = subspace(old)[3:, 0] if old.nv == 1 else np.zeros(3)
    if not axis.any():
        raise InputError(f"joint {name!r} has no axis of rotation: it cannot become revolute")
    return pin.JointModelRevoluteUnaligned(axis)


def rotation_from_z(axis: Axis) -> pin.SE3:
    """Return the shortest rotation that maps z to an axis."""
    return pin.SE3(pin.Quaternion.FromTwoVectors(pin.ZAxis, np.array(axis) / np.linalg.norm(axis)), np.zeros(3))


def _axis(joint: pin.JointModel) -> Axis:
    """Return the axis of a joint with one coordinate, in its frame; z for other joints."""
    if joint.nv != 1:
        return Z
    x, y, z = np.sum(subspace(joint).reshape(2, 3), 0)  # either the linear or the angular part is zero
    return float(x), float(y), float(z)


def _copy_arrays(model: pin.Model, new: pin.JointModel, source: pin.Model, old: pin.JointModel) -> None:
    """Copy the values of a joint; a common value is used for all coordinates of a joint of another kind."""
    for name in PER_VELOCITY:
        values = np.array(getattr(source, name)[old.idx_v : old.idx_v + old.nv])
        if old.nv == new.nv or len(set(values.tolist())) == 1:
            getattr(model, name)[new.idx_v : new.idx_v + new.nv] = values if old.nv == new.nv else values[0]
    if (old.nq, old.nv) == (new.nq, new.nv):
        for name in PER_COORDINATE:
            values = np.array(getattr(source, name)[old.idx_q : old.idx_q + old.nq])
            getattr(model, name)[new.idx_q : new.idx_q + new.nq] = values


def _depth_first_order(model: pin.Model, j: int) -> list[int]:
    out, waiting = [], list(model.children[j])[::-1]
    while waiting:
        k = int(waiting.pop())
        out.append(k)
        waiting += list(model.children[k])[::-1]
    return out
