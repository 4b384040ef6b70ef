"""N four-bars in a row, each the parallelogram of two cranks, a coupler and the ground."""

from math import pi
from typing import Annotated

from pydantic import Field

BAR = {"mass": 1.0, "com": [0.5, 0.0, 0.0], "inertia": [2e-4, 1 / 12, 1 / 12, 0.0, 0.0, 0.0]}
HINGE = {"joint": "revolute", "axis": [0.0, -1.0, 0.0]}


def mechanism(N: Annotated[int, Field(ge=1, le=1000)] = 2) -> dict:
    """Return the tables of N four-bars with bars of 1 m and 1 kg."""
    cranks = [{"name": f"crank_{i}", "parent": "world", "xyz": [float(i), 0.0, 0.0]} for i in range(N + 1)]
    couplers = [{"name": f"coupler_{i}", "parent": f"crank_{i - 1}", "xyz": [1.0, 0.0, 0.0]} for i in range(1, N + 1)]
    tips = [f"crank_{i}" for i in range(1, N + 1)] + [f"coupler_{i}" for i in range(1, N + 1)]
    others = {f"crank_{i}": pi / 2 for i in range(1, N + 1)} | {f"coupler_{i}": -pi / 2 for i in range(1, N + 1)}
    return {
        "title": f"Row of four-bars, N = {N}",
        "gravity": [0.0, 0.0, -9.81],
        "duration": 10.0,
        "order": {"T": 0.6, "steps": 10},
        "body": [{**bar, **HINGE, **BAR} for bar in (*cranks, *couplers)],
        "frame": [{"name": f"{bar}_tip", "parent": bar, "xyz": [1.0, 0.0, 0.0]} for bar in tips],
        "closure": [
            {"name": f"pin_{i}", "kind": "point", "frames": [f"coupler_{i}_tip", f"crank_{i}_tip"]}
            for i in range(1, N + 1)
        ],
        "start": {"q": {"crank_0": pi / 2}, "v": {"crank_0": -1.0}, "guess": others},
    }
