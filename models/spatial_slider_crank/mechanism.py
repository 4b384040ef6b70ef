"""A crank that turns across the rail of its slider: one degree of freedom, a rod with spatial motion."""

from math import asin, atan
from typing import Annotated

from pydantic import Field


def mechanism(centre: Annotated[float, Field(ge=0, le=0.08)] = 0.04) -> dict:
    """Return the tables, with the distance of the crank's centre of mass from its axle in m: 0.04 is its middle."""
    return {
        "title": "Spatial slider-crank",
        "gravity": [0.0, 0.0, -9.81],
        "duration": 5.0,
        "order": {"T": 1.0, "steps": 40},
        "body": [
            {
                "name": "crank",
                "parent": "world",
                "joint": "revolute",
                "axis": [1.0, 0.0, 0.0],
                "xyz": [0.0, 0.1, 0.12],
                "mass": 0.12,
                "com": [0.0, 0.0, centre],
                "inertia": [1e-4, 1e-5, 1e-4, 0.0, 0.0, 0.0],
            },
            {"name": "slider", "parent": "world", "joint": "prismatic", "axis": [1.0, 0.0, 0.0], "mass": 2.0},
            {
                "name": "rod",
                "parent": "slider",
                "joint": "universal",
                "mass": 0.5,
                "com": [0.0, 0.0, 0.15],
                "inertia": [4e-3, 4e-3, 4e-4, 0.0, 0.0, 0.0],
            },
        ],
        "frame": [
            {"name": "crank_pin", "parent": "crank", "xyz": [0.0, 0.0, 0.08]},
            {"name": "rod_end", "parent": "rod", "xyz": [0.0, 0.0, 0.3]},
        ],
        "closure": [{"name": "ball joint", "kind": "point", "frames": ["rod_end", "crank_pin"]}],
        "start": {
            "q": {"crank": 0.0},
            "v": {"crank": 6.0},
            "guess": {"slider": 0.2, "rod": [-atan(0.5), -asin(2 / 3)]},
        },
    }
