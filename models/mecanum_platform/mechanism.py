"""A platform on four mecanum wheels, whose rollers are at 45 degrees: it drives ahead, sideways, and turns."""

from math import pi

RADIUS, LENGTH, WIDTH = 0.05, 0.2, 0.15  # m; the wheels are at (+-LENGTH, +-WIDTH)
WHEELS = {"front_left": (1, 1), "front_right": (1, -1), "rear_left": (-1, 1), "rear_right": (-1, -1)}


def mechanism(ahead: float = 0.3, left: float = 0.2, turn: float = 0.4) -> dict:
    """Return the tables for a platform that is driven at velocities in m/s and rad/s, in its axes.

    No slip along a roller at an angle c to the wheel's heading: 0 = (v_x - w y - r w_i) cos c + (v_y + w x) sin c.
    """
    bodies, closures, speeds = [], [], {}
    for name, (i, j) in WHEELS.items():
        x, y, c = i * LENGTH, j * WIDTH, -i * j * pi / 4
        bodies.append({
            "name": name, "parent": "platform", "joint": "continuous", "axis": [0.0, 1.0, 0.0], "xyz": [x, y, 0.0],
            "mass": 0.4, "inertia": [2.5e-4, 5e-4, 2.5e-4, 0.0, 0.0, 0.0],
        })  # fmt: skip
        closures.append({
            "name": f"{name} wheel", "kind": "rolling", "frames": ["world", name], "radius": RADIUS,
            "axis": [0.0, 1.0, 0.0], "grip": c, "contact": False,
        })  # fmt: skip
        speeds[name] = (ahead - turn * y - i * j * (left + turn * x)) / RADIUS
    return {
        "title": "Mecanum platform",
        "duration": 10.0,
        "order": {"T": 1.0, "steps": 20},
        "body": [
            {"name": "platform", "parent": "world", "joint": "planar", "xyz": [0.0, 0.0, RADIUS], "mass": 6.0,
             "inertia": [0.1, 0.1, 0.15, 0.0, 0.0, 0.0]},
            *bodies,
        ],
        "closure": closures,
        "driver": [{"joint": name, "speed": w} for name, w in speeds.items()],
        "start": {"q": {"platform": [0.0, 0.0, 1.0, 0.0]}, "v": {"platform": [ahead, left, turn], **speeds}},
    }  # fmt: skip
