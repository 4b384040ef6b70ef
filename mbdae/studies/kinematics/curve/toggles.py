"""Toggle positions: poses of a curve in which the drive or another joint reverses, located on the curve itself."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ....mechanism import Mechanism
from ....mechanism.tree.frames import find_joint
from ....system import Array
from ....tabular import rounded_zero
from ....tolerances import SAME_POSE, ZERO_SPEED
from ....units import displayed
from .branch_following import TracedCurve
from .pose_curve import CurvePoint


class Toggle(NamedTuple):
    """A pose in which joints reverse.

    Attributes:
        u: the input.
        q: the configuration, (nq,).
        reversing: names of the joints, that of the drive first.
        v: the tangent dq/ds, (nv,), in rad and m.
    """

    u: float
    q: Array
    reversing: tuple[str, ...]
    v: Array


def toggles(traced: TracedCurve, mech: Mechanism, drive: str) -> list[Toggle]:
    """Return the toggle positions of the drive and of joints with one coordinate, in their order along a curve."""
    curve = traced.curve
    found = [(d.point, drive) for d in traced.events.dead_points]
    for name in mech.joint_names:
        joint = find_joint(mech.model, name)
        if joint.nv == 1 and name != drive:
            found += [(point, name) for point in _zeros(traced, int(joint.idx_v))]
    found.sort(key=lambda x: x[0].s)
    groups: list[list[tuple[CurvePoint, str]]] = []
    for point, name in found:
        if groups and point.s - groups[-1][0][0].s < SAME_POSE:
            groups[-1].append((point, name))
        else:
            groups.append([(point, name)])
    return [_toggle(group, drive, curve.scales) for group in groups]


def _toggle(group: list[tuple[CurvePoint, str]], drive: str, scales: Array) -> Toggle:
    names = dict.fromkeys(name for _, name in group)
    point = group[0][0]
    return Toggle(point.u, point.q, tuple(sorted(names, key=lambda n: n != drive)), point.tau * scales)


def _zeros(traced: TracedCurve, i: int) -> list[CurvePoint]:
    """Return the points at which component i of the tangent changes its sign; none if it is zero everywhere."""
    curve, out = traced.curve, []
    values = [p.tau[i] if abs(p.tau[i]) > ZERO_SPEED else 0.0 for p in curve.nodes]
    if not any(values):
        return []
    if not values[0]:
        out.append(curve.nodes[0])
    for k, (a, b) in enumerate(pairwise(values)):
        if a * b < 0:
            out.append(curve.at(k, curve.root(k, lambda p: float(p.tau[i]))))
        elif not b and k + 2 < len(values) and a * values[k + 2] < 0:
            out.append(curve.nodes[k + 1])
    return out


def toggle_table(
    found: Sequence[Toggle], coordinates: Mapping[str, Array], drive: str, unit: str, units: Mapping[str, str]
) -> list[list[str]]:
    """Return a table of toggle positions with the reversing joints, the input and all other coordinates.

    Args:
        found: m toggle positions.
        coordinates: values of each coordinate by name, (m,) each.
        drive: name of the input.
        unit: unit of the input.
        units: units of the coordinates by name.
    """
    shown = {drive: displayed(np.array([t.u for t in found]), unit)}
    shown |= {name.removeprefix("q."): displayed(x, units.get(name, "")) for name, x in coordinates.items()}
    headers = ["reverses", *(f"{name} ({u})" if u not in ("", "1") else name for name, (_, u) in shown.items())]
    values = np.array([x for x, _ in shown.values()]).T if found else np.empty((0, 0))
    rows = [[f"{rounded_zero(x):.9g}" for x in row] for row in values]
    return [headers] + [[", ".join(t.reversing), *row] for t, row in zip(found, rows, strict=True)]
