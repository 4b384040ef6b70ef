"""Conversion of states between the conventions of MuJoCo and Pinocchio.

============  ==========================================  =======================================
joint         MuJoCo                                      Pinocchio
============  ==========================================  =======================================
hinge, slide  q, q'                                       the same
ball          quaternion w x y z; omega in the body       quaternion x y z w; omega in the body
free          position, quaternion w x y z;               position, quaternion x y z w;
              v of the origin in the world, omega in      v of the origin and omega in the body
              the body
============  ==========================================  =======================================

Both order joints depth first.
"""

import numpy as np
import pinocchio as pin

from ....errors import InputError

TO_XYZW, TO_WXYZ = [1, 2, 3, 0], [3, 0, 1, 2]


def from_mujoco(model: pin.Model, qpos: np.ndarray, qvel: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return q (nq,) and v (nv,) for MuJoCo's qpos (nq,) and qvel (nv,); quaternions are normalized.

    Raises:
        InputError: for arrays of another length.
    """
    q, v = _checked(model, qpos, qvel)
    for joint, kind in _quaternion_joints(model):
        quaternion = slice(joint.idx_q + joint.nq - 4, joint.idx_q + joint.nq)
        q[quaternion] = _unit(q[quaternion][TO_XYZW])
        if kind == "JointModelFreeFlyer":
            linear = slice(joint.idx_v, joint.idx_v + 3)
            v[linear] = pin.Quaternion(q[quaternion]).matrix().T @ v[linear]
    return q, v


def to_mujoco(model: pin.Model, q: np.ndarray, v: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return MuJoCo's qpos (nq,) and qvel (nv,) for q (nq,) and v (nv,).

    Raises:
        InputError: for arrays of another length.
    """
    qpos, qvel = _checked(model, q, v)
    for joint, kind in _quaternion_joints(model):
        quaternion = slice(joint.idx_q + joint.nq - 4, joint.idx_q + joint.nq)
        if kind == "JointModelFreeFlyer":
            linear = slice(joint.idx_v, joint.idx_v + 3)
            qvel[linear] = pin.Quaternion(_unit(qpos[quaternion])).matrix() @ qvel[linear]
        qpos[quaternion] = qpos[quaternion][TO_WXYZ]
    return qpos, qvel


def pose(position: np.ndarray, quaternion: np.ndarray | None = None) -> pin.SE3:
    """Return a placement from MuJoCo's position (3,) and quaternion w x y z."""
    w, x, y, z = (1.0, 0.0, 0.0, 0.0) if quaternion is None else quaternion
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized(), np.array(position, float))


def _quaternion_joints(model: pin.Model) -> list[tuple[pin.JointModel, str]]:
    kinds = ("JointModelSpherical", "JointModelFreeFlyer")
    return [(j, j.shortname()) for j in list(model.joints)[1:] if j.shortname() in kinds]


def _unit(quaternion: np.ndarray) -> np.ndarray:
    """Return a unit quaternion x, y, z, w; like MuJoCo, the identity for a zero quaternion."""
    size = np.linalg.norm(quaternion)
    return quaternion / size if size > 0 else np.array([0.0, 0.0, 0.0, 1.0])


def _checked(model: pin.Model, q: np.ndarray, v: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    q, v = np.array(q, float), np.zeros(model.nv) if v is None else np.array(v, float)
    if q.shape != (model.nq,) or v.shape != (model.nv,):
        raise InputError(f"expected shapes ({model.nq},) and ({model.nv},), got {q.shape} and {v.shape}")
    return q, v
