"""Data for a page that moves several coordinates at once: joints, rows, and geometry of joints."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...errors import InputError, NotCompiled
from ...mechanism import Mechanism
from ...mechanism.formulations.core_description import constraints_of
from ...mechanism.scene.drawables import drawables
from ...mechanism.scene.scene import Scene
from ...mechanism.tree.expanded_tree import expand, factor_joints
from ...mechanism.tree.frames import find_joint
from ...mechanism.tree.joints import joint_transform, subspace
from ...mechanism.tree.tree_terms import flexible_bodies
from ...system import Array
from ..replay.threejs import node_path, typed_array
from .sliders import Slider, limits_of, value_of

ROWS = ("dot_product_1", "dot_product_2", "distance", "coordinate", "sum")  # kinds that the page supports


def linkage(mech: Mechanism, scene: Scene, q: Array, sliders: Sequence[Slider]) -> dict[str, Any] | None:
    """Return data of a mechanism at q (nq,) for a page that closes its loops; None if the page does not support it.

    A joint is described by its parent, its placement there, its transform at q and its motion subspace S: after a step
    x of its coordinates, its transform is that at q times exp(S x). Joints with configuration-dependent axes are
    expanded, so that S is constant.
    """
    undriven = Mechanism(mech.model, mech.closures, mech.forces, start=mech.start_values, title=mech.title)
    try:
        tree = expand(mech.model)
        pairs, rows, _ = constraints_of(undriven.system().constraints)
    except (InputError, NotCompiled):
        return None
    if flexible_bodies(mech.model) or undriven.switches or any(row.get("kind") not in ROWS for row in rows):
        return None
    last = np.cumsum([0, *(len(factor_joints(joint)) for joint in list(mech.model.joints)[1:])]).tolist()
    return {
        "joints": _joints(tree, q),
        "values": _values(mech, q).tolist(),
        "pairs": [[{"joint": last[a["joint"]], "turn": a["R"], "at": a["p"]} for a in pair] for pair in pairs],
        "rows": rows,
        "prescribed": [find_joint(mech.model, s.joint).idx_v for s in sliders],
        "curves": [typed_array(np.array([mech.manifold.difference(q, x) for x in s.q]), "float32") for s in sliders],
        "limits": _limits(mech),
        "parts": _attachments(scene, last),
    }


def _joints(tree: Any, q: Array) -> list[dict[str, Any]]:
    """Return parent, placement, transform at q (nq,) and motion subspace of each joint."""
    joints = list(zip(tree.parents, tree.jointPlacements, tree.joints, strict=True))[1:]
    return [
        {
            "parent": int(parent),
            "place": _matrix(place),
            "pose": _matrix(joint_transform(joint, q[joint.idx_q : joint.idx_q + joint.nq])),
            "axes": subspace(joint).T.tolist(),
            "at": joint.idx_v,
        }
        for parent, place, joint in joints
    ]


def _values(mech: Mechanism, q: Array) -> Array:
    """Return the coordinates (nv,) of joints with one coordinate; zero for other joints."""
    out = np.zeros(mech.nv)
    for joint in list(mech.model.joints)[1:]:
        if joint.nv == 1:
            out[joint.idx_v] = value_of(q, joint)
    return out


def _limits(mech: Mechanism) -> list[dict[str, Any]]:
    """Return the ranges of joints that have limits."""
    found = {name: limits_of(mech, name) for name in mech.joint_names}
    return [
        {"joint": name, "at": find_joint(mech.model, name).idx_v, "low": float(pair[0]), "high": float(pair[1])}
        for name, pair in found.items()
        if pair is not None
    ]


def _attachments(scene: Scene, last: Sequence[int]) -> list[dict[str, Any]]:
    """Return the drawables on one joint or between two: joints, placements, and lengths with which they are drawn."""
    shapes = zip(scene.shapes, scene.anchors, strict=True)
    attached = [(anchors, shape.size[1] if len(anchors) == 2 else 0.0) for shape, anchors in shapes]
    for s in scene.springs:
        attached += [((s.first, s.second), s.length)] * (s.coil + 2 * s.tube)
    return [
        {
            "path": node_path(part.name),
            "on": [{"joint": last[joint], "place": _matrix(place)} for joint, place in anchors],
            "kind": part.name.rpartition(" ")[2] if part.name.startswith("spring/") else "link",
            "length": length,
        }
        for part, (anchors, length) in zip(drawables(scene), attached, strict=True)
        if len(anchors) == 2 or anchors[0][0]
    ]


def _matrix(place: Any) -> list[float]:
    """Return sixteen numbers, column by column, as in three.js."""
    return place.homogeneous.T.ravel().tolist()
