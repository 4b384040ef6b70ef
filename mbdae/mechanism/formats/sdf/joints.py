"""Joints of an SDF model: kind, placement, axes, and forces along each axis."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

from ....errors import InputError
from ....tolerances import PARALLEL
from ...imported_model import Mimic
from ..recorded import Recorded
from .elements import AXES_IN_MODEL, MODEL, SdfElements

MOVING: dict[str, Callable[..., Any]] = {
    "revolute": pin.JointModelRevoluteUnaligned,
    "continuous": pin.JointModelRevoluteUnaligned,
    "prismatic": pin.JointModelPrismaticUnaligned,
    "universal": pin.JointModelUniversal,
    "ball": pin.JointModelSpherical,
}
AXES = {"revolute": 1, "continuous": 1, "prismatic": 1, "universal": 2, "ball": 0, "fixed": 0}
UNLIMITED = 1e16  # value of SDF for a joint without a limit


@dataclass(frozen=True)
class SdfAxis:
    """An axis of a joint in an SDF file.

    Attributes:
        xyz: unit vector in the joint's frame.
        damping: damping coefficient in N m s/rad or N s/m.
        friction: dry friction in N m or N.
        stiffness: stiffness in N m/rad or N/m.
        rest: rest position of the spring, in rad or m.
        limits: lower and upper limit in rad or m.
        bounds: bounds of effort and velocity.
    """

    xyz: tuple[float, ...]
    damping: float = 0.0
    friction: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    limits: tuple[float, float] = (-np.inf, np.inf)
    bounds: tuple[float, float] = (np.inf, np.inf)

    @property
    def has_limits(self) -> bool:
        """Whether the axis has a limit."""
        return bool(np.isfinite(self.limits).any())

    @property
    def has_bounds(self) -> bool:
        """Whether its effort or its velocity has a limit."""
        return bool(np.isfinite(self.bounds).any())


@dataclass(frozen=True)
class SdfJoint:
    """A joint of an SDF file.

    Attributes:
        name: name of the joint.
        kind: kind in the file.
        parent: link, or the world.
        child: link, or the world.
        placement: placement in the world.
        axes: one axis for each coordinate, none for ball joints.
        mimic: the coupling to another joint.
        unsupported_leader: description of its leader, if not supported.
    """

    name: str
    kind: str
    parent: str
    child: str
    placement: pin.SE3
    axes: tuple[SdfAxis, ...] = ()
    mimic: Mimic | None = field(default=None)
    unsupported_leader: str = ""

    @property
    def scalar(self) -> bool:
        """Whether it has one coordinate."""
        return AXES[self.kind] == 1

    @property
    def has_force(self) -> bool:
        """Whether a force acts along its axes."""
        return any(a.damping or a.stiffness for a in self.axes)

    def model(self) -> Any:
        """Return the Pinocchio joint."""
        return MOVING[self.kind](*(np.array(a.xyz) for a in self.axes))

    def copy_to(self, model: pin.Model, index: int) -> None:
        """Write damping, friction and limits of the axes into the model's arrays at the joint with this index."""
        moving = model.joints[index]
        for i, a in enumerate(self.axes):
            v, q = moving.idx_v + i, moving.idx_q + i
            model.damping[v] = a.damping
            model.upperDryFrictionLimit[v], model.lowerDryFrictionLimit[v] = a.friction, -a.friction
            model.lowerPositionLimit[q], model.upperPositionLimit[q] = a.limits
            (effort, velocity) = a.bounds
            model.upperEffortLimit[v], model.lowerEffortLimit[v] = effort, -effort
            model.upperVelocityLimit[v], model.lowerVelocityLimit[v] = velocity, -velocity


