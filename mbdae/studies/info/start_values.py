"""Coordinates and velocities of a point by joint."""

import numpy as np

from ...mechanism.formulations.index2 import Index2System
from ...solution.signal_value import signal_values, value
from ...system import Array


def by_joint(system: Index2System, t: float, y: Array) -> tuple[dict[str, float], dict[str, float]]:
    """Return coordinates and velocities by joint; an angle in place of (cos, sin)."""
    known = signal_values(system.mechanism)
    found = {name: value(system, known[name], t, y) for name in known if name.startswith(("q.", "v."))}
    for name in [name for name in found if name.endswith(".cos")]:
        joint = name.removesuffix(".cos")
        angle = float(np.arctan2(found.pop(f"{joint}.sin"), found[name]))
        found = {(f"{joint}.angle" if n == name else n): (angle if n == name else x) for n, x in found.items()}
    q, v = ({name[2:]: x for name, x in found.items() if name.startswith(kind)} for kind in ("q.", "v."))
    return q, v
