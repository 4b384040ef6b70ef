"""A custom mechanism: a tree from tables in Python, its loop closed by a closure, with forces in Python.

A parallelogram lifts a platform: two equal arms on the ground carry a bar, which stays level. The bodies are a tree, so
the bar is attached to the left arm, and a closure pins it to the right one. A spring carries the weight.

Run: python examples/custom_mechanism.py
"""

from typing import Any

import numpy as np

import mbdae


def bar(name: str, parent: str, x: float, length: float, mass: float) -> dict[str, Any]:
    """A uniform bar along its x axis that is hinged at x of its parent, in m and kg."""
    hinge = {"joint": "revolute", "axis": [0, -1, 0], "xyz": [x, 0, 0]}
    inertia = mass * length**2 / 12 * np.array([0, 1, 1, 0, 0, 0])
    mass_properties = {"mass": mass, "com": [length / 2, 0, 0], "inertia": inertia.tolist()}
    return {"name": name, "parent": parent, **hinge, **mass_properties}


LIFT = {  # two arms of 0.4 m on the ground, 0.6 m apart, and a bar of 0.6 m on the left one
    "title": "Parallelogram lift",
    "gravity": [0.0, 0.0, -9.81],
    "body": [
        bar("left", "world", 0.0, 0.4, 1.0),
        bar("right", "world", 0.6, 0.4, 1.0),
        bar("platform", "left", 0.4, 0.6, 3.0),
    ],
    "frame": [
        {"name": "platform_end", "parent": "platform", "xyz": [0.6, 0.0, 0.0]},
        {"name": "right_end", "parent": "right", "xyz": [0.4, 0.0, 0.0]},
    ],
    "closure": [
        {"name": "right hinge", "kind": "revolute", "frames": ["platform_end", "right_end"], "axis": [0, 1, 0]},
    ],
}


def main(end: float = 2.0) -> mbdae.Solution:
    """Run the lift, print the tilt of the platform, and return the solution."""
    mech = mbdae.load(
        LIFT,
        forces=[
            mbdae.JointSpring(joint="left", stiffness=60.0, rest=0.5, damping=2.0, name="spring"),
            lambda t, q, v: np.array([4.0 * np.sin(5 * t), 0.0, 0.0]),  # N m on the left arm
        ],
    )
    q, v = mech.assemble(q={"left": 0.5}, guess={"right": 0.5, "platform": -0.5})
    sol = mbdae.solve(mech, (0, end), q, v, rtol=1e-8)
    print(mbdae.drift(sol))
    angle = {name: sol.signals()[f"q.{name}"] for name in ("left", "platform")}
    print(f"the platform tilts by at most {np.abs(angle['left'] + angle['platform']).max():.1e} rad")
    return sol


if __name__ == "__main__":
    main()
