"""One closure of each kind: violated in a tree of joints, and satisfied between a body and the world, with the motions
that it permits.

All tests also cover a new kind as soon as it is in `KINDS`.
"""

from math import cos, pi, sin
from pathlib import Path
from typing import NamedTuple

import pinocchio as pin

import mbdae
from mbdae import Closure, Mechanism

A, B = (0.3, -0.5, 0.8), (-0.4, 0.7, 0.2)
TIP = ("tip_8", "tip_2")
X, Y, Z = pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ
TURN_X, TURN_Y, TURN_Z, BALL = pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ, pin.JointModelSpherical
OVAL = {"kind": "fourier", "x": (0.1, 0.5, 0.0, 0.02, 0.01), "y": (-0.2, 0.1, 0.4, 0.0, 0.03)}
ROUND = [
    (0.5 * cos(s) + 1.5, 0.4 * sin(s) + 0.02 * cos(2 * s) + 1.2)
    for s in (0.0, 0.5, 1.1, 1.8, 2.4, 3.0, 3.7, 4.4, 5.0, 5.6)
]
LAW = [(x, 0.2 * sin(x)) for x in (0.0, 0.7, 1.3, 2.4, 3.2, 3.9, 4.8, 5.6)] + [(2 * pi, 0.0)]
INCREASING = [(x, y + x / 2) for x, y in LAW[:-1]] + [(2 * pi, LAW[0][1] + pi)]


class Kind(NamedTuple):
    """A closure between frames of `test_closure_kinds.mechanism`, and joints that permit the same motions.

    ``free`` lists those of `test_closure_kinds.MOTIONS`; ``keys`` are keys of the closure between body and world.
    """

    closure: Closure
    joints: tuple[type, ...] = ()
    free: str | None = None
    keys: str = ""


