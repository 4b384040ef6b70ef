"""Features of an MJCF file that are not supported."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from ...imported_model import FRICTION, LIMITS, name_list
from .compiled_model import FRICTION_FLAGS, LIMIT_FLAGS, MjcfModel


def unsupported_features(
    c: MjcfModel, equalities: Iterable[str], actuators: Iterable[str], limited: Iterable[str], shapes: Iterable[str]
) -> list[str]:
    """Return all unsupported features that affect motion or appearance, with the names of their elements."""
    found: list[tuple[str, Iterable[str]]] = [
        ("contact between geoms", [""] if _may_collide(c) else []),
        *_joint_features(c),
        ("equalities", equalities),
        ("actuators other than motors, positions or velocities of a hinge or slide", actuators),
        ("limits and delays of motors", limited),
        ("nonlinear damping of actuators", (c.actuators[i] for i in _rows(c.m, "actuator_dampingpoly"))),
        *_other_objects(c),
        ("sleep of bodies", _sleeping_bodies(c)),
        ("forces of a fluid", [""] if c.m.opt.density or c.m.opt.viscosity else []),
        ("shapes", shapes),
    ]
    return [name_list(what, names) for what, values in found if (names := list(values))]


def _joint_features(c: MjcfModel) -> list[tuple[str, list[str]]]:
    m = c.m
    return [
        (LIMITS, [] if c.disables(*LIMIT_FLAGS) else [c.joints[j] for j in np.flatnonzero(m.jnt_limited)]),
        (FRICTION, [] if c.disables(*FRICTION_FLAGS) else _joints(c, m.dof_frictionloss)),
        ("nonlinear stiffness of joints", [c.joints[j] for j in _rows(m, "jnt_stiffnesspoly")]),
        ("plastic stiffness of joints", [c.joints[j] for j in _rows(m, "jnt_springyield")]),
        ("nonlinear damping of joints", _joints(c, _array(m, "dof_dampingpoly", m.nv))),
    ]


def _other_objects(c: MjcfModel) -> list[tuple[str, list[str]]]:
    """Return unsupported objects by kind; objects without a name are denoted by a word and their number."""
    m = c.m
    found: list[tuple[str, str, str, Iterable[int]]] = [
        ("tendons", "TENDON", "tendon", range(m.ntendon)),
        ("gravity compensation of bodies", "BODY", "body", _rows(m, "body_gravcomp")),
        ("motion of mocap bodies", "BODY", "body", np.flatnonzero(m.body_mocapid >= 0).tolist()),
        ("flexes", "FLEX", "flex", range(m.nflex)),
        ("skins", "SKIN", "skin", range(m.nskin)),
        ("plugins", "PLUGIN", "plugin", range(m.nplugin)),
        ("adhesion of geoms", "GEOM", "geom", _rows(m, "geom_adhesion")),
        ("adhesion of pairs of geoms", "PAIR", "pair", _rows(m, "pair_adhesion")),
    ]
    return [(what, [c.name(kind, i) or f"{word}{i}" for i in numbers]) for what, kind, word, numbers in found]


def _array(m: Any, name: str, rows: int) -> np.ndarray:
    """Return an array of the compiled model, empty if this version of MuJoCo does not have it."""
    return np.array(getattr(m, name, np.zeros((rows, 1))))


def _rows(m: Any, name: str) -> list[int]:
    values = np.array(getattr(m, name, []))
    return [int(i) for i in np.flatnonzero(values.reshape(len(values), -1).any(axis=1))] if len(values) else []


def _joints(c: MjcfModel, per_dof: np.ndarray) -> list[str]:
    dofs = np.flatnonzero(per_dof.reshape(c.m.nv, -1).any(axis=1)).tolist() if c.m.nv else []
    return list(dict.fromkeys(c.joints[c.m.dof_jntid[d]] for d in dofs))


def _sleeping_bodies(c: MjcfModel) -> list[str]:
    """Return the bodies whose trees have a sleep setting, or an empty name if the file only enables sleeping."""
    m, policies = c.m, getattr(c.lib, "mjtSleepPolicy", None)
    if policies is None:
        return []
    trees = np.flatnonzero(m.tree_sleep_policy > int(policies.mjSLEEP_AUTO_ALLOWED))
    bodies = [int(np.flatnonzero(m.body_treeid == tree)[0]) for tree in trees]
    on = m.opt.enableflags & c.lib.mjtEnableBit.mjENBL_SLEEP
    return [c.name("BODY", b) or f"body{b}" for b in bodies] or ([""] if on else [])


def _may_collide(c: MjcfModel) -> bool:
    """Return whether two geoms on bodies in relative motion may collide, according to their bit masks."""
    m = c.m
    if c.disables("CONTACT", "CONSTRAINT"):
        return False
    masks = zip(m.geom_contype, m.geom_conaffinity, m.body_weldid[m.geom_bodyid], strict=True)
    groups = {(int(t), int(a), int(body)) for t, a, body in masks}
    return bool(m.npair) or any(x[2] != y[2] and (x[0] & y[1] or y[0] & x[1]) for x in groups for y in groups)
