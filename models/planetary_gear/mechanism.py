"""A planetary gear: a sun, planets on a carrier, and a fixed ring."""

from math import cos, pi, sin
from typing import Annotated

from pydantic import Field

SUN, PLANET = 0.03, 0.02  # pitch radii in m
RING = SUN + 2 * PLANET


def disc(mass: float, radius: float) -> dict:
    """A wheel that turns about z."""
    across, along = mass * radius**2 / 4, mass * radius**2 / 2
    return {"joint": "continuous", "mass": mass, "inertia": [across, across, along, 0.0, 0.0, 0.0]}


def mechanism(planets: Annotated[int, Field(ge=1, le=3)] = 3) -> dict:
    """Return the tables for one to three planets."""
    names, at = [f"planet_{i}" for i in range(1, planets + 1)], SUN + PLANET
    places = [[at * cos(2 * pi * i / 3), at * sin(2 * pi * i / 3), 0.0] for i in range(planets)]
    return {
        "title": "Planetary gear",
        "duration": 5.0,
        "order": {"T": 1.0, "steps": 10},
        "body": [
            {"name": "sun", "parent": "world", **disc(0.5, SUN)},
            {"name": "carrier", "parent": "world", **disc(0.4, at)},
            *({"name": n, "parent": "carrier", "xyz": p, **disc(0.2, PLANET)}
              for n, p in zip(names, places, strict=True)),
        ],
        "closure": [
            *({"name": f"sun and {n}", "kind": "gear", "frames": ["sun", n], "radii": [SUN, PLANET]} for n in names),
            *({"name": f"{n} and ring", "kind": "gear", "frames": [n, "world"], "radii": [PLANET, -RING]}
              for n in names),
        ],
        "force": [
            {"kind": "joint_torque", "joint": "sun", "torque": {"kind": "harmonic", "amplitude": 0.02, "omega": 3.0}},
            {"kind": "joint_damping", "joint": "carrier", "damping": 1e-3},
        ],
        "start": {"q": {"sun": 0.0}, "v": {"sun": 10.0}},
    }  # fmt: skip