KINDS = {
    "point": Kind(Closure.point("tip_2", "tip_5"), (BALL,), "turn z, turn x"),
    "revolute": Kind(Closure.revolute("tip_2", "tip_6", A, second_axis=B), (TURN_Z,), "turn z"),
    "frame": Kind(Closure.frame("tip_8", "tip_5"), (), ""),
    "prismatic": Kind(Closure.prismatic("tip_1", "tip_4", A), (Z,), "slide z"),
    "cylindrical": Kind(Closure.cylindrical("tip_5", "tip_8", A, second_axis=B), (Z, TURN_Z), "turn z, slide z"),
    "universal": Kind(Closure.universal("tip_2", "tip_7", A, B), (TURN_Z, TURN_X), "turn z, turn x"),
    "in_plane": Kind(Closure.in_plane("ground", "tip_6", A), (X, Y, BALL), "turn z, turn x, slide x"),
    "in_line": Kind(Closure.in_line("tip_5", "world", A), (Z, BALL), "turn z, turn x, slide z"),
    "parallel": Kind(Closure.parallel(*TIP, A, second_axis=B), (X, Y, Z, TURN_Z), "turn z, slide z, slide x"),
    "distance": Kind(Closure.distance("tip_2", "tip_4", 0.4), (TURN_Z, TURN_Y, BALL), None, "length = 0.5"),
    "coupling": Kind(Closure.coupling("revolute_0", "prismatic_2", (0.1, -1.5, 0.7, 0.3))),
    "cam": Kind(Closure.cam("tip_8", "tip_2", OVAL, radius=0.2)),
    "slot": Kind(Closure.slot("tip_2", "tip_5", OVAL)),
    "rolling": Kind(Closure.rolling("tip_8", "tip_2", 0.3, A, tyre=0.1)),
    "knife_edge": Kind(Closure.knife_edge("tip_8", "tip_2", A)),
    "gear": Kind(Closure.gear("tip_8", "tip_2", (0.2, 0.3), A)),
    "bevel": Kind(Closure.bevel("tip_8", "tip_2", (0.2, 0.3), B, A)),
    "screw": Kind(Closure.screw("tip_8", "tip_2", 0.3, A)),
    "ratio": Kind(Closure.ratio("revolute_0", "helical_7", (0.1, -1.5, 0.7, 0.3), "prismatic_2")),
}
HIGHER = {  # further profiles and laws
    "flat face": Closure.cam("tip_8", "tip_2", OVAL, axis=B),
    "circle": Closure.cam("tip_5", "tip_1", {"kind": "circle", "radius": 0.3, "centre": (0.1, 0.2)}, radius=0.1),
    "through points": Closure.cam("tip_2", "tip_5", {"kind": "points", "points": ROUND}, radius=0.1),
    "flat on points": Closure.cam("tip_2", "tip_5", {"kind": "points", "points": ROUND}, axis=A),
    "law": Closure.law("revolute_0", "helical_7", {"kind": "table", "points": LAW, "periodic": True}),
    "open law": Closure.law("revolute_0", "prismatic_2", {"kind": "table", "points": LAW}),
    "indexing": Closure.law("continuous_5", "helical_7", {"kind": "table", "points": INCREASING, "periodic": True}),
    "eccentric": Closure.law("revolute_0", "continuous_5", {"kind": "harmonic", "amplitude": 0.3, "omega": 2.0}),
    "sum": Closure.coupling("revolute_0", ("helical_7", "prismatic_2"), (0.1, -1.5, 0.7)),
}
ROLLING = {  # further variants of a rolling closure, and constraints at velocity level only
    "disc": Closure.rolling("tip_2", "tip_5", 0.3, A),
    "sphere": Closure.rolling("ground", "tip_6", 0.3),
    "ball on an axle": Closure.rolling("tip_8", "tip_2", 0.3, A, tyre=0.3, grip="lateral"),
    "ellipsoid": Closure(
        kind="rolling", frames=("tip_5", "tip_2"), semi_axes=(0.3, 0.2, 0.4), centre=(0.1, -0.05, 0.02)
    ),
    "roller": Closure.rolling("tip_8", "tip_2", 0.3, A, grip=0.7, contact=False),
    "on a sphere": Closure.rolling("tip_8", "tip_2", 0.3, surface="sphere", surface_radius=0.5),
    "in a sphere": Closure.rolling("tip_8", "tip_2", 0.3, surface="sphere", surface_radius=-0.5),
    "on a cylinder": Closure.rolling("tip_8", "tip_2", 0.3, surface="cylinder", surface_radius=0.5),
    "in a cylinder": Closure.rolling("tip_1", "tip_4", 0.3, surface="cylinder", surface_radius=-0.5),
    "fixed ratio": Closure.ratio("revolute_0", "helical_7", (0.1,)),
}
BODY = """
[[body]]
name = "body"
parent = "world"
joint = "free"
mass = 2.0
com = [0.1, -0.05, 0.02]
inertia = [0.02, 0.05, 0.04, 0.002, 0.0, -0.003]
[[frame]]
name = "socket"
parent = "world"
xyz = [0.1, -0.2, 0.3]
rpy = [0.4, -0.3, 0.5]
[[frame]]
name = "plug"
parent = "body"
xyz = [0.2, 0.1, -0.1]
rpy = [0.1, 0.2, -0.1]
[start]
guess = { body = [-0.1, 0.1, 0.35, 0.25, -0.15, 0.2, 0.9] }
guess_v = { body = [0.5, -0.3, 0.4, 1.0, -0.7, 0.6] }
[[closure]]
name = "joint"
frames = ["socket", "plug"]
"""


def body_and_closure(kind: str, folder: Path) -> Mechanism:
    """Return a body whose frame "plug" is joined to the world's "socket", from a file written into a folder."""
    path = folder / f"{kind}.toml"
    path.write_text(f"{BODY}kind = {kind!r}\n{KINDS[kind].keys}\n")
    return mbdae.load(path)
