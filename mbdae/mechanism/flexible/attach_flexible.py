"""Attach flexible bodies to a Pinocchio model: joints of the frame and of the modes, and a frame for each node."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from ...data_types import CoreData
from ...errors import InputError
from ..tree.tree_terms import flexible_bodies, mode_joints
from .modal_body import ModalBody
from .workspace import BoundBody


@dataclass(frozen=True, eq=False)
class FlexibleBody:
    """A modal body in a model; its frame has its name, the joints of its modes are ``"name.mode 1"``, ...

    Attributes:
        name: name of the body, its frame and the joint of this frame; a node is the frame ``"name.node"``.
        modal: the body.
    """

    name: str
    modal: ModalBody

    @property
    def mode_joints(self) -> list[str]:
        """Names of the joints of the modes."""
        return [f"{self.name}.mode {i + 1}" for i in range(self.modal.modes)]

    @property
    def node_frames(self) -> list[str]:
        """Names of the frames of the nodes."""
        return [f"{self.name}.{node}" for node in self.modal.nodes]

    def base(self, model: pin.Model) -> tuple[int, pin.SE3]:
        """Return the index of the joint that carries the frame of the body, and the placement of the frame in it."""
        frame = model.frames[model.getFrameId(self.name, pin.FrameType.BODY)]
        return int(frame.parentJoint), frame.placement

    def carrier(self, model: pin.Model) -> int:
        """Return the index of the last joint: frames of nodes are on it."""
        return int(model.getJointId(self.mode_joints[-1]))

    def first_mode_joint(self, model: pin.Model) -> pin.JointModel:
        """Return the joint of the first mode; coordinates and velocities of the other modes follow."""
        return model.joints[model.getJointId(self.mode_joints[0])]

    def with_modal(self, modal: ModalBody) -> "FlexibleBody":
        """Return the body with another modal body."""
        return FlexibleBody(self.name, modal)

    def core_data(self, model: pin.Model) -> CoreData:
        """Return the data of the body for the core."""
        first, (joint, placement) = self.first_mode_joint(model), self.base(model)
        values = np.vstack([placement.rotation.T, placement.translation]).ravel().tolist()
        at = {"joint": joint, "placement": values, "iq": first.idx_q, "iv": first.idx_v}
        return at | self.modal.core_data()

    def bind(self, model: pin.Model, data: pin.Data) -> BoundBody:
        """Bind the body to a workspace, which gets an entry for each node."""
        return BoundBody(model, data, self.base(model), self.first_mode_joint(model), self.modal)


def attach_flexible(
    model: pin.Model,
    name: str,
    modal: ModalBody,
    joint: pin.JointModel | None,
    parent: int = 0,
    placement: pin.SE3 | None = None,
) -> FlexibleBody:
    """Add a flexible body to a model, as its last joints.

    Args:
        model: model to extend; its attribute ``flexible`` lists the bodies.
        name: name of the body.
        modal: the modal body.
        joint: joint between parent and frame; None fixes the frame to the parent.
        parent: index of the parent joint, 0 for the world.
        placement: placement of the joint, or of the fixed frame, in the parent joint.

    Raises:
        InputError: for a body without modes, a name that exists, or a parent that is a mode of another body.
    """
    if not modal.modes:
        raise InputError(f"flexible body {name!r} has no modes: use a rigid body")
    _reject_mode_as_parent(model, parent, name)
    body = FlexibleBody(name, modal)
    names = (name, *body.mode_joints, *body.node_frames)
    for x in names:
        if model.existJointName(x) or model.existFrame(x) or names.count(x) > 1:
            raise InputError(f"the name {x!r} is taken: joints, frames and nodes need different names")
    identity = pin.SE3.Identity()
    at, placement_in_joint = parent, placement or identity
    if joint is not None:
        at, placement_in_joint = model.addJoint(parent, joint, placement_in_joint, name), identity
    centre = modal.s0 / modal.mass
    central = modal.I0 + modal.mass * pin.skew(centre) @ pin.skew(centre)
    model.appendBodyToJoint(at, pin.Inertia(modal.mass, centre, (central + central.T) / 2), placement_in_joint)
    model.addFrame(pin.Frame(name, at, placement_in_joint, pin.FrameType.BODY))
    for x in body.mode_joints:
        at, placement_in_joint = model.addJoint(at, pin.JointModelPX(), placement_in_joint, x), identity
    for x, node in zip(body.node_frames, modal.nodes.values(), strict=True):
        model.addFrame(pin.Frame(x, at, pin.SE3(np.eye(3), node.r), pin.FrameType.OP_FRAME))
    model.flexible = (*getattr(model, "flexible", ()), body)
    return body


def require_leaves(model: pin.Model) -> None:
    """Reject joints and masses on the joint of a mode, whose motion is not the motion of a point of the body.

    Raises:
        InputError: names the joint and the nodes of the flexible body.
    """
    modes = set(mode_joints(model))
    for i, name in enumerate(model.names):
        if name not in modes:
            _reject_mode_as_parent(model, model.parents[i], name)
        elif model.inertias[i].mass:
            _reject_mode_as_parent(model, i, f"the mass at {name}")


def _reject_mode_as_parent(model: pin.Model, parent: int, child: str) -> None:
    for body in flexible_bodies(model):
        if model.names[parent] in body.mode_joints:
            nodes = ", ".join(body.node_frames) or "none"
            remedy = f"give it a free joint, and weld it to a node by a closure of kind 'frame': {nodes}"
            raise InputError(f"{child!r} cannot be a child of a mode of {body.name!r}; {remedy}")
