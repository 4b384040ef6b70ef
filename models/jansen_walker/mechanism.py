"""Theo Jansen's linkage: legs on one driven crankshaft, hips fixed."""

from math import acos, atan2, cos, hypot, pi, sin
from typing import Annotated

from pydantic import Field

CM = 0.01
HOLY = {"a": 38, "b": 41.5, "c": 39.3, "d": 40.1, "e": 55.8, "f": 39.4, "g": 36.7, "h": 65.7, "i": 49, "j": 50}
HOLY |= {"k": 61.9, "l": 7.8, "m": 15}
TUBE = 0.25  # kg/m
SPEED = 2.0  # rad/s
SPACING = 0.1  # m between legs along the shaft
HINGE = {"joint": "revolute", "axis": [0.0, -1.0, 0.0]}  # positive angles lift +x towards +z

Point = tuple[float, float]  # x and z


def mechanism(legs: Annotated[int, Field(ge=1, le=8)] = 8) -> dict:
    """Return the tables of a walker; odd legs mirror even ones, and pairs follow each other at equal angles."""
    shaft = {"name": "crank", "parent": "world", "mass": 2.0, "inertia": [0.02, 0.01, 0.02, 0.0, 0.0, 0.0]}
    parts = [leg(i, 2 * pi * (i // 2) / ((legs + 1) // 2)) for i in range(legs)]
    return {
        "title": f"Theo Jansen's walker, {legs} legs",
        "gravity": [0.0, 0.0, -9.81],
        "duration": 10.0,
        "order": {"T": 2.0, "steps": 10},
        "body": [{**shaft, **HINGE}, *(body for part in parts for body in part["body"])],
        "frame": [frame for part in parts for frame in part["frame"]],
        "closure": [closure for part in parts for closure in part["closure"]],
        "driver": [{"joint": "crank", "motion": {"kind": "polynomial", "coefficients": [0.0, SPEED]}}],
        "start": {"guess": {name: angle for part in parts for name, angle in part["start"].items()}},
    }


def leg(n: int, phase: float) -> dict:
    """Bodies, frames and closures of leg n, whose crank pin is at the angle ``phase`` at the start."""
    side, y = (1.0 if n % 2 == 0 else -1.0), SPACING * n
    a, b, c, d, e, f, g, h, i, j, k, drop, m = (CM * x for x in HOLY.values())
    hip = (-side * a, -drop)
    pin = (m * cos(phase), m * sin(phase))
    upper = meet(pin, j, hip, b, lambda p: p[1])
    lower = meet(pin, k, hip, c, lambda p: -p[1])
    left = meet(hip, d, upper, e, lambda p: -side * p[0])
    knee = meet(left, f, lower, g, lambda p: distance(p, hip))
    foot = meet(knee, h, lower, i, lambda p: -p[1])

    thigh, arm, shin = angle(hip, upper), angle(hip, lower), angle(lower, knee)
    upper_rod, lower_rod, hanger = angle(pin, upper), angle(pin, lower), angle(left, knee)
    top, low = (b, 0.0), (c, 0.0)
    wing, toe = turned(hip, left, thigh), turned(lower, foot, shin)

    def name(part: str) -> str:
        return f"{part}_{n}"

    def body(part: str, parent: str, at: Point, *bars: tuple[Point, Point], y: float = 0.0) -> dict:
        return {"name": name(part), "parent": parent, "xyz": [at[0], y, at[1]], **HINGE, **inertia(bars)}

    def frame(part: str, parent: str, at: Point) -> dict:
        return {"name": name(part), "parent": name(parent), "xyz": [at[0], 0.0, at[1]]}

    def closure(part: str, *frames: str) -> dict:
        return {"name": name(part), "kind": "point", "frames": [name(frame) for frame in frames]}

    origin = (0.0, 0.0)
    return {
        "body": [
            body("thigh", "world", hip, (origin, top), (origin, wing), (top, wing), y=y),
            body("arm", "world", hip, (origin, low), y=y),
            body("upper_rod", "crank", pin, (origin, (j, 0.0)), y=y),
            body("lower_rod", "crank", pin, (origin, (k, 0.0)), y=y),
            body("hanger", name("thigh"), wing, (origin, (f, 0.0))),
            body("shin", name("arm"), low, (origin, (g, 0.0)), (origin, toe), ((g, 0.0), toe)),
        ],
        "frame": [
            frame("thigh_top", "thigh", top),
            frame("upper_rod_tip", "upper_rod", (j, 0.0)),
            frame("arm_tip", "arm", low),
            frame("lower_rod_tip", "lower_rod", (k, 0.0)),
            frame("knee", "shin", (g, 0.0)),
            frame("hanger_tip", "hanger", (f, 0.0)),
            frame("foot", "shin", toe),
        ],
        "closure": [
            closure("upper_pin", "upper_rod_tip", "thigh_top"),
            closure("lower_pin", "lower_rod_tip", "arm_tip"),
            closure("knee_pin", "hanger_tip", "knee"),
        ],
        "start": {
            name("thigh"): thigh,
            name("arm"): arm,
            name("upper_rod"): upper_rod,
            name("lower_rod"): lower_rod,
            name("hanger"): hanger - thigh,
            name("shin"): shin - arm,
        },
    }


def meet(a: Point, r: float, b: Point, s: float, prefer) -> Point:
    """The point at distances r from a and s from b; of the two, the one preferred by ``prefer``."""
    d, phi = distance(a, b), angle(a, b)
    turn = acos((r * r + d * d - s * s) / (2 * r * d))
    return max(((a[0] + r * cos(phi + t), a[1] + r * sin(phi + t)) for t in (turn, -turn)), key=prefer)


def distance(a: Point, b: Point) -> float:
    """Distance of two points."""
    return hypot(b[0] - a[0], b[1] - a[1])


def angle(a: Point, b: Point) -> float:
    """Angle of the line from a to b, from +x towards +z."""
    return atan2(b[1] - a[1], b[0] - a[0])


def turned(a: Point, b: Point, phi: float) -> Point:
    """The vector from a to b, in axes rotated by phi."""
    r, psi = distance(a, b), angle(a, b) - phi
    return r * cos(psi), r * sin(psi)


def inertia(bars: tuple[tuple[Point, Point], ...]) -> dict:
    """Mass, centre of mass and inertia about it of thin tubes in the x-z plane."""
    masses = [TUBE * distance(a, b) for a, b in bars]
    middles = [((a[0] + b[0]) / 2, (a[1] + b[1]) / 2) for a, b in bars]
    total = sum(masses)
    x0, z0 = (sum(m * p[k] for m, p in zip(masses, middles, strict=True)) / total for k in (0, 1))
    xx = xz = zz = 0.0
    for m, (a, b), (x, z) in zip(masses, bars, middles, strict=True):
        dx, dz = b[0] - a[0], b[1] - a[1]
        xx += m * (dx * dx / 12 + (x - x0) ** 2)
        zz += m * (dz * dz / 12 + (z - z0) ** 2)
        xz += m * (dx * dz / 12 + (x - x0) * (z - z0))
    return {"mass": total, "com": [x0, 0.0, z0], "inertia": [zz, xx + zz, xx, 0.0, -xz, 0.0]}