def read_joint(sdf: SdfElements, name: str, e: Recorded) -> SdfJoint:
    """Read a joint.

    Raises:
        InputError: for an unsupported kind, unknown links, or an axis without a direction.
    """
    kind, link_names = e.get("type"), [e.text(key) or "" for key in ("parent", "child")]
    if kind not in AXES:
        raise InputError(f"{sdf.file}: joint {name!r} is of kind {kind!r}; known: {', '.join(AXES)}")
    links = []
    for end in link_names:
        link = sdf.link_of(end) if end else None
        if link is None:
            links_known = ", ".join(sdf.links)
            raise InputError(f"{sdf.file}: joint {name!r} joins {end!r}, which is not a link; links: {links_known}")
        links.append(link)
    if links[0] == links[1]:
        raise InputError(f"{sdf.file}: joint {name!r} joins {links[0]!r} with itself")
    placement, tags = sdf.placement_of(name), ("axis", "axis2")[: AXES[kind]]
    axes = tuple(_axis(sdf, name, kind, e.first(tag), placement) for tag in tags)
    if len(axes) == 2 and abs(np.dot(axes[0].xyz, axes[1].xyz)) > PARALLEL:
        raise InputError(f"{sdf.file}: the axes of joint {name!r} are not perpendicular")
    mimic, unsupported_leader = _mimic(sdf, name, e.first("axis/mimic") if AXES[kind] == 1 else None)
    return SdfJoint(name, kind, links[0], links[1], placement, axes, mimic, unsupported_leader)


def _axis(sdf: SdfElements, joint: str, kind: str, e: Recorded | None, placement: pin.SE3) -> SdfAxis:
    found = None if e is None else e.first("xyz")
    xyz = np.array(sdf.parse_numbers("0 0 1" if found is None else found.text(), 3, f"the axis of joint {joint!r}"))
    if not np.linalg.norm(xyz) > 0:
        raise InputError(f"{sdf.file}: the axis of joint {joint!r} is zero")
    in_model = sdf.version <= AXES_IN_MODEL or (e is not None and sdf.is_set(e, "use_parent_model_frame"))
    frame = MODEL if in_model else found.get("expressed_in") if found else ""
    in_joint = placement.rotation.T @ sdf.placement_of(frame).rotation @ xyz if frame else xyz
    unit = tuple((in_joint / np.linalg.norm(in_joint)).tolist())

    def number(key: str, quantity: str, default: float = 0.0) -> float:
        return sdf.number(e, key, default, f"the {quantity} of joint {joint!r}")

    def bound(key: str) -> float:
        text = "" if e is None else e.text(f"limit/{key}") or ""
        value = np.inf if text.lstrip("+-").lower() in ("", "inf", "infinity") else number(f"limit/{key}", key)
        return value if 0 <= value < UNLIMITED else np.inf

    def end(key: str, sign: float) -> float:
        text = "" if e is None or kind == "continuous" else e.text(f"limit/{key}") or ""
        if text.lstrip("+-").lower() in ("", "inf", "infinity"):
            return sign * np.inf
        value = number(f"limit/{key}", f"{key} limit")
        return value if abs(value) < UNLIMITED else sign * np.inf

    return SdfAxis(
        unit,
        number("dynamics/damping", "damping"),
        number("dynamics/friction", "friction"),
        number("dynamics/spring_stiffness", "spring"),
        number("dynamics/spring_reference", "spring"),
        (end("lower", -1), end("upper", 1)),
        (bound("effort"), bound("velocity")),
    )


def _mimic(sdf: SdfElements, joint: str, e: Recorded | None) -> tuple[Mimic | None, str]:
    """Return q = multiplier (q_leader - reference) + offset, or the name of a leader without such a coordinate."""
    if e is None:
        return None, ""
    leader, keys = e.get("joint"), ("multiplier", "offset", "reference")
    ratio, offset, reference = (sdf.number(e, key, 0.0, f"the mimic of joint {joint!r}") for key in keys)
    other = sdf.by_name.get(leader)
    scalar = other is not None and other.tag == "joint" and AXES.get(other.get("type")) == 1
    if not scalar or leader == joint or e.get("axis", "axis") != "axis":
        return None, leader or "nothing"
    return Mimic(joint, leader, ratio, offset - ratio * reference), ""


def leaders(joints: Iterable[SdfJoint]) -> set[str]:
    """Return the names of the leaders of mimic joints."""
    return {j.mimic.other for j in joints if j.mimic}
