"""Marks of a replay of a run with modes: stuck joints, closed contacts, engaged clutches, and impacts."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...mechanism.contacts import contact_path, rolling_closures
from ...mechanism.frames import frame_paths, joint_paths
from ...system import Array
from .threejs import typed

if TYPE_CHECKING:
    from ...mechanism import Mechanism
    from ...mechanism.hybrid.switch import Switch
    from ...solution.solution import Solution

ACTIVE_COLOUR, IMPACT_COLOUR = "#6741d9", "#f59f00"


class ModeTrack(NamedTuple):
    """Switch that was active or took impulses in a run.

    Attributes:
        name: of the switch.
        word: for its active state.
        positions: at each frame in m, (k, m, 3): of its joints, or of the contact point.
        active: start and end times in s of its active intervals, in order.
        impacts: times in s of impacts.
        strength: of impacts, the square root of the impulse relative to the largest one.
    """

    name: str
    word: str
    positions: Array
    active: list[float]
    impacts: list[float]
    strength: list[float]

    def core_data(self) -> dict[str, Any]:
        """Return the data of the page."""
        data = self._asdict()
        positions = data.pop("positions")
        return {**data, "positions": [typed(track, "float32") for track in positions]}


def mode_tracks_of(sol: "Solution", q: Array) -> list[ModeTrack]:
    """Return the switches that were active or took impulses, with their positions at the configurations q (m, nq)."""
    out = []
    for switch in sol.mechanism.switches:
        if not switch.rows:  # a driver with a stepwise speed, whose row is active in all modes
            continue
        spans = _active_intervals(sol, switch)
        impacts = [(x.t, x.impulse[x.where.index(switch.name)]) for x in sol.impacts if switch.name in x.where]
        if not spans and not impacts:
            continue
        word = next(word for state, word in enumerate(switch.states) if switch.active_rows(state))
        impulses = np.abs([impulse for _, impulse in impacts])
        strength = np.sqrt(impulses / (impulses.max(initial=0.0) or 1.0)).tolist()
        ends = [t for span in spans for t in span]
        positions = _positions(sol.mechanism, switch, q)
        out.append(ModeTrack(switch.name, word, positions, ends, [t for t, _ in impacts], strength))
    return out


def _active_intervals(sol: "Solution", switch: "Switch") -> list[tuple[float, float]]:
    """Return start and end times of the intervals in which rows of a switch are active."""
    times = sol.nodes[0]
    ends = [*(float(times[first]) for first, _ in sol.modes), float(times[-1])]
    out: list[tuple[float, float]] = []
    for (_, mode), begin, end in zip(sol.modes, ends[:-1], ends[1:], strict=True):
        if switch.active_rows(mode[switch.index]):
            continued = out and out[-1][1] == begin
            out.append((out.pop()[0] if continued else begin, end))
    return out


def _positions(mech: "Mechanism", switch: "Switch", q: Array) -> Array:
    """Return positions of a switch at configurations q (m, nq), (k, m, 3): of the contact point, or of k joints."""
    name = mech.row_names[switch.rows[0]]
    if name in {c.name for c in rolling_closures(mech)}:
        return contact_path(mech, name, q)[None]
    spec = next(c for c in mech.constraints if c.name == name)
    return frame_paths(mech.model, spec.frames[1:], q) if spec.frames else joint_paths(mech.model, spec.between, q)
