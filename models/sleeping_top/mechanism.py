"""A symmetric top that stands upright on its tip and spins about the vertical."""

from math import sqrt
from typing import Annotated

from pydantic import Field

Spin = Annotated[float, Field(ge=-1000, le=1000)]


def mechanism(spin: Spin = 150.0) -> dict:
    """Return the tables of the top of `heavy_top`, upright with ``spin`` rad/s about its axis."""
    upright = [0.0, 0.0, 1.0, sqrt(0.5), 0.0, 0.0, sqrt(0.5)]
    return {
        "title": f"Sleeping top at {spin:g} rad/s",
        "gravity": [0.0, 0.0, -9.81],
        "duration": 2.0,
        "order": {"T": 0.5, "steps": 10},
        "body": [
            {
                "name": "top",
                "parent": "world",
                "joint": "free",
                "mass": 15.0,
                "inertia": [0.234375, 0.46875, 0.234375, 0.0, 0.0, 0.0],
            }
        ],
        "frame": [{"name": "tip", "parent": "top", "xyz": [0.0, -1.0, 0.0]}],
        "closure": [{"name": "socket", "kind": "point", "frames": ["world", "tip"]}],
        "start": {"q": {"top": upright}, "v": {"top": [0.0, 0.0, 0.0, 0.0, spin, 0.0]}},
    }
