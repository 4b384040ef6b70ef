"""Single joints: kinds, motion subspaces, transforms, and numbering."""

from functools import cache

import numpy as np
import pinocchio as pin

from ...errors import InputError, require

PER_VELOCITY = (
    "armature",
    "damping",
    "rotorInertia",
    "rotorGearRatio",
    "lowerDryFrictionLimit",
    "upperDryFrictionLimit",
    "lowerEffortLimit",
    "upperEffortLimit",
    "lowerVelocityLimit",
    "upperVelocityLimit",
)
PER_COORDINATE = ("lowerPositionLimit", "upperPositionLimit", "positionLimitMargin")

KINDS = {
    **{name: "revolute" for name in ("RX", "RY", "RZ", "RevoluteUnaligned")},
    **{name: "continuous" for name in ("RUBX", "RUBY", "RUBZ", "RevoluteUnboundedUnaligned")},
    **{name: "prismatic" for name in ("PX", "PY", "PZ", "PrismaticUnaligned")},
    **{name: "helical" for name in ("HX", "HY", "HZ", "HelicalUnaligned")},
    "SphericalZYX": "spherical",
    "FreeFlyer": "free",
}


def file_kind(joint: pin.JointModel) -> str:
    """Return the kind of a joint in mechanism files: ``"revolute"``, ``"continuous"``, ``"spherical"``, ...

    A continuous URDF joint with one coordinate is classified as revolute.
    """
    name = joint.shortname().removeprefix("JointModel")
    return KINDS.get(name, name.lower())


WITHOUT_PARAMETERS = {
    f"JointModel{kind}"
    for kind in ("RX", "RY", "RZ", "RUBX", "RUBY", "RUBZ", "PX", "PY", "PZ", "Spherical", "SphericalZYX", "FreeFlyer",
                 "Planar", "Translation")
}  # fmt: skip


def subspace(joint: pin.JointModel) -> np.ndarray:
    """Return the motion subspace of a joint at its neutral configuration, (6, nv), in the joint frame."""
    kind = joint.shortname()
    return _subspace_of_kind(kind).copy() if kind in WITHOUT_PARAMETERS else _subspace(joint)


@cache
def _subspace_of_kind(kind: str) -> np.ndarray:
    return _subspace(getattr(pin, kind)())


def _subspace(joint: pin.JointModel) -> np.ndarray:
    model = _single_joint_model(joint)
    J = pin.computeJointJacobian(model, model.createData(), pin.neutral(model), 1)
    return J.reshape(6, -1)


def joint_transform(joint: pin.JointModel, q: np.ndarray) -> pin.SE3:
    """Return the placement of the child body for the joint configuration q (nq,)."""
    model = _single_joint_model(joint)
    data = model.createData()
    pin.forwardKinematics(model, data, np.asarray(q, float))
    return data.oMi[1].copy()


def is_depth_first(model: pin.Model) -> bool:
    """Return whether joints of each subtree have consecutive indices, as Pinocchio's algorithms require."""
    path = [0]  # previous joint and its ancestors, one of which must be the parent of the next joint
    for j, parent in enumerate(list(model.parents)[1:], 1):
        if parent not in path:
            return False
        path[path.index(parent) + 1 :] = [j]
    return True


def require_supported(model: pin.Model) -> None:
    """Check that a model is one of Pinocchio, without mimic joints, and numbered depth first.

    Raises:
        InputError: for another one.
    """
    require(model, pin.Model, "a model is a pinocchio.Model (mbdae.load reads names and files)")
    if any(isinstance(j, pin.JointModelMimic) for j in model.joints):
        raise InputError("mimic joints are not supported: replace them by a coupling or lock them")
    if not is_depth_first(model):
        names = ", ".join(list(model.names)[1:])
        raise InputError(f"joints must be numbered depth first, see mbdae.mechanism.depth_first; they are {names}")


def _single_joint_model(joint: pin.JointModel) -> pin.Model:
    model = pin.Model()
    model.addJoint(0, joint, pin.SE3.Identity(), "joint")
    return model


def translation_components(model: pin.Model) -> np.ndarray:
    """Return which tangent components are translations, in m, (nv,)."""
    out = np.zeros(model.nv, bool)
    for joint in list(model.joints)[1:]:
        S = subspace(joint)
        out[joint.idx_v : joint.idx_v + joint.nv] = ~S[3:].any(axis=0)
    return out


def angle_components(model: pin.Model) -> np.ndarray:
    """Return which tangent components are angles with a period of 2 pi, (nv,)."""
    return np.concatenate([np.zeros(0, bool), *map(_angles, list(model.joints)[1:])])


def _angles(joint: pin.JointModel) -> np.ndarray:
    """Return which tangent components of a joint are angles, (nv,); composite joints axis by axis."""
    if (kind := joint.shortname()) == "JointModelComposite":
        return np.concatenate([_angles(factor) for factor in joint.extract().joints])
    if kind != "JointModelSphericalZYX" and joint.nv > 2:
        return np.zeros(joint.nv, bool)
    return np.array(~subspace(joint)[:3].any(axis=0))
