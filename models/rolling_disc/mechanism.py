"""A thin disc that rolls on the ground: steady circles, nods, straight motion and its stability."""

from math import cos, pi, sin
from typing import Annotated

from pydantic import Field

RADIUS, MASS, GRAVITY = 0.3, 1.0, 9.81
ACROSS = MASS * RADIUS**2 / 4  # about a diameter; twice as much about the axle


def mechanism(
    inclination: Annotated[float, Field(gt=0, lt=pi)] = 1.1,
    precession: float = 4.0,
    nod: float = 0.0,
    spin: float | None = None,
) -> dict:
    """Return the tables of a disc.

    Args:
        inclination: angle in rad between disc and ground; pi/2 is upright.
        precession: rate of the heading, rad/s, to the left.
        nod: rate of the inclination, rad/s.
        spin: rotation rate of the disc about its axle, including that of the heading, rad/s; by default of the steady
            circle.
    """
    n = steady(inclination, precession) if spin is None else spin
    massless = {"mass": 0.0}
    return {
        "title": "Rolling disc",
        "gravity": [0.0, 0.0, -GRAVITY],
        "duration": 5.0,
        "order": {
            "T": 2.0, "steps": 10, "q": {"lean": pi / 2 - 1.0},  # nodding: a steady circle tests no method
            "v": {"heading": 2.0, "lean": -0.5, "disc": -6.0 - 2.0 * cos(1.0)},
        },
        "body": [
            {"name": "place", "parent": "world", "joint": "translation", **massless},
            {"name": "heading", "parent": "place", "joint": "continuous", "axis": [0.0, 0.0, 1.0], **massless},
            {"name": "lean", "parent": "heading", "joint": "revolute", "axis": [1.0, 0.0, 0.0], **massless},
            {
                "name": "disc", "parent": "lean", "joint": "continuous", "axis": [0.0, 1.0, 0.0], "mass": MASS,
                "inertia": [ACROSS, 2 * ACROSS, ACROSS, 0.0, 0.0, 0.0],
            },
        ],
        "closure": [
            {
                "name": "ground", "kind": "rolling", "frames": ["world", "disc"],
                "radius": RADIUS, "axis": [0.0, 1.0, 0.0],
            }
        ],
        "start": {
            "q": {"lean": pi / 2 - inclination},
            "v": {"heading": precession, "lean": -nod, "disc": n - precession * cos(inclination)},
            "guess": {"place": [0.0, 0.0, RADIUS * sin(inclination)]},
        },
    }  # fmt: skip


def steady(a: float, w: float) -> float:
    """The spin of a steady circle: 0 = (C + m R^2) n w sin a - A w^2 sin a cos a + m g R cos a, C = 2 A."""
    rate_factor = (2 * ACROSS + MASS * RADIUS**2) * w * sin(a)
    if not rate_factor:
        raise ValueError("a disc that goes straight needs its spin")
    return (ACROSS * w * w * sin(a) - MASS * GRAVITY * RADIUS) * cos(a) / rate_factor
