"""Points and axes fixed to the links of a Pinocchio model, by name or by index."""

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from ...backend import load
from ...errors import InputError, UnknownNameError
from .expanded_tree import Branches, branches
from .pinocchio_data import make_data
from .tree_terms import bound_bodies, flexible_bodies, update_motions

if TYPE_CHECKING:
    from ..flexible.workspace import BoundBody, BoundNode

WORLD = "world"
LINKS = (pin.FrameType.BODY, pin.FrameType.OP_FRAME)
KINDS = tuple(pin.FrameType.values.values())
_NEXT, _LAST = np.array([1, 2, 0, 2, 0, 1]), np.array([2, 0, 1, 1, 2, 0])  # a_2 b_3 - a_3 b_2, ...


class Anchor(NamedTuple):
    """A frame fixed to a joint's body: rotation R (3, 3) and position p (3,) in m, in the joint frame.

    Nodes of flexible bodies follow the joints, in the order of the bodies: see `mbdae.mechanism.flexible`.
    """

    name: str
    joint: int
    R: np.ndarray
    p: np.ndarray


def find_frame(model: pin.Model, name: str) -> pin.Frame:
    """Return the frame called ``name``; a link or an extra frame has precedence over a joint of the same name.

    Raises:
        UnknownNameError: lists the valid names.
    """
    return model.frames[frame_index(model, name)]


def frame_index(model: pin.Model, name: str) -> int:
    """Return the index of a frame in the model, see `find_frame`."""
    if name == WORLD:
        return 0
    for kinds in (LINKS, KINDS) if isinstance(name, str) else ():
        if found := [i for kind in kinds if 0 < (i := model.getFrameId(name, kind)) < model.nframes]:
            return min(found)
    raise UnknownNameError("frame", name, frame_names(model))


def fixed_links(model: pin.Model) -> list[str]:
    """Return the names of the links that are fixed to the world: no joint moves them."""
    kind = pin.FrameType.BODY
    return [f.name for f in model.frames if not f.parentJoint and f.type == kind and f.name not in ("universe", WORLD)]


def frame_placement(model: pin.Model, data: pin.Data, name: str) -> pin.SE3:
    """Return the placement of a frame in the world; kinematics must be current.

    Raises:
        UnknownNameError: lists the valid names.
    """
    a = anchor(model, name)
    return data.oMi[a.joint] * pin.SE3(a.R, a.p)


def frame_names(model: pin.Model) -> list[str]:
    """Return the names of all frames, ``"world"`` first."""
    return list(dict.fromkeys([WORLD, *(f.name for f in model.frames if f.name != "universe")]))


def anchor(model: pin.Model, name: str) -> Anchor:
    """Return the frame called ``name`` as an anchor.

    Raises:
        UnknownNameError: lists the valid names.
        InputError: for the joint of a mode, which has no frame.
    """
    frame, at = find_frame(model, name), model.njoints
    for body in flexible_bodies(model):
        if name in body.node_frames:
            return Anchor(name, at + body.node_frames.index(name), np.eye(3), np.zeros(3))
        if frame.parentJoint > 0 and model.names[frame.parentJoint] in body.mode_joints:
            raise InputError(f"{name!r} is on a mode of {body.name!r}: nodes are {', '.join(body.node_frames)}")
        at += len(body.node_frames)
    return Anchor(name, frame.parentJoint, frame.placement.rotation.copy(), frame.placement.translation.copy())


def frame_paths(model: pin.Model, names: Sequence[str], q: np.ndarray) -> np.ndarray:
    """Return the origins of frames in the world in m, (n, m, 3), at configurations q (m, nq).

    Raises:
        UnknownNameError: lists the valid names.
    """
    return anchor_paths(model, [anchor(model, name) for name in names], q)


def joint_paths(model: pin.Model, names: Sequence[str], q: np.ndarray) -> np.ndarray:
    """Return the origins of joints in the world in m, (n, m, 3), at configurations q (m, nq).

    Raises:
        UnknownNameError: lists the valid names.
    """
    return anchor_paths(model, [Anchor(n, find_joint(model, n).id, np.eye(3), np.zeros(3)) for n in names], q)


