"""Keys of the kinds of closures, and consistency of their values."""

from math import pi
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .closure import Closure

BETWEEN_FRAMES: dict[str, tuple[str, str]] = {  # kind: gaps that vanish, directions that coincide
    "point": ("all", ""),
    "revolute": ("all", "axis"),
    "frame": ("all", "frame"),
    "prismatic": ("across", "frame"),
    "cylindrical": ("across", "axis"),
    "universal": ("all", "cross"),
    "in_plane": ("along", ""),
    "in_line": ("across", ""),
    "parallel": ("", "axis"),
}
ONE_SIDED = ("unilateral", "restitution", "rest")
OTHER_KEYS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {  # required keys, and optional ones
    "distance": (("frames", "length"), ONE_SIDED),
    "coupling": (("joints",), ("coefficients", "curve")),
    "cam": (("frames", "profile"), ("radius", "axis")),
    "slot": (("frames", "profile"), ()),
    "rolling": (
        ("frames",),
        ("radius", "tyre", "axis", "semi_axes", "centre", "grip", "contact", "surface", "surface_radius")
        + ONE_SIDED,
    ),
    "knife_edge": (("frames", "axis"), ()),
    "gear": (("frames", "radii"), ("axis",)),
    "bevel": (("frames", "radii"), ("axis", "second_axis")),
    "screw": (("frames", "lead"), ("axis",)),
    "ratio": (("joints", "coefficients"), ()),
}
GRIPS = {"full": (0.0, pi / 2), "longitudinal": (0.0,), "lateral": (pi / 2,), "none": ()}


def keys(kind: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Keys that a closure of this kind requires, and optional ones."""
    if kind in OTHER_KEYS:
        needed, more = OTHER_KEYS[kind]
        return ("kind", *needed), ("name", *more)
    gap, direction = BETWEEN_FRAMES[kind]
    axis = ("axis",) if gap in ("across", "along") or direction in ("axis", "cross") else ()
    second = ("second_axis",) if direction in ("axis", "cross") else ()
    return ("kind", "frames"), ("name", *axis, *second, *(ONE_SIDED if kind == "in_plane" else ()))


def check_keys(closure: "Closure") -> None:
    """Check that a closure has the keys of its kind, nonzero axes, and two different ends.

    Raises:
        ValueError: if it does not.
    """
    needed, possible = keys(closure.kind)
    given = {k for k in type(closure).model_fields if getattr(closure, k) is not None and k != "within"}
    for key in sorted(given.difference(known := (*needed, *possible))):
        raise ValueError(f"{key} does not belong to a {closure.kind} closure; known: {', '.join(known)}")
    for key in sorted(set(needed) - given):
        raise ValueError(f"a {closure.kind} closure needs {key}")
    for axis in (closure.axis, closure.second_axis):
        if axis is not None and not np.linalg.norm(axis) > 0:
            raise ValueError("an axis must not be zero")
    if len(set(ends := closure.between)) < len(ends):
        what = f"{closure.name or '-'.join(ends)!r} joins {'frame' if closure.frames else 'joint'}"
        raise ValueError(f"closure {what} {ends[0]!r} with itself")


def check_key_values(closure: "Closure") -> None:
    """Check that the values of keys are consistent with each other.

    Raises:
        ValueError: if they do not.
    """
    n, joints = len(closure.coefficients or ()), len(closure.joints or ())
    if closure.kind == "coupling" and (closure.coefficients is None) == (closure.curve is None):
        raise ValueError("a coupling needs one of coefficients and curve")
    if closure.kind == "coupling" and (closure.curve is None and n != joints if joints > 2 else n == 1):
        raise ValueError("a coupling of two joints has two coefficients or more, one of several joints one for each")
    if closure.curve and joints > 2:
        raise ValueError("curve belongs to couplings of two joints")
    if closure.kind == "ratio" and joints > 3:
        raise ValueError("a ratio has two or three joints")
    if closure.kind == "cam" and closure.profile:
        if (closure.radius is None) == (closure.axis is None):
            raise ValueError("a cam needs one of radius, of its roller, and axis, of its flat face")
        closure.profile.path.refuse(closure.radius)
    if closure.kind == "ratio" and (n > 1) != (joints > 2):
        raise ValueError("a ratio needs a third joint for coefficients c_1, ..., and has none without")
    if closure.kind == "gear" and not (closure.radii and all(closure.radii) and sum(closure.radii)):
        raise ValueError("radii must not be zero, nor their sum")
    if closure.kind == "bevel" and not (closure.radii and all(closure.radii)):
        raise ValueError("radii must not be zero")
    if closure.kind == "screw" and not closure.lead:
        raise ValueError("lead must not be zero")
    if closure.kind != "rolling":
        return
    if (closure.radius is None) == (closure.semi_axes is None):
        raise ValueError("a rolling closure needs one of radius and semi_axes")
    if closure.semi_axes and (closure.tyre is not None or closure.axis is not None or min(closure.semi_axes) <= 0):
        raise ValueError("semi_axes are positive, and tyre and axis belong to radius")
    if closure.radius and (closure.centre is not None or (closure.tyre or 0) > closure.radius):
        raise ValueError("centre belongs to semi_axes, and tyre is at most radius")
    if closure.radius and closure.axis is None and closure.tyre not in (None, closure.radius):
        raise ValueError("a wheel needs its axis; without one it is a sphere, whose tyre is its radius")
    if not closure.primitives():
        raise ValueError("nothing is kept: grip is 'none' and contact is false")
    curve, surface = closure.surface_radius, closure.surface or "plane"
    if (curve is None) != (surface == "plane"):
        raise ValueError("surface_radius belongs to surface 'sphere' or 'cylinder', which need it")
    if curve is not None and (closure.axis or closure.semi_axes or closure.grip not in (None, "full", "none")):
        raise ValueError("on spheres and cylinders roll spheres without an axis, with grip 'full' or 'none'")
    if curve is not None and (not curve or (curve < 0 and -curve <= (closure.radius or 0))):
        raise ValueError("surface_radius is not zero, and a sphere inside is smaller")
