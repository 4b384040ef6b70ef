"""Checks before Pinocchio reads a URDF: it ignores inertials that it cannot read, and assumes a tree of links."""

import xml.etree.ElementTree as ET
from collections.abc import Collection

import numpy as np

from ....errors import InputError
from ...checked_table import HUGE
from ..mechanism_file.inertias import checked_inertia

COUNTS = {"xyz": 3, "rpy": 3, "quat_xyzw": 4}
MOMENTS = ("ixx", "ixy", "ixz", "ixy", "iyy", "iyz", "ixz", "iyz", "izz")  # entries of the symmetric tensor, by rows
LIMITED = ("revolute", "prismatic")
JOINT_KEYS = (*COUNTS, "lower", "upper", "effort", "velocity", "damping", "friction", "multiplier", "offset")


def check_urdf(robot: ET.Element, name: str, types: Collection[str]) -> None:
    """Check inertias, the numbers and types of joints, and that links form a tree.

    Args:
        robot: root element of the file.
        name: name of the file, for messages.
        types: known types of joints.

    Raises:
        InputError: for a missing or invalid number, another type, an inertia that is not positive semi-definite, or a
            loop of links.
    """
    for link in robot.iterfind("link"):
        if (inertial := link.find("inertial")) is not None:
            _require_inertia(inertial, f"link {link.get('name')!r} of {name}")
    for joint in robot.iterfind("joint"):
        for e in joint:
            for key in e.attrib.keys() & JOINT_KEYS:
                _numbers(e, key, f"joint {joint.get('name')!r} of {name}")
        _require_type(joint, f"joint {joint.get('name')!r} of {name}", types)
    _require_tree(robot, name)


def _require_type(joint: ET.Element, name: str, types: Collection[str]) -> None:
    """Reject an unknown type, and joints without the limits that the format requires.

    Raises:
        InputError: names the joint.
    """
    if (kind := joint.get("type", "")) not in types:
        raise InputError(f"{name} has type {kind[:60]!r}, expected one of {', '.join(types)}")
    if kind in LIMITED:
        limit = joint.find("limit")
        missing = [key for key in ("effort", "velocity") if limit is None or key not in limit.attrib]
        if missing:
            raise InputError(f"{name} is {kind} and needs a limit with {' and '.join(missing)}")


def _require_inertia(inertial: ET.Element, name: str) -> None:
    mass, inertia = (inertial.find(tag) for tag in ("mass", "inertia"))
    if mass is None or inertia is None:
        raise InputError(f"the inertial of {name} needs a mass and an inertia")
    for e in inertial.findall("origin"):
        for key in e.attrib.keys() & COUNTS:
            _numbers(e, key, name)
    tensor = np.reshape([_numbers(inertia, key, name) for key in MOMENTS], (3, 3))
    checked_inertia(_numbers(mass, "value", name)[0], np.zeros(3), tensor, name)


def _numbers(e: ET.Element, key: str, name: str) -> list[float]:
    """Return the numbers of an attribute.

    Raises:
        InputError: for any other text.
    """
    text, count = e.get(key, ""), COUNTS.get(key, 1)
    try:
        out = [float(x) for x in text.split()] if "_" not in text else []  # Python's 1_000 makes a link massless
    except ValueError:
        out = []
    if len(out) != count or not all(abs(x) <= HUGE for x in out):
        what = "a finite number" if count == 1 else f"{count} finite numbers"
        raise InputError(f"{e.tag}/@{key} of {name} takes {what}, got {text[:60]!r}")
    return out


def _require_tree(robot: ET.Element, name: str) -> None:
    """Reject a link that is the child of several joints or its own ancestor."""
    parents: dict[str, tuple[str, str]] = {}  # joint and parent of each child link
    for joint in robot.iterfind("joint"):
        ends = [joint.find(tag) for tag in ("parent", "child")]
        parent, child = ("" if e is None else e.get("link", "") for e in ends)
        if child in parents:
            raise InputError(
                f"{name}: link {child!r} is the child of joints {parents[child][0]!r} and {joint.get('name')!r}: "
                "cut the loop at one of them, which a closure replaces"
            )
        parents[child] = joint.get("name", ""), parent
    for link in parents:
        seen, at = {link}, link
        while at in parents:
            at = parents[at][1]
            if at in seen:
                raise InputError(f"{name}: link {at!r} is its own ancestor")
            seen.add(at)