def anchor_paths(model: pin.Model, anchors: Sequence[Anchor], q: np.ndarray) -> np.ndarray:
    """Return the origins of anchors in the world in m, (n, m, 3), at configurations q (m, nq)."""
    if (native := load()) and not flexible_bodies(model):
        return native.point_paths(model, [a.joint for a in anchors], np.array([a.p for a in anchors], float), q)
    data, p = make_data(model), np.empty((len(anchors), len(q), 3))
    for k, configuration in enumerate(q):
        update_motions(model, data, configuration)
        p[:, k] = np.reshape([data.oMi[a.joint].act(a.p) for a in anchors], (-1, 3))
    return p


def frame_motions(
    model: pin.Model, names: Sequence[str], q: np.ndarray, v: np.ndarray, vdot: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions, velocities and accelerations of the origins of frames in the world, (n, m, 3) each.

    Args:
        model: a model.
        names: names of n frames.
        q: configurations, (m, nq).
        v: velocities, (m, nv).
        vdot: accelerations, (m, nv).

    Raises:
        UnknownNameError: lists the valid names.
    """
    anchors = [anchor(model, name) for name in names]
    data, p, V, A = make_data(model), np.empty((len(names), len(q), 3)), *np.empty((2, len(names), len(q), 6))
    for k, point in enumerate(zip(q, v, vdot, strict=True)):
        update_motions(model, data, *point)
        for i, a in enumerate(anchors):
            placement = data.oMi[a.joint]
            p[i, k] = placement.act(a.p)
            V[i, k], A[i, k] = placement.act(data.v[a.joint]).vector, placement.act(data.a[a.joint]).vector
    velocity = V[..., :3] + np.cross(V[..., 3:], p)
    return p, velocity, A[..., :3] + np.cross(A[..., 3:], p) + np.cross(V[..., 3:], velocity)


def joint_names(model: pin.Model) -> list[str]:
    """Return the names of the moving joints, in the order of q."""
    return [n for n in model.names if n != "universe"]


def find_joint(model: pin.Model, name: str) -> pin.JointModel:
    """Return the joint called ``name``.

    Raises:
        UnknownNameError: lists the valid names.
    """
    if not isinstance(name, str) or name == "universe" or not model.existJointName(name):
        raise UnknownNameError("joint", name, joint_names(model))
    return model.joints[model.getJointId(name)]


def find_joints(model: pin.Model, names: str | Iterable[str]) -> list[pin.JointModel]:
    """Return the joints with one or several names."""
    return [find_joint(model, n) for n in ([names] if isinstance(names, str) else names)]


class Pair:
    """Two anchors bound to live Pinocchio data: poses in the world, twists, and the columns of J that move them.

    ``sign`` (nv,) is +1 where a joint moves only b, -1 where it moves only a and 0 elsewhere: a wrench w (6,) on b and
    -w on a, both about the world's origin, has the generalized force sign * (J^T w). ``columns`` belong to joints that
    move a or b or both. Modes that move an anchor on a node have their columns in ``nodes``, not in J: sign of the
    anchor, the bound body and its node; their ``sign`` is 0.
    """

    def __init__(self, model: pin.Model, data: pin.Data, a: Anchor, b: Anchor) -> None:
        self.model, self.a, self.b, self._data, self._J = model, a, b, data, data.J.reshape(6, -1)  # (6,) if nv = 1
        self._motions = [(data.oMi[x.joint], data.v[x.joint], data.a[x.joint]) for x in (a, b)]  # views of the data
        (self._Ra, self._pa), (self._Rb, self._pb) = ((M.rotation, M.translation) for M, *_ in self._motions)
        self._in_a, self._in_b = (np.column_stack([x.R, x.p]) for x in (a, b))
        support_a, support_b = support(model, a.joint), support(model, b.joint)
        self.sign, self.columns = (support_b - support_a).astype(np.int8), np.flatnonzero(support_a + support_b)
        self.nodes = [
            (sign, body, node)
            for sign, x in ((-1.0, a), (1.0, b))
            for body in bound_bodies(data)
            for node in body.nodes
            if node.index == x.joint
        ]
        for _, body, _ in self.nodes:
            self.sign[body.at] = 0

    @cached_property
    def branches(self) -> Branches:
        """Columns of J that move only one of the anchors; for a node, also its translations and rotations by modes."""
        carriers = {node.index: body.joint for _, body, node in self.nodes}
        out = branches(self.model, *(carriers.get(x.joint, x.joint) for x in (self.a, self.b)))
        for sign, body, _ in self.nodes:
            out = out.with_modes(np.arange(body.at.start, body.at.stop), sign)
        return out

    @property
    def jacobian(self) -> np.ndarray:
        """The columns of J that move only one of the anchors, (6, c), as ``branches``."""
        at = self.branches.at
        if not self.nodes:
            return self._J[:, at]
        split = [J for _, _, node in self.nodes for J in node.split_columns(self._data)]
        return np.hstack([self._J[:, at[: len(at) - sum(J.shape[1] for J in split)]], *split])

    def node_changes(self, body: "BoundBody", node: "BoundNode", u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives with respect to q_m of translation T u and rotation W u of a node, (6, k); u (k,)."""
        frame = body.pose(self._data)
        return node.translation_change(frame, u), node.rotation_change(self._data, node.node.Psi @ u)

    def locate(self) -> None:
        """Update rotations Ra, Rb (3, 3) and positions pa, pb (3,) of both anchors in the world."""
        a, b = self._Ra.dot(self._in_a), self._Rb.dot(self._in_b)
        self.Ra, self.Rb, self.pa, self.pb = a[:, :3], b[:, :3], a[:, 3] + self._pa, b[:, 3] + self._pb

    def twist(self) -> None:
        """Update the spatial velocities Va, Vb (6,) at the world's origin, linear part first."""
        self.Va, self.Vb = (M.act(v).vector for M, v, _ in self._motions)

    def bias(self) -> np.ndarray:
        """Return the spatial acceleration of b relative to a, (6,); data.a must contain accelerations for v' = 0.

        This is not Jdot v: Pinocchio's dJ omits the change of a joint's axes (universal and composite joints).
        """
        Aa, Ab = (M.act(a).vector for M, _, a in self._motions)
        return Ab - Aa

    def relative(self, v: np.ndarray) -> np.ndarray:
        """Return the spatial velocity (6,) of b relative to a at the world's origin, for velocities v (nv,)."""
        return self._J.dot(self.sign * v) + sum(sign * (node.columns @ v[body.at]) for sign, body, node in self.nodes)

    def generalized_force(self, wrench: np.ndarray) -> np.ndarray:
        """Return the generalized force (nv,) of a wrench (6,) on b and its reaction on a."""
        out = self.sign * wrench.dot(self._J)
        for sign, body, node in self.nodes:
            out[body.at] += sign * wrench.dot(node.columns)
        return out

    def relative_jacobian(self) -> np.ndarray:
        """Return the Jacobian of the spatial velocity of b relative to a, (6, nv)."""
        return np.array([self.generalized_force(e) for e in np.eye(6)])


def support(model: pin.Model, joint: int) -> np.ndarray:
    """Return a mask of the velocities that move a joint, (nv,): 1 if they do, else 0."""
    mask = np.zeros(model.nv)
    if joint >= model.njoints:
        carriers = [body.carrier(model) for body in flexible_bodies(model) for _ in body.node_frames]
        joint = carriers[joint - model.njoints]
    starts, sizes, parents = model.idx_vs, model.nvs, model.parents
    while joint:
        mask[starts[joint] : starts[joint] + sizes[joint]] = 1.0
        joint = parents[joint]
    return mask


def skew(p: np.ndarray) -> np.ndarray:
    """Return the matrix of p x ., (3, 3), real or complex."""
    return pin.skew(p) if p.dtype == float else pin.skew(p.real) + 1j * pin.skew(p.imag)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the products a x b column by column, (3, m); `numpy.cross` is ten times slower on small arrays."""
    x = a.take(_NEXT, 0) * b.take(_LAST, 0)
    return x[:3] - x[3:]


def motion_cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the products a x b of motions a, b column by column, (6, m)."""
    return np.concatenate([cross(a[3:], b[:3]) + cross(a[:3], b[3:]), cross(a[3:], b[3:])])


def point_velocities(motions: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return the velocities (3, m) of a point p (3,) under motions (6, m) at the world's origin."""
    return motions[:3] + cross(motions[3:], p[:, None])


def wrench_matrix(wrench: np.ndarray) -> np.ndarray:
    """Return the matrix of the product d x* wrench with motions d, (6, 6)."""
    out = np.zeros((6, 6))
    out[:3, 3:] = out[3:, :3] = -skew(wrench[:3])
    out[3:, 3:] = -skew(wrench[3:])
    return out


def unit_gap(pair: Pair) -> tuple[float, np.ndarray]:
    """Return the distance between the origins in m and the unit vector (3,) from a to b; x if they coincide."""
    gap = pair.pb - pair.pa
    distance = np.sqrt(gap @ gap)
    return (distance, gap / distance) if distance.real > 0 else (np.finfo(float).tiny, np.array([1.0, 0.0, 0.0]))
