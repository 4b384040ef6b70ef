"""The optimal counterweight of a slider-crank, compared with the closed form.

A crank at constant speed causes shaking forces on its bed. The rod is equivalent to two masses, at the crank pin and at
the wrist pin: rotating masses are balanced by a counterweight, reciprocating ones only partly. Balancing half of the
reciprocating mass minimizes the sum of squares of both components of the force, for any ratio of crank and rod: the
even harmonics due to the rod are out of reach of a mass that rotates with the crank.

Run: python examples/balancing.py
"""

import numpy as np

import mbdae

CRANK, ROD, COM, ARM, SPEED = 0.1, 0.35, 0.12, 0.08, 20.0  # m, m, m from the crank pin, m, rad/s
ROD_MASS, BLOCK_MASS = 0.4, 0.6  # kg
HINGE = {"joint": "revolute", "axis": [0.0, -1.0, 0.0]}
MACHINE = {
    "title": "Slider-crank on its bed",
    "gravity": [0.0, 0.0, 0.0],
    "body": [  # the closure locks the three translations of the bed: its multipliers are the force on the ground
        {"name": "bed", "parent": "world", "joint": "translation", "mass": 5.0},
        {"name": "crank", "parent": "bed", **HINGE, "mass": 1.5, "inertia": [0.006, 0.012, 0.006, 0.0, 0.0, 0.0]},
        {"name": "counterweight", "parent": "crank", "joint": "fixed", "xyz": [-ARM, 0.0, 0.0], "mass": 0.1},
        {"name": "rod", "parent": "crank", **HINGE, "xyz": [CRANK, 0.0, 0.0], "mass": ROD_MASS, "com": [COM, 0.0, 0.0],
         "inertia": [0.0, 0.004, 0.004, 0.0, 0.0, 0.0]},
        {"name": "block", "parent": "bed", "joint": "prismatic", "axis": [1.0, 0.0, 0.0], "mass": BLOCK_MASS},
    ],
    "frame": [{"name": "rod_tip", "parent": "rod", "xyz": [ROD, 0.0, 0.0]}],
    "closure": [
        {"name": "ground", "kind": "point", "frames": ["world", "bed"]},
        {"name": "wrist pin", "kind": "point", "frames": ["rod_tip", "block"]},
    ],
    "driver": [{"name": "motor", "joint": "crank", "motion": {"kind": "polynomial", "coefficients": [0.0, SPEED]}}],
    "start": {"guess": {"block": CRANK + ROD}},
}  # fmt: skip


def shaking(signals) -> tuple[float, dict[str, np.ndarray]]:
    """Half the mean square of the force on the ground in N^2, and its gradient."""
    parts = {name: signals[name] for name in ("lam.ground.1", "lam.ground.3")}
    n = len(signals["t"])
    return sum(f @ f for f in parts.values()) / (2 * n), {name: f / n for name, f in parts.items()}


def main(points: int = 24) -> dict[str, float]:
    """Print the best counterweight and the closed form, and return both."""
    period = 2 * np.pi / SPEED
    times = period * np.arange(points) / points  # equal angles of one revolution
    found = mbdae.optimize(
        mbdae.load(MACHINE),
        shaking,
        ["body.counterweight.mass"],
        bounds={"body.counterweight.mass": (0.0, 5.0)},
        t_span=(0.0, period),
        t_eval=times,
        step=period / (2 * points),
    )
    rotating, reciprocating = ROD_MASS * (1 - COM / ROD), ROD_MASS * COM / ROD + BLOCK_MASS
    closed = (rotating + reciprocating / 2) * CRANK / ARM
    mass = found.values["body.counterweight.mass"]
    print(found)
    print(f"counterweight {mass:.9f} kg, closed form {closed:.9f} kg: all rotating and half of the reciprocating mass")
    before, after = ((2 * x) ** 0.5 for x in (found.start.cost, found.cost))
    print(f"root mean square of the force on the ground {before:.4g} -> {after:.4g} N")
    return {"mass": mass, "closed": closed, "before": before, "after": after}


if __name__ == "__main__":
    main()
