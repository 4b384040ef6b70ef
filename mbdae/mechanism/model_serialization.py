"""A Pinocchio model as JSON data, for saved runs: validated when read, and recreated by calls of Pinocchio.

The recreated model is bitwise equal. Pinocchio's archives are not used: reading a damaged one may terminate the
process.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
import pinocchio as pin
from pydantic import AllowInfNan, Field, ValidationError

from ..data_types import JsonObject
from ..errors import InputError
from ..tolerances import INPUT_DIGITS
from .checked_table import Table, one_line
from .flexible import FlexibleBody
from .flexible.modal_data import modal_body_from_data, modal_data
from .scene.shapes import PlacementEntries
from .tree.joints import PER_COORDINATE, PER_VELOCITY, subspace
from .tree.tree_terms import flexible_bodies

PREFIX = "JointModel"
COMPOSITE, UNALIGNED = "Composite", "RevoluteUnboundedUnaligned"
CONSTRUCTOR_ARGUMENTS: dict[str, tuple[str, ...]] = {  # by kind of joint
    **dict.fromkeys(("RX", "RY", "RZ", "RUBX", "RUBY", "RUBZ", "PX", "PY", "PZ"), ()),
    **dict.fromkeys(("Spherical", "SphericalZYX", "Planar", "Translation", "FreeFlyer"), ()),
    **dict.fromkeys(("HX", "HY", "HZ"), ("pitch",)),
    "RevoluteUnaligned": ("axis",),
    "PrismaticUnaligned": ("axis",),
    "HelicalUnaligned": ("axis", "pitch"),
    "Universal": ("axis1", "axis2"),
    "Ellipsoid": ("radius_x", "radius_y", "radius_z"),
}
KINDS = (*CONSTRUCTOR_ARGUMENTS, UNALIGNED, COMPOSITE)
MAX_SCALINGS = 64  # trial scalings of an unaligned axis until normalization reproduces it exactly
ROBOT = """<robot name="one"><link name="a"/><link name="b"/><joint name="j" type="continuous">
<parent link="a"/><child link="b"/><axis xyz="{!r} {!r} {!r}"/></joint></robot>"""

FloatOrInfinite = Annotated[float, AllowInfNan(True)]
Vector = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]


class _Inertia(Table):
    """Mass in kg, com (centre of mass) in m, moments (ixx, ixy, iyy, ixz, iyz, izz) about it in kg m^2."""

    mass: float
    com: Vector
    moments: Six


class _Joint(Table):
    """A joint by its kind and parameters; a composite one by its joints and their placements."""

    kind: str
    numbers: tuple[float, ...] = ()
    parts: tuple["_Joint", ...] = ()
    places: tuple[PlacementEntries, ...] = ()


class _Link(Table):
    """A joint and the inertia of its body; place: the placement on the parent joint, [R p] (3, 4) row by row."""

    name: str
    parent: int = Field(ge=0)
    place: PlacementEntries
    joint: _Joint
    inertia: _Inertia


class _Frame(Table):
    """A frame on a parent joint and a parent frame."""

    name: str
    type: Literal["OP_FRAME", "JOINT", "FIXED_JOINT", "BODY", "SENSOR"]
    joint: int = Field(ge=0)
    frame: int = Field(ge=0)
    place: PlacementEntries
    inertia: _Inertia


class _Model(Table):
    """A model; ``arrays`` holds values per velocity or coordinate."""

    name: str
    gravity: Six
    ground: _Inertia
    joints: tuple[_Link, ...]
    frames: tuple[_Frame, ...]
    arrays: dict[str, tuple[FloatOrInfinite, ...]]
    flexible: dict[str, dict[str, Any]] = Field(default_factory=dict)


def model_to_data(model: pin.Model) -> JsonObject:
    """Return a model as JSON data.

    Raises:
        InputError: for a joint of an unsupported kind.
    """
    joints = zip(model.names, model.parents, model.jointPlacements, model.joints, model.inertias, strict=True)
    return {
        "name": model.name,
        "gravity": model.gravity.vector.tolist(),
        "ground": _inertia(model.inertias[0]),
        "joints": [
            {"name": n, "parent": int(p), "place": _placement(x), "joint": _joint(j), "inertia": _inertia(y)}
            for n, p, x, j, y in list(joints)[1:]
        ],
        "frames": [
            {
                "name": f.name,
                "type": f.type.name,
                "joint": int(f.parentJoint),
                "frame": int(f.parentFrame),
                "place": _placement(f.placement),
                "inertia": _inertia(f.inertia),
            }
            for f in list(model.frames)[1:]
        ],
        "arrays": {name: np.array(getattr(model, name)).tolist() for name in (*PER_VELOCITY, *PER_COORDINATE)},
        "flexible": {body.name: modal_data(body.modal) for body in flexible_bodies(model)},
    }


def model_from_data(data: Mapping[str, object]) -> pin.Model:
    """Recreate the model from the data of `model_to_data`.

    Raises:
        InputError: names the invalid entry.
    """
    try:
        validated = _Model.model_validate(data)
    except ValidationError as e:
        raise InputError(f"model: {one_line(e, lambda path: [])}") from None
    model = pin.Model()
    model.name, model.gravity = validated.name, pin.Motion(np.array(validated.gravity))
    model.inertias[0] = _inertia_from_data(validated.ground, "the world")
    _add_joints(model, validated.joints)
    _add_frames(model, validated.frames)
    _set_arrays(model, validated.arrays)
    if validated.flexible:
        model.flexible = _flexible_from_data(validated.flexible, model)
    return model


def _add_joints(model: pin.Model, joints: Sequence[_Link]) -> None:
    for index, x in enumerate(joints, 1):
        if x.parent >= index:
            raise InputError(f"model: joint {x.name!r} has parent joint {x.parent}, which does not precede it")
        if model.existJointName(x.name):
            raise InputError(f"model: two joints are called {x.name!r}")
        owner = f"joint {x.name!r}"
        model.addJoint(x.parent, _joint_from_data(x.joint, owner), _placement_from_data(x.place, owner), x.name)
        model.inertias[index] = _inertia_from_data(x.inertia, owner)


def _add_frames(model: pin.Model, frames: Sequence[_Frame]) -> None:
    for f in frames:
        if f.joint >= model.njoints or f.frame >= len(model.frames):
            raise InputError(f"model: frame {f.name!r} is on joint {f.joint} and frame {f.frame}, which do not exist")
        kind, owner = pin.FrameType.names[f.type], f"frame {f.name!r}"
        if model.existFrame(f.name, kind):
            raise InputError(f"model: two frames are called {f.name!r}")
        placement, inertia = _placement_from_data(f.place, owner), _inertia_from_data(f.inertia, owner)
        model.addFrame(pin.Frame(f.name, f.joint, f.frame, placement, kind, inertia), False)


def _set_arrays(model: pin.Model, arrays: Mapping[str, tuple[float, ...]]) -> None:
    for names, size in ((PER_VELOCITY, model.nv), (PER_COORDINATE, model.nq)):
        for name in names:
            values, limit = np.array(arrays.get(name, ())), name.endswith("Limit")  # limits may be infinite
            if len(values) != size or (np.isnan(values) if limit else ~np.isfinite(values)).any():
                raise InputError(f"model: {name} needs {size} {'' if limit else 'finite '}numbers")
            getattr(model, name)[:] = values


def _flexible_from_data(tables: Mapping[str, Mapping[str, Any]], model: pin.Model) -> tuple[FlexibleBody, ...]:
    """Return the flexible bodies, whose joints and frames are in the model."""
    bodies = tuple(FlexibleBody(name, modal_body_from_data(data, name)) for name, data in tables.items())
    for body in bodies:
        for kind, names, exists in (
            ("joint", body.mode_joints, model.existJointName),
            ("frame", (body.name, *body.node_frames), model.existFrame),
        ):
            for name in names:
                if not exists(name):
                    raise InputError(f"model: flexible body {body.name!r} has no {kind} {name!r}")
    return bodies


def _placement(x: pin.SE3) -> list[float]:
    return x.homogeneous[:3].ravel().tolist()


def _placement_from_data(x: PlacementEntries, owner: str) -> pin.SE3:
    rows = np.array(x).reshape(3, 4)
    R = rows[:, :3]
    if not (np.abs(R @ R.T - np.eye(3)).max() <= INPUT_DIGITS and np.linalg.det(R) > 0):
        raise InputError(f"model: the placement of {owner} is not a rotation and a translation")
    return pin.SE3(R, rows[:, 3])


def _inertia(x: pin.Inertia) -> JsonObject:
    tensor = x.inertia
    moments = [float(tensor[i, j]) for i in range(3) for j in range(i + 1)]
    return {"mass": float(x.mass), "com": x.lever.tolist(), "moments": moments}


def _inertia_from_data(x: _Inertia, owner: str) -> pin.Inertia:
    ixx, ixy, iyy, ixz, iyz, izz = x.moments
    if x.mass < 0 or min(ixx, iyy, izz) < 0:  # otherwise Pinocchio raises a RuntimeError
        raise InputError(f"model: the inertia of {owner} has a negative mass or moment")
    return pin.Inertia(x.mass, np.array(x.com), np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]))


def _joint(joint: pin.JointModel) -> JsonObject:
    kind, typed = joint.shortname().removeprefix(PREFIX), joint.extract()
    if kind == COMPOSITE:
        placements = [_placement(p) for p in typed.jointPlacements]
        return {"kind": kind, "parts": [_joint(j) for j in typed.joints], "places": placements}
    if kind == UNALIGNED:
        return {"kind": kind, "numbers": subspace(typed)[3:, 0].tolist()}
    if kind not in CONSTRUCTOR_ARGUMENTS:
        raise InputError(f"a joint of kind {kind!r} cannot be serialized; known: {', '.join(KINDS)}")
    arguments = (np.atleast_1d(getattr(typed, name)) for name in CONSTRUCTOR_ARGUMENTS[kind])
    return {"kind": kind, "numbers": [float(x) for argument in arguments for x in argument]}


def _joint_from_data(x: _Joint, owner: str) -> pin.JointModel:
    if x.kind == COMPOSITE:
        return _composite_from_data(x, owner)
    if x.kind not in KINDS:
        raise InputError(f"model: {owner} is of unknown kind {x.kind!r}; known: {', '.join(KINDS)}")
    names = CONSTRUCTOR_ARGUMENTS.get(x.kind, ("axis",))
    sizes = [3 if name.startswith("axis") else 1 for name in names]
    if len(x.numbers) != sum(sizes):
        raise InputError(f"model: {owner} of kind {x.kind!r} has {len(x.numbers)} parameters; needs {sum(sizes)}")
    arguments = np.split(np.array(x.numbers), np.cumsum(sizes)[:-1]) if sizes else []
    if not all(abs(np.linalg.norm(a) - 1) <= INPUT_DIGITS for a in arguments if len(a) == 3):
        raise InputError(f"model: the axis of {owner} is not of unit length: {list(x.numbers)}")
    if x.kind == UNALIGNED:
        return _unaligned_continuous(arguments[0])
    return getattr(pin, PREFIX + x.kind)(*(a if len(a) == 3 else float(a[0]) for a in arguments))


def _composite_from_data(x: _Joint, owner: str) -> pin.JointModel:
    if not x.parts or len(x.parts) != len(x.places):
        raise InputError(f"model: {owner} is composed of {len(x.parts)} joints and {len(x.places)} placements")
    joint = pin.JointModelComposite(len(x.parts))
    for part, placement in zip(x.parts, x.places, strict=True):
        joint.addJoint(_joint_from_data(part, owner), _placement_from_data(placement, owner))
    return joint


def _unaligned_continuous(axis: np.ndarray) -> pin.JointModel:
    """Return an unbounded revolute joint about any unit vector, bit for bit.

    In Python only Pinocchio's URDF reader creates such joints. It normalizes the axis, which is therefore scaled until
    normalization reproduces it exactly.

    Raises:
        InputError: if no scaling does.
    """
    for k in range(MAX_SCALINGS):
        joint = pin.buildModelFromXML(ROBOT.format(*(axis * (1 + k / MAX_SCALINGS)).tolist())).joints[1]
        if joint.shortname() == PREFIX + UNALIGNED and np.array_equal(subspace(joint)[3:, 0], axis):
            return joint.extract()
    raise InputError(f"model: a joint of kind {UNALIGNED!r} cannot have the axis {axis.tolist()}")
