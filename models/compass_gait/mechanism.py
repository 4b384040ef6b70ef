"""A compass walker: two straight legs with masses, hinged at a hip with a mass, passive on an incline."""

from math import cos, radians, sin
from typing import Annotated

from pydantic import Field

LEG, MASS, HIP, GRAVITY = 1.0, 5.0, 10.0, 9.81


def mechanism(incline: Annotated[float, Field(gt=0, lt=20)] = 3.0) -> dict:
    """Return the tables of the walker.

    Args:
        incline: of the ground in degrees.
    """
    a = radians(incline)
    leg = {"parent": "z", "axis": [0.0, -1.0, 0.0], "mass": MASS, "com": [0.0, 0.0, -LEG / 2]}
    return {
        "title": f"Compass gait on {incline:g} degrees",
        "gravity": [GRAVITY * sin(a), 0.0, -GRAVITY * cos(a)],  # x down the incline, z normal to it
        "duration": 5.0,
        "order": {"T": 0.5, "steps": 20},
        "body": [
            {"name": "x", "parent": "world", "joint": "prismatic", "axis": [1.0, 0.0, 0.0], "mass": 0.0},
            {"name": "z", "parent": "x", "joint": "prismatic", "axis": [0.0, 0.0, 1.0], "mass": HIP},
            {"name": "stance", **leg},
            {"name": "swing", **leg},
        ],
        "frame": [
            {"name": "stance_foot", "parent": "stance", "xyz": [0.0, 0.0, -LEG]},
            {"name": "swing_foot", "parent": "swing", "xyz": [0.0, 0.0, -LEG]},
        ],
        "closure": [{"name": "ground", "kind": "point", "frames": ["world", "stance_foot"]}],
        "event": [
            {
                "name": "heel strike",
                "signal": "position.swing_foot.z < 0",
                "when": "position.swing_foot.x > 0.01",  # the foot passes through the ground beside the other one
                "state": {
                    "q.stance": "q.swing", "q.swing": "q.stance", "v.stance": "v.swing", "v.swing": "v.stance",
                },
            }
        ],
        "start": {
            "q": {"stance": 0.271, "swing": -0.271},
            "v": {"stance": -1.092, "swing": -0.377},
            "guess": {"x": -0.27, "z": 0.96},
        },
    }  # fmt: skip
