"""Build a Pinocchio model from the sources and the tables of a mechanism file."""

from collections.abc import Sequence
from typing import NoReturn

import numpy as np
import pinocchio as pin

from ....errors import InputError, UnknownNameError, printable
from ...checked_table import HUGE
from ...flexible import attach_flexible
from ...imported_model import ImportedModel
from ...tree.frames import find_frame, find_joint, frame_names, joint_names
from ..body_tables import Body, Flexible, Frame, Source
from ..joint_tree import JOINT_MODELS, Tree, append_body, depth_first, resolve_joints, rotation_from_z
from .flexible_table import modal_body_of
from .inertias import checked_inertia
from .schema import MechanismFile


def build(
    file: MechanismFile, models: Sequence[ImportedModel], name: str
) -> tuple[pin.Model, pin.GeometryModel | None]:
    """Return the model and its visuals, with sources, extra bodies and frames, replaced joints and locked joints.

    Args:
        file: the mechanism file.
        models: the imported models of its sources.
        name: name of the model.

    Raises:
        UnknownNameError: for an unknown frame or joint.
        InputError: for a duplicate name, circular parents of frames, or numbers that are not finite.
    """
    tree = Tree(models[0].model.name if len(models) == 1 else name)
    _attach(tree, file, models)
    tree.model.gravity.linear = np.array(file.gravity)
    if not (tree.model.nv or file.flexible):
        raise InputError(f"{name} has no joints that move; a URDF gets one by free_flyer = true in a mechanism file")
    require_finite(tree.model)
    require_printable_names(tree.model)
    normals = {s.prefix + n: axis for s, m in zip(file.source, models, strict=True) for n, axis in m.normals.items()}
    model, visuals = resolve_joints(tree.model, tree.visuals, file.joint_type, file.lock, normals)
    model, visuals = _with_flexible_bodies(model, visuals, file.flexible)
    return model, visuals if visuals is not None and len(visuals.geometryObjects) else None


def _with_flexible_bodies(
    model: pin.Model, visuals: pin.GeometryModel | None, tables: Sequence[Flexible]
) -> tuple[pin.Model, pin.GeometryModel | None]:
    """Return the model with flexible bodies, in depth-first order."""
    for x in tables:
        parent = find_frame(model, x.parent)
        pose_in_joint = parent.placement * placement(x)
        joint = None if x.joint == "fixed" else _joint(x)
        attach_flexible(model, x.name, modal_body_of(x), joint, parent.parentJoint, pose_in_joint)
    if not tables:
        return model, visuals
    bodies = model.flexible
    model, visuals = depth_first(model, visuals)
    model.flexible = bodies
    return model, visuals


def _attach(tree: Tree, file: MechanismFile, models: Sequence[ImportedModel]) -> None:
    """Attach sources, bodies and frames, each after its parent frame."""
    waiting: list[tuple[Source | Frame, ImportedModel | None]] = [*zip(file.source, models, strict=True)]
    waiting += [(x, None) for x in (*file.body, *file.frame)]
    known = set(frame_names(tree.model))
    while waiting:
        ready = [pair for pair in waiting if pair[0].parent in known]
        if not ready:
            _raise_unattached(waiting, frame_names(tree.model), file.flexible)
        waiting = [pair for pair in waiting if pair[0].parent not in known]
        for x, imported in ready:
            if isinstance(x, Frame):
                if x.name in known or x.name == "universe":
                    raise InputError(f"the name {x.name!r} is taken: frames and bodies need different names")
                _add(tree.model, x)
                known.add(x.name)
            elif imported is not None:
                parent = find_frame(tree.model, x.parent)
                tree.graft(imported.model, imported.visuals, parent=parent, placement=placement(x), prefix=x.prefix)
                known.update(frame_names(tree.model))


