"""An eccentric disc lifts a follower, with a roller, with a flat face, or by a motion law."""

from math import pi, sqrt
from typing import Literal

DISC, ROLLER, OFFSET, RATE = 0.04, 0.01, 0.01, 20.0  # m, m, m, rad/s


def mechanism(follower: Literal["roller", "flat", "law"] = "roller") -> dict:
    """Return the tables; all three are driven at 20 rad/s."""
    profile = {"kind": "circle", "radius": DISC, "centre": [OFFSET, 0.0]}
    closure = {"name": "cam contact", "kind": "cam", "frames": ["cam", "follower"], "profile": profile}
    height = DISC
    if follower == "roller":
        closure["radius"], height = ROLLER, sqrt((DISC + ROLLER) ** 2 - OFFSET**2)
    elif follower == "flat":
        closure["axis"] = [0.0, 0.0, 1.0]
    else:
        law = {"kind": "harmonic", "amplitude": OFFSET, "omega": 1.0, "offset": DISC}
        closure = {"name": "cam contact", "kind": "coupling", "joints": ["follower", "cam"], "curve": law}
    return {
        "title": f"Cam and follower, {follower}",
        "duration": 2.0,
        "order": {"T": 0.3, "steps": 20},
        "body": [
            {"name": "cam", "parent": "world", "joint": "continuous", "rpy": [pi / 2, 0.0, 0.0], "mass": 0.3,
             "com": [OFFSET, 0.0, 0.0], "inertia": [1.2e-4, 1.2e-4, 2.4e-4, 0.0, 0.0, 0.0]},
            {"name": "follower", "parent": "world", "joint": "prismatic", "axis": [0.0, 0.0, 1.0], "mass": 0.2},
        ],
        "closure": [closure],
        "driver": [{"joint": "cam", "motion": {"kind": "polynomial", "coefficients": [0.0, RATE]}}],
        "start": {"q": {"cam": 0.0}, "v": {"cam": RATE}, "guess": {"follower": height}},
    }  # fmt: skip
