"""Attach flexible bodies to a Pinocchio model: joints of the frame and of the modes, and a frame for each node."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from ...data_types import CoreData
from ...errors import InputError
from .modal_body import ModalBody
from .workspace import BoundBody


@dataclass(frozen=True, eq=False)
class FlexibleBody:
    """A modal body in a model; its joint has its name, the joints of its modes are ``"name.mode 1"``, ...

    Attributes:
        name: of the body and of the joint of its frame; a node is the frame ``"name.node"``.
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

    def carrier(self, model: pin.Model) -> int:
        """Return the index of the last joint: frames of nodes are on it."""
        return int(model.getJointId(self.mode_joints[-1]))

    def with_numbers(self, modal: ModalBody) -> "FlexibleBody":
        """Return the same body with other numbers."""
        return FlexibleBody(self.name, modal)

    def core_data(self, model: pin.Model) -> CoreData:
        """Return the body for the core."""
        first = model.joints[model.getJointId(self.mode_joints[0])]
        at = {"joint": int(model.getJointId(self.name)), "iq": first.idx_q, "iv": first.idx_v}
        return at | self.modal.core_data()

    def bind(self, model: pin.Model, data: pin.Data) -> BoundBody:
        """Bind the body to a workspace, whose motions get an entry for each node."""
        return BoundBody(model, data, self.name, self.mode_joints, self.modal)


def attach_flexible(
    model: pin.Model,
    name: str,
    modal: ModalBody,
    joint: pin.JointModel,
    parent: int = 0,
    placement: pin.SE3 | None = None,
) -> FlexibleBody:
    """Add a flexible body to a model, as its last joints.

    Args:
        model: is extended; its attribute ``flexible`` lists the bodies.
        name: of the body.
        modal: the body.
        joint: joint between parent and frame.
        parent: index of the parent joint.
        placement: of the joint in the parent joint.

    Raises:
        InputError: for a body without modes, or a name that is taken.
    """
    if not modal.modes:
        raise InputError(f"flexible body {name!r} has no modes: make it a rigid body")
    body = FlexibleBody(name, modal)
    for x in (name, *body.mode_joints, *body.node_frames):
        if model.existJointName(x) or model.existFrame(x):
            raise InputError(f"the name {x!r} is taken: joints, frames and nodes need different names")
    at, one = model.addJoint(parent, joint, placement or pin.SE3.Identity(), name), pin.SE3.Identity()
    centre = modal.s0 / modal.mass
    about = modal.I0 + modal.mass * pin.skew(centre) @ pin.skew(centre)
    model.appendBodyToJoint(at, pin.Inertia(modal.mass, centre, (about + about.T) / 2), one)
    model.addFrame(pin.Frame(name, at, one, pin.FrameType.BODY))
    for x in body.mode_joints:
        at = model.addJoint(at, pin.JointModelPX(), one, x)
    for x, node in zip(body.node_frames, modal.nodes.values(), strict=True):
        model.addFrame(pin.Frame(x, at, pin.SE3(np.eye(3), node.r), pin.FrameType.OP_FRAME))
    model.flexible = (*getattr(model, "flexible", ()), body)
    return body