def require_finite(model: pin.Model) -> None:
    """Reject inertias and placements that are not finite, and negative masses and damping coefficients.

    Raises:
        InputError: for an infinite or extremely large value, or a negative mass or damping coefficient.
    """
    for name, inertia, pose_in_joint in zip(model.names, model.inertias, model.jointPlacements, strict=True):
        numbers = [inertia.mass, *inertia.lever, *inertia.inertia.ravel(), *pose_in_joint.homogeneous.ravel()]
        if not np.abs(numbers).max() <= HUGE:
            raise InputError(f"the inertia or placement of joint {name!r} is not finite, or beyond {HUGE:g}")
        if inertia.mass < 0:
            raise InputError(f"the mass carried by joint {name!r} is negative: {inertia.mass:g} kg")
    for name in joint_names(model):
        joint = find_joint(model, name)
        if (damping := min(model.damping[joint.idx_v : joint.idx_v + joint.nv])) < 0:
            raise InputError(f"the damping of joint {name!r} is negative: {damping:g}")


def require_printable_names(model: pin.Model) -> None:
    """Reject names of joints and frames with control characters, which could affect a terminal.

    Raises:
        InputError: for a name with control characters.
    """
    for name in (*model.names, *(f.name for f in model.frames)):
        if printable(name) != name:
            raise InputError(f"the name {name!r} contains control characters")


def _raise_unattached(
    waiting: Sequence[tuple[Source | Frame, ImportedModel | None]], known: Sequence[str], bodies: Sequence[Flexible]
) -> NoReturn:
    """Raise an error for frames whose parent is unknown, flexible or a descendant."""
    names = [x.name for x, _ in waiting if isinstance(x, Frame)]
    for parent in (x.parent for x, _ in waiting):
        for body in bodies:
            if parent == body.name or parent.startswith(f"{body.name}."):
                remedy = "give the child a free joint, and weld it to a node by a closure of kind 'frame'"
                raise InputError(f"{parent!r} cannot be a parent: {body.name!r} is flexible; {remedy}")
    unknown = [x.parent for x, _ in waiting if x.parent not in names]
    if unknown or not names:
        raise UnknownNameError("frame", unknown[0], known)
    raise InputError(f"frames are attached to each other and not to the world: {', '.join(names)}")


def placement(x: Source | Frame) -> pin.SE3:
    """Return the placement from ``xyz`` and ``rpy``."""
    return pin.SE3(pin.rpy.rpyToMatrix(np.array(x.rpy)), np.array(x.xyz))


def _add(model: pin.Model, x: Frame) -> None:
    parent = find_frame(model, x.parent)
    pose_in_joint = parent.placement * placement(x)
    joint = parent.parentJoint
    if isinstance(x, Body):
        inertia = body_inertia(x)
        if x.joint != "fixed":
            moving, rotation = _joint(x), _joint_rotation(x)
            joint, pose_in_joint = model.addJoint(joint, moving, pose_in_joint * rotation, x.name), rotation.inverse()
        if inertia is not None:
            append_body(model, joint, inertia, pose_in_joint)
    kind = pin.FrameType.BODY if isinstance(x, Body) else pin.FrameType.OP_FRAME
    model.addFrame(pin.Frame(x.name, joint, pose_in_joint, kind), False)  # adding its zero inertia would round the sum


def body_inertia(x: Body) -> pin.Inertia | None:
    """Return the inertia from ``mass``, ``com`` and ``inertia``; None if there is none.

    Raises:
        InputError: see `checked_inertia`.
    """
    ixx, iyy, izz, ixy, ixz, iyz = x.inertia
    tensor = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    if x.mass == 0 and not tensor.any():
        return None
    return checked_inertia(x.mass, np.array(x.com), tensor, f"body {x.name!r}")


def _joint(x: Body | Flexible) -> pin.JointModel:
    axis = np.array(x.axis)
    if not np.linalg.norm(axis) > 0:
        raise InputError(f"the axis of body {x.name!r} is zero")
    axis = axis / np.linalg.norm(axis)
    match x.joint:
        case "revolute":
            return pin.JointModelRevoluteUnaligned(axis)
        case "continuous":
            return pin.JointModelRUBZ()  # about z of a rotated frame: the unaligned joint accepts no axis
        case "prismatic":
            return pin.JointModelPrismaticUnaligned(axis)
        case "universal":
            return pin.JointModelUniversal(np.array([1.0, 0, 0]), np.array([0, 1.0, 0]))
    return JOINT_MODELS[x.joint]()


def _joint_rotation(x: Body) -> pin.SE3:
    """Return the placement of the joint frame in the body frame: z is the axis of continuous and planar joints."""
    return rotation_from_z(x.axis) if x.joint in ("continuous", "planar") else pin.SE3.Identity()
