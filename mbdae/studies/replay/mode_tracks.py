"""Marks of switches in a replay: sticking joints, closed contacts, engaged clutches, and impacts."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...mechanism.scene.drawables import Drawable, Track, primitive
from ...mechanism.signals.contacts import contact_path, rolling_closures
from ...mechanism.tree.frames import frame_paths, joint_paths
from ...system import Array
from ...tolerances import INPUT_DIGITS
from .animation_tracks import MovingDrawables, rgba_of

if TYPE_CHECKING:
    from ...mechanism import Mechanism
    from ...mechanism.hybrid.switch import Switch
    from ...solution.solution import Solution

ACTIVE_COLOUR, IMPACT_COLOUR = "#6741d9", "#f59f00"
FLASH, SUDDEN = 0.25, 0.001  # duration and rise time of the mark of an impact, in s of viewing
LISTED_NAMES = 3  # largest number of names in a line of the legend
IMPACT_SIZE = 2.5  # size of the mark of the strongest impact over that of an active contact


class ModeTrack(NamedTuple):
    """A switch that was active or received impulses in a run.

    Attributes:
        name: name of the switch.
        word: names of the active states that occurred.
        positions: positions of the joints, or of the contact point, at each frame in m, (k, m, 3).
        active: start and end times in s of the active intervals, in order.
        impacts: times in s of impacts.
        strength: strengths of impacts: the square root of the impulse over the largest one.
    """

    name: str
    word: str
    positions: Array
    active: list[float]
    impacts: list[float]
    strength: list[float]


def mark_drawables(marks: Sequence[ModeTrack], times: Array, speed: float, width: float) -> MovingDrawables:
    """Return balls at active contacts, and for a quarter of a second of viewing at impacts.

    Args:
        marks: marks of a run.
        times: times of the frames in s, (m,).
        speed: seconds of motion per second of viewing.
        width: width of links in m; balls have three times this radius.
    """
    out = MovingDrawables([], [], "/mechanism/mode")
    for mark in marks:
        for kind, colour, scales in (
            ("active", ACTIVE_COLOUR, _active_scales(mark, times)),
            ("impact", IMPACT_COLOUR, _impact_scales(mark, times, speed)),
        ):
            if not scales.values.any():
                continue
            scales = scales._replace(values=np.maximum(scales.values, INPUT_DIGITS))  # a scale of 0 leaves no normals
            for k, points in enumerate(mark.positions):
                name = f"{mark.name.replace('/', '|')} {kind}" + (f" {k + 1}" if k else "")
                ball = primitive("ellipsoid", (1.0, 1.0, 1.0))
                out.drawables.append(Drawable(name, ball, (3 * width,) * 3, rgba_of(colour, 0.6), "mark"))
                still = Track(np.tile([0.0, 0.0, 0.0, 1.0], (len(points), 1)))
                out.motions.append({"position": Track(points), "rotation": still, "scale": scales})
    return out


def mode_legend(marks: Sequence[ModeTrack]) -> list[dict[str, str]]:
    """Return colours and texts of marks."""
    active = [x for x in marks if x.active]
    out = []
    for word in dict.fromkeys(x.word for x in active):
        names = [x.name for x in active if x.word == word]
        listed = f"{len(names)} joints and contacts" if len(names) > LISTED_NAMES else ", ".join(names)
        out.append({"colour": ACTIVE_COLOUR, "text": f"{listed}: {word}"})
    return out + [{"colour": IMPACT_COLOUR, "text": "impact"}] * any(x.impacts for x in marks)


def _elapsed(t: Sequence[float], times: Array) -> Array:
    """Return times since the first frame, negative before it; time may decrease in the run."""
    return (np.array(t) - times[0]) * (1.0 if times[-1] >= times[0] else -1.0)


def _active_scales(mark: ModeTrack, times: Array) -> Track:
    """Return the sizes of a mark, which change at the times at which it appears or disappears."""
    end = np.float32(abs(times[-1] - times[0]))
    ends = _elapsed(mark.active, times).reshape(-1, 2).astype("f4")
    # no change at the end: the last frame remains visible
    at = np.unique(np.append(ends[(ends > 0) & (ends < end)], np.float32(0)))
    low, high = ends.T
    shown = ((low <= at[:, None]) & (at[:, None] < high)).any(axis=1).astype(float)
    return Track(np.tile(shown[:, None], 3), at, stepped=True)


def _impact_scales(mark: ModeTrack, times: Array, speed: float) -> Track:
    """Return the sizes of a mark, which jump at impacts and decay to 0."""
    if not mark.impacts:
        return Track(np.zeros((1, 3)), np.zeros(1))
    impacts, end = _elapsed(mark.impacts, times), abs(times[-1] - times[0])
    at = np.concatenate([[0.0, end], impacts, impacts - SUDDEN * speed, impacts + FLASH * speed])
    at = np.unique(at[(at >= 0) & (at <= end)].astype("f4"))
    last = np.searchsorted(impacts.astype("f4"), at, side="right") - 1
    age = (at - impacts[last]) / (FLASH * speed)
    strength = IMPACT_SIZE * np.array(mark.strength)[last] * (1 - np.maximum(age, 0))
    return Track(np.tile(np.where((last < 0) | (age > 1), 0.0, strength)[:, None], 3), at)


def mode_tracks_of(sol: "Solution", q: Array) -> list[ModeTrack]:
    """Return the switches that were active or received impulses, with their positions at configurations q (m, nq)."""
    out = []
    for switch in sol.mechanism.switches:
        if not switch.rows:  # a driver with a stepwise speed, whose row is active in all modes
            continue
        spans = _active_intervals(sol, switch)
        impacts = [(x.t, x.impulse[x.where.index(switch.name)]) for x in sol.impacts if switch.name in x.where]
        if not spans and not impacts:
            continue
        impulses = np.abs([impulse for _, impulse in impacts])
        strength = np.sqrt(impulses / (impulses.max(initial=0.0) or 1.0)).tolist()
        ends = [t for span in spans for t in span]
        positions = _positions(sol.mechanism, switch, q)
        out.append(ModeTrack(switch.name, _word(sol, switch), positions, ends, [t for t, _ in impacts], strength))
    return out


def _word(sol: "Solution", switch: "Switch") -> str:
    """Return the names of the active states of a switch that occurred."""
    visited = {mode[switch.index] for _, mode in sol.modes}
    return " or ".join(word for k, word in enumerate(switch.states) if k in visited and switch.active_rows(k))


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
