"""A Pinocchio model as JSON data, for saved runs: validated when read, and recreated by calls of Pinocchio.

The recreated model is bitwise equal. Pinocchio's archives are not used: reading a damaged one may terminate the
process.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
import pinocchio as pin
from pydantic import AllowInfNan, Field, ValidationError

from ..data_types import JsonObject
from ..errors import InputError
from .checked_table import Table, one_line
from .flexible import FlexibleBody
from .flexible.modal_data import modal_body_from_data, modal_data
from .scene.shapes import PlacementEntries
from .tree.joints import PER_COORDINATE, PER_VELOCITY, subspace
from .tree.tree_terms import flexible_bodies

PREFIX = "JointModel"
COMPOSITE, SKEWED = "Composite", "RevoluteUnboundedUnaligned"
NUMBERS: dict[str, tuple[str, ...]] = {  # kinds of joints, and arguments of their constructors
    **dict.fromkeys(("RX", "RY", "RZ", "RUBX", "RUBY", "RUBZ", "PX", "PY", "PZ"), ()),
    **dict.fromkeys(("Spherical", "SphericalZYX", "Planar", "Translation", "FreeFlyer"), ()),
    **dict.fromkeys(("HX", "HY", "HZ"), ("pitch",)),
    "RevoluteUnaligned": ("axis",),
    "PrismaticUnaligned": ("axis",),
    "HelicalUnaligned": ("axis", "pitch"),
    "Universal": ("axis1", "axis2"),
    "Ellipsoid": ("radius_x", "radius_y", "radius_z"),
}
KINDS = (*NUMBERS, SKEWED, COMPOSITE)
SCALES = 64  # trial scalings of a skewed axis until normalisation reproduces it exactly
ROBOT = """<robot name="one"><link name="a"/><link name="b"/><joint name="j" type="continuous">
<parent link="a"/><child link="b"/><axis xyz="{!r} {!r} {!r}"/></joint></robot>"""

Limit = Annotated[float, AllowInfNan(True)]
Vector = tuple[float, float, float]
Symmetric = tuple[float, float, float, float, float, float]


class _Inertia(Table):
    """mass in kg, com in m, moments (ixx, ixy, iyy, ixz, iyz, izz) about it in kg m^2."""

    mass: float
    com: Vector
    moments: Symmetric


class _Joint(Table):
    """A joint by its kind and parameters; a composite one by its joints and their placements."""

    kind: str
    numbers: tuple[float, ...] = ()
    parts: tuple["_Joint", ...] = ()
    places: tuple[PlacementEntries, ...] = ()


class _Link(Table):
    """A joint in the tree, and the inertia of its body; place: rows of [R p], the placement on the parent joint."""

    name: str
    parent: int = Field(ge=0)
    place: PlacementEntries
    joint: _Joint
    inertia: _Inertia


class _Frame(Table):
    """A frame on a joint."""

    name: str
    type: Literal["OP_FRAME", "JOINT", "FIXED_JOINT", "BODY", "SENSOR"]
    joint: int = Field(ge=0)
    frame: int = Field(ge=0)
    place: PlacementEntries
    inertia: _Inertia


class _Model(Table):
    """A model; ``arrays`` holds values per velocity or coordinate."""

    name: str
    gravity: Symmetric
    ground: _Inertia
    joints: tuple[_Link, ...]
    frames: tuple[_Frame, ...]
    arrays: dict[str, tuple[Limit, ...]]
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
            {"name": n, "parent": int(p), "place": _placement(at), "joint": _joint(j), "inertia": _inertia(y)}
            for n, p, at, j, y in list(joints)[1:]
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
    model.inertias[0] = _inertia_from_data(validated.ground)
    for number, x in enumerate(validated.joints, 1):
        if x.parent >= number:
            raise InputError(f"model: joint {x.name!r} has parent joint {x.parent}, which does not precede it")
        if model.existJointName(x.name):
            raise InputError(f"model: two joints are called {x.name!r}")
        model.addJoint(x.parent, _joint_from_data(x.joint), _placement_from_data(x.place), x.name)
        model.inertias[number] = _inertia_from_data(x.inertia)
    for f in validated.frames:
        if f.joint >= model.njoints or f.frame >= len(model.frames):
            raise InputError(f"model: frame {f.name!r} is on joint {f.joint} and frame {f.frame}, which do not exist")
        kind = pin.FrameType.names[f.type]
        if model.existFrame(f.name, kind):
            raise InputError(f"model: two frames are called {f.name!r}")
        placement, inertia = _placement_from_data(f.place), _inertia_from_data(f.inertia)
        model.addFrame(pin.Frame(f.name, f.joint, f.frame, placement, kind, inertia), False)
    for names, size in ((PER_VELOCITY, model.nv), (PER_COORDINATE, model.nq)):
        for name in names:
            values = np.array(validated.arrays.get(name, ()))
            invalid = ~np.isfinite(values) if not name.endswith("Limit") else np.isnan(values)
            if len(values) != size or invalid.any():
                raise InputError(f"model: {name} needs {size} numbers")
            getattr(model, name)[:] = values
    if validated.flexible:
        model.flexible = _flexible_from_data(validated.flexible, model)
    return model


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


def _placement_from_data(x: PlacementEntries) -> pin.SE3:
    rows = np.array(x).reshape(3, 4)
    return pin.SE3(rows[:, :3], rows[:, 3])


def _inertia(x: pin.Inertia) -> JsonObject:
    tensor = x.inertia
    moments = [float(tensor[i, j]) for i in range(3) for j in range(i + 1)]
    return {"mass": float(x.mass), "com": x.lever.tolist(), "moments": moments}


def _inertia_from_data(x: _Inertia) -> pin.Inertia:
    ixx, ixy, iyy, ixz, iyz, izz = x.moments
    return pin.Inertia(x.mass, np.array(x.com), np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]))


def _joint(joint: pin.JointModel) -> JsonObject:
    kind, typed = joint.shortname().removeprefix(PREFIX), joint.extract()
    if kind == COMPOSITE:
        placements = [_placement(p) for p in typed.jointPlacements]
        return {"kind": kind, "parts": [_joint(j) for j in typed.joints], "places": placements}
    if kind == SKEWED:
        return {"kind": kind, "numbers": subspace(typed)[3:, 0].tolist()}
    if kind not in NUMBERS:
        raise InputError(f"a joint of kind {kind!r} cannot be serialised; known: {', '.join(KINDS)}")
    return {"kind": kind, "numbers": [float(x) for name in NUMBERS[kind] for x in np.atleast_1d(getattr(typed, name))]}


def _joint_from_data(x: _Joint) -> pin.JointModel:
    if x.kind == COMPOSITE:
        if not x.parts or len(x.parts) != len(x.places):
            raise InputError(f"model: a composite joint has {len(x.parts)} parts and {len(x.places)} placements")
        joint = pin.JointModelComposite(len(x.parts))
        for factor, placement in zip(x.parts, x.places, strict=True):
            joint.addJoint(_joint_from_data(factor), _placement_from_data(placement))
        return joint
    if x.kind not in KINDS:
        raise InputError(f"model: unknown kind of joint {x.kind!r}; known: {', '.join(KINDS)}")
    sizes = [3 if name.startswith("axis") else 1 for name in NUMBERS.get(x.kind, ("axis",))]
    if len(x.numbers) != sum(sizes):
        raise InputError(f"model: a joint of kind {x.kind!r} takes {sum(sizes)} numbers, got {len(x.numbers)}")
    arguments = np.split(np.array(x.numbers), np.cumsum(sizes)[:-1]) if sizes else []
    if x.kind == SKEWED:
        return _skewed_revolute(arguments[0])
    return getattr(pin, PREFIX + x.kind)(*(a if len(a) == 3 else float(a[0]) for a in arguments))


def _skewed_revolute(axis: np.ndarray) -> pin.JointModel:
    """Return an unbounded revolute joint about any axis: only Pinocchio's URDF reader creates and normalises those.

    Raises:
        InputError: for an axis that is not of unit length.
    """
    for k in range(SCALES):
        joint = pin.buildModelFromXML(ROBOT.format(*(axis * (1 + k / SCALES)).tolist())).joints[1]
        if joint.shortname() == PREFIX + SKEWED and np.array_equal(subspace(joint)[3:, 0], axis):
            return joint.extract()
    raise InputError(f"model: a joint of kind {SKEWED!r} has no axis of unit length: {axis.tolist()}")
