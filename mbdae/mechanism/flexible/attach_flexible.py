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
        name: of the body, its frame and the joint of this frame; a node is the frame ``"name.node"``.
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
        """Return the joint of the first mode; coordinates and velocities of the others follow."""
        return model.joints[model.getJointId(self.mode_joints[0])]

    def with_numbers(self, modal: ModalBody) -> "FlexibleBody":
        """Return the same body with other numbers."""
        return FlexibleBody(self.name, modal)

    def core_data(self, model: pin.Model) -> CoreData:
        """Return the body for the core."""
        first, (joint, placement) = self.first_mode_joint(model), self.base(model)
        place = np.vstack([placement.rotation.T, placement.translation]).ravel().tolist()
        at = {"joint": joint, "placement": place, "iq": first.idx_q, "iv": first.idx_v}
        return at | self.modal.core_data()

    def bind(self, model: pin.Model, data: pin.Data) -> BoundBody:
        """Bind the body to a workspace, whose motions get an entry for each node."""
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
        model: is extended; its attribute ``flexible`` lists the bodies.
        name: of the body.
        modal: the body.
        joint: joint between parent and frame; None fixes the frame to the parent.
        parent: index of the parent joint, 0 is the world.
        placement: of the joint, or of the fixed frame, in the parent joint.

    Raises:
        InputError: for a body without modes, a name that is taken, or a parent that is a mode of another body.
    """
    if not modal.modes:
        raise InputError(f"flexible body {name!r} has no modes: make it a rigid body")
    _require_no_mode(model, parent, name)
    body = FlexibleBody(name, modal)
    names = (name, *body.mode_joints, *body.node_frames)
    for x in names:
        if model.existJointName(x) or model.existFrame(x) or names.count(x) > 1:
            raise InputError(f"the name {x!r} is taken: joints, frames and nodes need different names")
    one = pin.SE3.Identity()
    at, here = parent, placement or one
    if joint is not None:
        at, here = model.addJoint(parent, joint, here, name), one
    centre = modal.s0 / modal.mass
    about = modal.I0 + modal.mass * pin.skew(centre) @ pin.skew(centre)
    model.appendBodyToJoint(at, pin.Inertia(modal.mass, centre, (about + about.T) / 2), here)
    model.addFrame(pin.Frame(name, at, here, pin.FrameType.BODY))
    for x in body.mode_joints:
        at, here = model.addJoint(at, pin.JointModelPX(), here, x), one
    for x, node in zip(body.node_frames, modal.nodes.values(), strict=True):
        model.addFrame(pin.Frame(x, at, pin.SE3(np.eye(3), node.r), pin.FrameType.OP_FRAME))
    model.flexible = (*getattr(model, "flexible", ()), body)
    return body


def require_leaves(model: pin.Model) -> None:
    """Require that no joint or mass is on the joint of a mode: its motion is not that of a point of the body.

    Raises:
        InputError: names the joint and the nodes of the flexible body.
    """
    modes = set(mode_joints(model))
    for i, name in enumerate(model.names):
        if name not in modes:
            _require_no_mode(model, model.parents[i], name)
        elif model.inertias[i].mass:
            _require_no_mode(model, i, f"the mass at {name}")


def _require_no_mode(model: pin.Model, parent: int, child: str) -> None:
    for body in flexible_bodies(model):
        if model.names[parent] in body.mode_joints:
            nodes = ", ".join(body.node_frames) or "none"
            cure = f"give it a free joint, and weld it to a node by a closure of kind 'frame': {nodes}"
            raise InputError(f"{child!r} cannot be a child of a mode of {body.name!r}; {cure}")
