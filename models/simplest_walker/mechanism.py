"""The simplest walking model: two massless legs, a mass at the hip and small masses at the feet, on an incline."""

from math import cos, sin
from typing import Annotated

from pydantic import Field

FOOT = 1e-12  # of the hip's mass: the published equations are the limit 0, and change by this


def mechanism(incline: Annotated[float, Field(gt=0, lt=0.1)] = 0.009) -> dict:
    """Return the tables of the walker, in units of its leg, its hip's mass and gravity.

    Args:
        incline: of the ground in rad.
    """
    root = incline ** (1 / 3)
    angle, rate = 0.970956 * root - 0.270837 * incline, -1.01472 * root + 1.249 * incline  # of the long gait, to 1e-3
    return {
        "title": "Simplest walker",
        "gravity": [sin(incline), 0.0, -cos(incline)],  # x down the incline, z normal to it
        "duration": 20.0,
        "order": {"T": 3.0, "steps": 20},
        "body": [
            {"name": "stance", "parent": "world", "axis": [0.0, -1.0, 0.0], "mass": 1.0, "com": [0.0, 0.0, 1.0]},
            {
                "name": "swing", "parent": "stance", "axis": [0.0, 1.0, 0.0], "xyz": [0.0, 0.0, 1.0],
                "mass": FOOT, "com": [0.0, 0.0, -1.0],
            },
        ],
        "frame": [{"name": "foot", "parent": "swing", "xyz": [0.0, 0.0, -1.0]}],
        "event": [
            {
                "name": "heel strike",
                "signal": "position.foot.z < 0",
                "when": "position.foot.x > 0.001",  # the foot passes through the ground beside the other one
                "state": {
                    "q.stance": "-q.stance",
                    "q.swing": "-2*q.stance",
                    "v.stance": "cos(2*q.stance)*v.stance",
                    "v.swing": "cos(2*q.stance)*(1 - cos(2*q.stance))*v.stance",
                },
            }
        ],
        "start": {
            "q": {"stance": angle, "swing": 2 * angle},
            "v": {"stance": rate, "swing": rate * (1 - cos(2 * angle))},
        },
    }  # fmt: skip
