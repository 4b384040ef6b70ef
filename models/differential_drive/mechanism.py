"""A robot on two driven wheels pulls a trailer."""

TRACK, RADIUS, HITCH, LENGTH = 0.4, 0.1, 0.2, 1.5  # m; the distance of the trailer's axle behind the hitch


def wheel(name: str, y: float) -> dict:
    """A wheel on the axle of the robot."""
    return {
        "name": name, "parent": "robot", "joint": "continuous", "axis": [0.0, 1.0, 0.0], "xyz": [0.0, y, 0.0],
        "mass": 0.5, "inertia": [1.25e-3, 2.5e-3, 1.25e-3, 0.0, 0.0, 0.0],
    }  # fmt: skip


def mechanism(left: float = 6.0, right: float = 9.0, angle: float = 0.0) -> dict:
    """Return the tables, for wheel speeds in rad/s and an initial hitch angle in rad."""
    speeds = {"left_wheel": left, "right_wheel": right}
    return {
        "title": "Differential drive with trailer",
        "duration": 10.0,
        "order": {"T": 1.0, "steps": 20},
        "body": [
            {"name": "robot", "parent": "world", "joint": "planar", "xyz": [0.0, 0.0, RADIUS], "mass": 8.0,
             "com": [0.05, 0.0, 0.0], "inertia": [0.1, 0.2, 0.25, 0.0, 0.0, 0.0]},
            wheel("left_wheel", TRACK / 2),
            wheel("right_wheel", -TRACK / 2),
            {"name": "trailer", "parent": "robot", "joint": "revolute", "xyz": [-HITCH, 0.0, 0.0], "mass": 5.0,
             "com": [-1.2, 0.0, 0.0], "inertia": [0.1, 0.5, 0.6, 0.0, 0.0, 0.0]},
        ],
        "frame": [{"name": "trailer_axle", "parent": "trailer", "xyz": [-LENGTH, 0.0, 0.0]}],
        "closure": [
            *({"name": name, "kind": "rolling", "frames": ["world", name], "radius": RADIUS, "axis": [0.0, 1.0, 0.0],
               "contact": False} for name in speeds),
            {"name": "trailer wheels", "kind": "knife_edge", "frames": ["world", "trailer_axle"],
             "axis": [0.0, 1.0, 0.0]},
        ],
        "driver": [{"joint": name, "speed": w} for name, w in speeds.items()],
        "start": {
            "q": {"robot": [0.0, 0.0, 1.0, 0.0], "trailer": angle},
            "v": speeds,
        },
    }  # fmt: skip
