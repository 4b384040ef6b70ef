"""Names and units of the coordinates of joints."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import pinocchio as pin

from ...units import common_unit
from .frames import find_joint, joint_names

if TYPE_CHECKING:
    from ..mechanism import Mechanism

COORDINATE_NAMES: dict[
    str, tuple[tuple[str, ...], tuple[str, ...]]
] = {  # joint: names of the coordinates in q and in v
    "Translation": (("x", "y", "z"), ("x", "y", "z")),
    "Spherical": (("qx", "qy", "qz", "qw"), ("wx", "wy", "wz")),
    "FreeFlyer": (("x", "y", "z", "qx", "qy", "qz", "qw"), ("vx", "vy", "vz", "wx", "wy", "wz")),
    "Planar": (("x", "y", "cos", "sin"), ("vx", "vy", "wz")),
    "Universal": (("1", "2"), ("1", "2")),
}
JointUnits = dict[str, dict[str, dict[str, str]]]  # units by q or v, joint, and coordinate, such as base.x
DIMENSIONLESS = ("qx", "qy", "qz", "qw", "cos", "sin")


def effort_unit(units: Mapping[str, str], joint: str) -> str:
    """Return the unit of the effort on a joint of one coordinate, from the units of coordinates."""
    return "N" if units.get(f"v.{joint}") == "m/s" else "N m"


def component_suffixes(mech: "Mechanism", name: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the suffixes of a joint's name for its coordinates in q and in v; "" for a single coordinate."""
    return model_suffixes(mech.model, name)


def model_suffixes(model: pin.Model, name: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the suffixes of a joint of a model, see `component_suffixes`."""
    joint = find_joint(model, name)
    kind = _kind(joint)
    if (joint.nq, joint.nv) in ((1, 1), (2, 1)):
        return ("",), ("",)
    numbers = [tuple(str(k + 1) for k in range(n)) for n in (joint.nq, joint.nv)]
    q, v = COORDINATE_NAMES.get(kind, numbers)
    return tuple(f".{x}" for x in q), tuple(f".{x}" for x in v)


def _kind(joint: pin.JointModel) -> str:
    return str(joint.shortname().removeprefix("JointModel"))


def coordinate_units(mech: "Mechanism") -> dict[str, str]:
    """Return the units of ``q.*`` and then ``v.*``: rad or m, and per s; 1 for components of quaternions."""
    return coordinate_units_of(mech.model)


def coordinate_units_of(model: pin.Model) -> dict[str, str]:
    """Return the units of the coordinates of a model, see `coordinate_units`."""
    return units_by_coordinate(joint_coordinate_units(model))


def units_by_coordinate(units: JointUnits) -> dict[str, str]:
    """Return the units of joints by ``q.<coordinate>`` and then ``v.<coordinate>``."""
    return {f"{k}.{x}": unit for k, joints in units.items() for joint in joints.values() for x, unit in joint.items()}


def joint_coordinate_units(model: pin.Model) -> JointUnits:
    """Return the units of the coordinates of a model, by joint, as names such as ``base.x`` alone may be ambiguous."""
    out: JointUnits = {"q": {}, "v": {}}
    for name in joint_names(model):
        kind = _kind(find_joint(model, name))
        prismatic = kind.startswith("P") and kind != "Planar"
        for (letter, per), suffixes in zip((("q", ""), ("v", "/s")), model_suffixes(model, name), strict=True):
            by_name = out[letter][name] = dict[str, str]()
            for suffix in suffixes:
                length = suffix.lstrip(".v") in ("x", "y", "z") if suffix else prismatic
                unit = "m" if length else "1" if suffix[1:] in DIMENSIONLESS else "rad"
                by_name[name + suffix] = unit + per
    return out


def acceleration_units(mech: "Mechanism") -> dict[str, str]:
    """Return the units of ``a.*``, the components of v': rad/s^2 or m/s^2."""
    return {f"a.{name[2:]}": f"{unit}^2" for name, unit in coordinate_units(mech).items() if name.startswith("v.")}


def quantity_units(mech: "Mechanism") -> dict[str, str]:
    """Return the units of the largest of all components of q, v (in the tangent), lam, g and G v by name.

    Components of different units give a list, ``"rad, m"``; ``own lam`` are the multipliers of the method.
    """
    rates = [unit for name, unit in coordinate_units(mech).items() if name.startswith("v.")]
    positional = (unit for unit, has_g in zip(mech.row_units, mech.positional, strict=True) if has_g)
    lam = common_unit("N" if unit == "m" else "N m" for unit in mech.row_units)
    return {
        "q": common_unit(unit.removesuffix("/s") for unit in rates),
        "v": common_unit(rates),
        "own lam": lam,
        "lam": lam,
        "g": common_unit(positional),
        "Gv": common_unit(f"{unit}/s" for unit in mech.row_units),
    }
