"""A solid ball rolls on a turntable that is driven."""

from math import cos, sin
from typing import Annotated

from pydantic import Field

RADIUS, MASS = 0.1, 0.5  # m, kg
PLACE, SPEED = (0.6, 0.0), (0.0, 0.5)  # of the ball's centre, in m and m/s


def mechanism(rate: float = 3.0, tilt: Annotated[float, Field(ge=-1.5, le=1.5)] = 0.0) -> dict:
    """Return the tables, for a turntable rate in rad/s, tilted by an angle in rad: down along x."""
    x, y = PLACE
    u, v = SPEED
    spin = [(rate * x - v) / RADIUS, (rate * y + u) / RADIUS, 0.0]
    return {
        "title": "Ball on a turntable",
        "gravity": [9.81 * sin(tilt), 0.0, -9.81 * cos(tilt)],
        "duration": 10.0,
        "order": {"T": 1.0, "steps": 20},
        "body": [
            {"name": "table", "parent": "world", "joint": "continuous", "mass": 10.0,
             "inertia": [2.5, 2.5, 5.0, 0.0, 0.0, 0.0]},
            {"name": "ball", "parent": "world", "joint": "free", "mass": MASS,
             "inertia": [0.4 * MASS * RADIUS**2] * 3 + [0.0] * 3},
        ],
        "closure": [{"name": "contact", "kind": "rolling", "frames": ["table", "ball"], "radius": RADIUS}],
        "driver": [{"joint": "table", "motion": {"kind": "polynomial", "coefficients": [0.0, rate]}}],
        "start": {
            "q": {"ball": [x, y, RADIUS, 0.0, 0.0, 0.0, 1.0]},
            "v": {"table": rate, "ball": [u, v, 0.0, *spin]},
        },
    }  # fmt: skip
