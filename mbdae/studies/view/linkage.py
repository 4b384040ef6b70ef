"""What a page needs to move several coordinates at once: joints, rows and what hangs on joints, as plain numbers."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...errors import InputError, NotCompiled
from ...mechanism import Mechanism
from ...mechanism.expanded_tree import expand, factor_joints
from ...mechanism.formulations.core_description import constraints_of
from ...mechanism.frames import find_joint
from ...mechanism.joints import joint_transform, subspace
from ...mechanism.scene.scene import Anchor, Scene
from ...system import Array
from ..replay.threejs import node, typed
from .sliders import Slider, limits_of, value_of

ROWS = ("dot_product_1", "dot_product_2", "distance", "coordinate", "sum")  # that the page knows


def linkage(mech: Mechanism, q: Array, sliders: Sequence[Slider]) -> dict[str, Any] | None:
    """A mechanism at q (nq,) for a page that closes its loops; None where it has rows or joints that pages lack.

    A joint is told by its parent, its place there, its own transform at q and its motion subspace S: after a step x of
    its coordinates it stands at transform exp(S x). Joints whose axes move within them are chains, so that S is steady.
    """
    free = Mechanism(mech.model, mech.closures, mech.forces, start=mech.start_values, title=mech.title)
    try:
        tree = expand(mech.model)
        pairs, rows, _ = constraints_of(free.system().constraints)
    except (InputError, NotCompiled):
        return None
    if free.switches or any(row.get("kind") not in ROWS for row in rows):
        return None
    last = np.cumsum([0, *(len(factor_joints(joint)) for joint in list(mech.model.joints)[1:])]).tolist()
    values = np.zeros(mech.nv)  # of joints with one coordinate
    for joint in list(mech.model.joints)[1:]:
        if joint.nv == 1:
            values[joint.idx_v] = value_of(q, joint)
    return {
        "joints": [
            {
                "parent": int(parent),
                "place": _matrix(place),
                "pose": _matrix(joint_transform(joint, q[joint.idx_q : joint.idx_q + joint.nq])),
                "axes": subspace(joint).T.tolist(),
                "at": joint.idx_v,
            }
            for parent, place, joint in list(zip(tree.parents, tree.jointPlacements, tree.joints, strict=True))[1:]
        ],
        "values": values.tolist(),
        "pairs": [[{"joint": last[j], "turn": R, "at": p} for j, R, p in pair] for pair in pairs],
        "rows": rows,
        "held": [find_joint(mech.model, s.joint).idx_v for s in sliders],
        "curves": [typed(np.array([mech.manifold.difference(q, x) for x in s.q]), "float32") for s in sliders],
        "limits": [
            {"joint": name, "at": find_joint(mech.model, name).idx_v, "low": float(low), "high": float(high)}
            for name in mech.joint_names
            if (found := limits_of(mech, name)) is not None
            for low, high in [found]
        ],
        **_hung(mech.scene, last),
    }


def _hung(scene: Scene, last: Sequence[int]) -> dict[str, Any]:
    """Shapes that are fixed to joints or lead from one to another, and springs: joints and places there."""

    def hung(anchors: Sequence[Anchor]) -> list[dict[str, Any]]:
        return [{"joint": last[joint], "place": _matrix(place)} for joint, place in anchors]

    both = [(s, on) for s, on in zip(scene.shapes, scene.anchors, strict=True) if len(on) == 2 or on[0][0]]
    return {
        "shapes": [{"path": node(s), "on": hung(on), "length": s.size[1] if len(on) == 2 else 0.0} for s, on in both],
        "springs": [{"name": s.name, "on": hung([s.first, s.second])} for s in scene.springs],
    }


def _matrix(place: Any) -> list[float]:
    """Sixteen numbers, column by column, as the page's library takes them."""
    return place.homogeneous.T.ravel().tolist()
