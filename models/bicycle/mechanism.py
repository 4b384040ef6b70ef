"""The benchmark bicycle: a frame with a rigid rider, a fork, and two wheels that roll on the ground.

The paper's axes (x ahead, y right, z down) become x ahead, y left, z up: I_xz and the signs of y and z change.
"""

from math import cos, pi, sin
from typing import Annotated

from pydantic import Field

WHEELBASE, TRAIL, TILT = 1.02, 0.08, pi / 10  # m, m, rad between the steer axis and the vertical
REAR = {"radius": 0.3, "mass": 2.0, "across": 0.0603, "along": 0.12}
FRONT = {"radius": 0.35, "mass": 3.0, "across": 0.1405, "along": 0.28}
FRAME = {"mass": 85.0, "at": (0.3, 0.9), "inertia": [9.2, 11.0, 2.8, 0.0, -2.4, 0.0]}
FORK = {"mass": 4.0, "at": (0.9, 0.7), "inertia": [0.05892, 0.06, 0.00708, 0.0, 0.00756, 0.0]}
STEER_AXIS = [-sin(TILT), 0.0, cos(TILT)]  # it meets the ground the trail ahead of the front wheel's contact
HEAD = (WHEELBASE + TRAIL - 0.8 * sin(TILT) / cos(TILT), 0.8)  # x and z of a point on the steer axis


def mechanism(speed: Annotated[float, Field(ge=-50, le=50)] = 5.0) -> dict:
    """Return the tables of the bicycle, upright and straight, at a speed in m/s."""
    rear, front = (0.0, REAR["radius"]), (WHEELBASE, FRONT["radius"])
    wheels = {"rear_wheel": REAR, "front_wheel": FRONT}
    turns = {name: speed / wheel["radius"] for name, wheel in wheels.items()}
    return {
        "title": "Benchmark bicycle",
        "gravity": [0.0, 0.0, -9.81],
        "duration": 5.0,
        "order": {"T": 2.0, "steps": 10, "v": {"frame": [4.0, -2.0 * REAR["radius"], 0.0, 2.0, 0.0, 0.0]}},  # it falls
        "body": [
            {"name": "frame", "parent": "world", "joint": "free", **body(FRAME, rear)},
            {"name": "rear_wheel", "parent": "frame", **wheel(REAR)},
            {
                "name": "fork", "parent": "frame", "joint": "revolute", "axis": STEER_AXIS, "xyz": between(rear, HEAD),
                **body(FORK, HEAD),
            },
            {"name": "front_wheel", "parent": "fork", "xyz": between(HEAD, front), **wheel(FRONT)},
        ],
        "closure": [
            {"name": name, "kind": "rolling", "frames": ["world", name], "radius": w["radius"], "axis": [0.0, 1.0, 0.0]}
            for name, w in wheels.items()
        ],
        "start": {
            "guess": {"frame": [0.0, 0.0, REAR["radius"], 0.0, 0.0, 0.0, 1.0]},
            "guess_v": {"frame": [speed, 0.0, 0.0, 0.0, 0.0, 0.0], **turns},
        },
    }  # fmt: skip


def between(a: tuple, b: tuple) -> list:
    """The vector from one point (x, z) to another."""
    return [b[0] - a[0], 0.0, b[1] - a[1]]


def body(part: dict, origin: tuple) -> dict:
    """Mass, centre of mass and inertia of a body in axes at an origin (x, z)."""
    return {"mass": part["mass"], "com": between(origin, part["at"]), "inertia": part["inertia"]}


def wheel(part: dict) -> dict:
    """A wheel on its axle, to the left."""
    across, along = part["across"], part["along"]
    inertia = [across, along, across, 0.0, 0.0, 0.0]
    return {"joint": "continuous", "axis": [0.0, 1.0, 0.0], "mass": part["mass"], "inertia": inertia}
