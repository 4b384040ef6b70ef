"""What a replay marks of a run with modes: what is stuck or closed, while it is, and impacts."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ...mechanism.contacts import path, rolling
from ...mechanism.frames import paths
from ...system import Array
from .threejs import typed

if TYPE_CHECKING:
    from ...mechanism import Mechanism
    from ...mechanism.modes.switch import Switch
    from ...solution.solution import Solution

HELD, STRUCK = "#6741d9", "#f59f00"


def switched(sol: "Solution", q: Array) -> list[dict[str, Any]]:
    """What held or was struck in a run.

    Args:
        sol: the run.
        q: its configurations at the frames of the page, (m, nq).

    Returns:
        For each switch its name, the word for what it is while it holds, where it is at each frame in m, times in s
        from which and to which it holds, one after the other, times of impacts, and their strengths: the square root
        of the impulse, that of its largest one being 1.
    """
    out = []
    for switch in sol.mechanism.switches:
        held = _held(sol, switch)
        struck = [(x.t, x.impulse[x.where.index(switch.name)]) for x in sol.impacts if switch.name in x.where]
        if not held and not struck:
            continue
        impulses = np.abs([impulse for _, impulse in struck])
        out.append({
            "name": switch.name,
            "word": next(word for state, word in enumerate(switch.states) if switch.active(state)),
            "points": typed(_place(sol.mechanism, switch, q), "float32"),
            "held": [t for span in held for t in span],
            "struck": [t for t, _ in struck],
            "strength": np.sqrt(impulses / (impulses.max(initial=0.0) or 1.0)).tolist(),
        })
    return out


def _held(sol: "Solution", switch: "Switch") -> list[tuple[float, float]]:
    """Times from which and to which rows of a switch are solved for."""
    times = sol.nodes[0]
    ends = [*(float(times[first]) for first, _ in sol.modes), float(times[-1])]
    out: list[tuple[float, float]] = []
    for (_, mode), begin, end in zip(sol.modes, ends[:-1], ends[1:], strict=True):
        if switch.active(mode[switch.at]):
            lasting = out and out[-1][1] == begin
            out.append((out.pop()[0] if lasting else begin, end))
    return out


def _place(mech: "Mechanism", switch: "Switch", q: Array) -> Array:
    """Where a switch is in the world at configurations q (m, nq), (m, 3): where a body touches, or at a joint."""
    name = mech.row_names[switch.rows[0]]
    if name in {c.name for c in rolling(mech)}:
        return path(mech, name, q)
    spec = next(c for c in mech.constraints if c.name == name)
    at = spec.frames[1] if spec.frames else spec.between[0]
    return paths(mech.model, [at], q)[0]
