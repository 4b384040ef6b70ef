"""The spring of a lift: its anchor and stiffness for the same torque on the hatch at all heights.

A hatch hangs on two arms. Without a spring the torque that holds it changes with the angle of the arm; the spring
should leave a small constant torque that closes the hatch. Poses are followed over the angle of the arm, and the
holding torque at rest is differentiated by stiffness, rest length and anchor of the spring.

Run: python examples/lift_assist.py
"""

import numpy as np

import mbdae

HINGE = {"joint": "revolute", "axis": [0.0, -1.0, 0.0]}
SHUT, OPEN = -0.6, 0.9  # rad
HATCH = {
    "title": "Hatch on two arms",
    "body": [
        {"name": "arm", "parent": "world", **HINGE, "mass": 0.8, "com": [0.2, 0.0, 0.0],
         "inertia": [0.0, 0.01, 0.01, 0.0, 0.0, 0.0]},
        {"name": "hatch", "parent": "arm", **HINGE, "xyz": [0.4, 0.0, 0.0], "mass": 6.0, "com": [0.15, 0.0, 0.1],
         "inertia": [0.3, 0.5, 0.3, 0.0, 0.0, 0.0]},
        {"name": "stay", "parent": "world", **HINGE, "xyz": [0.05, 0.0, 0.2], "mass": 0.7, "com": [0.2, 0.0, 0.0],
         "inertia": [0.0, 0.01, 0.01, 0.0, 0.0, 0.0]},
    ],
    "frame": [
        {"name": "hatch_pin", "parent": "hatch", "xyz": [0.02, 0.0, 0.22]},
        {"name": "stay_tip", "parent": "stay", "xyz": [0.38, 0.0, 0.0]},
        {"name": "anchor", "parent": "world", "xyz": [-0.05, 0.0, 0.25]},
        {"name": "eye", "parent": "arm", "xyz": [0.15, 0.0, 0.0]},
    ],
    "closure": [{"name": "pin", "kind": "point", "frames": ["hatch_pin", "stay_tip"]}],
    "force": [
        {"name": "spring", "kind": "spring_damper", "frames": ["anchor", "eye"], "stiffness": 400.0, "length": 0.1},
    ],
    "start": {"q": {"arm": SHUT}, "guess": {"hatch": -SHUT, "stay": SHUT}},
}  # fmt: skip
BOUNDS = {
    "force.spring.stiffness": (50.0, 4000.0),
    "force.spring.length": (0.02, 0.3),
    "frame.anchor.xyz.0": (-0.2, 0.1),
    "frame.anchor.xyz.2": (0.1, 0.4),
}


def main(torque: float = -1.0, points: int = 25) -> dict[str, float]:
    """Print the spring, and the deviation of the holding torque from a constant in N m; return the deviation."""
    cost = mbdae.Squares({"holding": np.full(points, torque)}, sigma=points**0.5)
    hatch, span = mbdae.load(HATCH), (SHUT, OPEN)
    found = mbdae.optimize(hatch, cost, list(BOUNDS), BOUNDS, drive="arm", span=span, points=points, tolerance=1e-6)
    print(found)
    before, after = ((2 * x) ** 0.5 for x in (found.start.cost, found.cost))
    print(f"the torque departs from {torque:g} N m by {before:.3g} N m before, {after:.2g} N m after (RMS)")
    return {"before": before, "after": after}


if __name__ == "__main__":
    main()
