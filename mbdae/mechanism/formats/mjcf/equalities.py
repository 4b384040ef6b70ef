"""Equalities of an MJCF file as closures and drivers: connect, weld and joint; other kinds are reported."""

from math import comb
from typing import TYPE_CHECKING

from ...closures.closure import Closure
from ...closures.driver import Driver
from ...time_functions.time_functions import Constant

if TYPE_CHECKING:
    from .compiled_model import MjcfModel


def closures_of(c: "MjcfModel") -> tuple[list[Closure], list[Driver], list[str]]:
    """Return closures and drivers of the active equalities, and names and reasons of the unsupported equalities.

    A joint that is fixed at a value becomes a constant driver.
    """
    m, kinds, off = c.m, c.lib.mjtEq, c.disables("EQUALITY", "CONSTRAINT")
    out: list[Closure] = []
    drivers: list[Driver] = []
    unsupported: list[str] = []
    for i, name in enumerate(c.names("EQUALITY", "equality", range(m.neq), set())):
        kind = kinds(m.eq_type[i])
        if off or not m.eq_active0[i]:
            unsupported.append(f"{name} (not active)")
        elif kind == kinds.mjEQ_JOINT and m.eq_obj2id[i] < 0:
            drivers.append(Driver(name=name, joint=c.joints[m.eq_obj1id[i]], motion=_constant_value(c, i)))
        elif kind == kinds.mjEQ_JOINT:
            out.append(_coupling(c, i, name))
        elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD) and _on_same_joint(c, i):
            unsupported.append(f"{name} (no relative motion of its bodies)")
        elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            out.append(_closure(c, i, name))
        else:
            unsupported.append(f"{name} ({kind.name.removeprefix('mjEQ_').lower()})")
    return out, drivers, unsupported


def _on_same_joint(c: "MjcfModel", i: int) -> bool:
    """Return whether both sides of an equality are fixed to the same joint."""
    sides = int(c.m.eq_obj1id[i]), int(c.m.eq_obj2id[i])
    sites = c.lib.mjtObj(c.m.eq_objtype[i]) == c.lib.mjtObj.mjOBJ_SITE
    one, two = (c.carriers[c.m.site_bodyid[x] if sites else x][0] for x in sides)
    return one == two


def _closure(c: "MjcfModel", i: int, name: str) -> Closure:
    m, data = c.m, c.m.eq_data[i]
    one, two = int(m.eq_obj1id[i]), int(m.eq_obj2id[i])
    weld = c.lib.mjtEq(m.eq_type[i]) == c.lib.mjtEq.mjEQ_WELD
    if c.lib.mjtObj(m.eq_objtype[i]) == c.lib.mjtObj.mjOBJ_SITE:
        frames = (c.sites[one], c.sites[two])
    else:  # MuJoCo stores first the anchor of a weld in body 2, of a connect in body 1
        first_point, second_point = (data[3:6], data[0:3]) if weld else (data[0:3], data[3:6])
        rotation = data[6:10] if weld else None
        first, second = c.unique(f"{name}.1"), c.unique(f"{name}.2")
        frames = (c.add_frame(first, one, first_point, rotation), c.add_frame(second, two, second_point))
    rotations = weld and data[10] != 0  # torquescale 0 leaves the rotation free
    return Closure(kind="frame" if rotations else "point", frames=frames, name=name)


def _constant_value(c: "MjcfModel", i: int) -> Constant:
    return Constant(value=float(c.m.qpos0[c.m.jnt_qposadr[c.m.eq_obj1id[i]]] + c.m.eq_data[i, 0]))


def _coupling(c: "MjcfModel", i: int, name: str) -> Closure:
    """Return q1 - ref1 = polynomial of (q2 - ref2) as a polynomial of q2."""
    m, one, two = c.m, int(c.m.eq_obj1id[i]), int(c.m.eq_obj2id[i])
    poly, ref1, ref2 = m.eq_data[i, :5], *(float(m.qpos0[m.jnt_qposadr[j]]) for j in (one, two))
    powers = [sum(poly[n] * comb(n, k) * (-ref2) ** (n - k) for n in range(k, 5)) for k in range(5)]
    powers[0] += ref1
    while len(powers) > 2 and powers[-1] == 0:
        powers.pop()
    return Closure.coupling(c.joints[one], c.joints[two], tuple(powers), name)
