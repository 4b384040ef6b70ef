"""The search for assembly modes: random starts, and all poses on the circuits of the modes that they lead to.

Only whole circuits can be missed. The search ends when each mode has come up three times, and c closed starts have led
to m modes with c >= (m + 1) ln((m + 1)/0.01): one more that is as easy to reach would be missed once in a hundred
times.
"""

from dataclasses import dataclass

import numpy as np

from ...mechanism import Mechanism
from ...mechanism.characteristic_length import linkage_lengths
from ...mechanism.frames import find_joint
from ...mechanism.joints import angle_components, lengths
from ...mechanism.position_search import gauss_newton, is_closed
from ...system import Array
from ...tolerances import RANK, SAME_POSE
from .circuits import circuit
from .pose_curve import PoseCurve

HITS = 3  # of each mode, by random starts
MISSED = 0.01  # how often a mode as easy as the others may be missed
NONE = 200  # starts of which none closes: then it is given up
SAME = 100 * SAME_POSE  # poses so near are one mode
ON_CURVE = 8  # as many singular poses lie on a curve of them: modes are points, and seldom double


@dataclass
class FoundMode:
    """A mode.

    Attributes:
        q: configuration, (nq,).
        circuit: the number of its circuit, from 1.
        rising: whether the input rises along the circuit.
        hits: how many random starts led to it.
    """

    q: Array
    circuit: int
    rising: bool
    hits: int = 0


class ModeSearch:
    """All poses of a mechanism at one value of its input.

    Args:
        moved: the mechanism with its drive, see `mbdae.studies.kinematics.driven_mechanism.driven_mechanism`.
        q0: a closed configuration (nq,), at any input.
        u: the input.
        counts: by which coordinates modes are distinguished, (nv,).

    Attributes:
        modes: those found, by circuit.
        starts: random ones.
        closed: how many of them led to a mode.
        warnings: why there may be more.
    """

    def __init__(self, moved: Mechanism, q0: Array, u: float, counts: Array) -> None:
        self.system, self.q0, self.u, self.counts = moved.system(), q0, u, counts
        self.curve = PoseCurve(self.system, angle_components(moved.model))
        self.modes: list[FoundMode] = []
        self.starts = self.closed = 0
        self.warnings: list[str] = []
        drive, self.period = moved.drivers[-1], 0.0
        if drive.joint and self.curve.angular[find_joint(moved.model, drive.joint).idx_v]:
            self.period = 2 * np.pi
        self.kept = {d.joint: d.follow(u)[0] for d in moved.drivers if d.joint and d.motion is not None}
        sliding = [abs(d.follow(u)[0]) for d in moved.drivers if moved.row_units[moved.rows_of(d.name)[0]] == "m"]
        reach = sum(linkage_lengths(moved)) + sum(sliding) or moved.characteristic_length
        self.widths = np.where(lengths(moved.model), reach, np.pi)

    def run(self, most: int) -> "ModeSearch":
        """ModeSearch from the given configuration, and from random ones, at most so many."""
        found = self._closed(self.q0)
        if found is not None:
            self._known(found)
        rng = np.random.default_rng(0)
        while self.starts < most and not self._enough() and not self._on_curve():
            self.starts += 1
            found = self._closed(self._start(rng))
            if found is not None:
                self.closed += 1
                self._known(found).hits += 1
        if self._on_curve():
            self.warnings = ["poses are not isolated: with the input held, something still moves"]
        elif self.modes and not self._enough():
            self.warnings.append(f"{most} starts are too few: some modes came up less than {HITS} times, or all rarely")
        self.modes.sort(key=lambda m: m.circuit)
        return self

    def _on_curve(self) -> bool:
        return sum(self.margin(m.q) < RANK for m in self.modes[: 2 * ON_CURVE]) >= ON_CURVE

    def margin(self, q: Array) -> float:
        """Smallest singular value of all rows over the largest: 0 where two modes coincide."""
        G = self.curve.closures(q, self.u)[1]
        G[-1] /= self.curve.unit
        sizes = np.linalg.svd(G, compute_uv=False)[: self.system.nv]
        return float(sizes[-1] / sizes[0])

    def _enough(self) -> bool:
        if not self.modes:
            return self.starts >= NONE
        m = len(self.modes) + 1
        return min(x.hits for x in self.modes) >= HITS and self.closed >= m * np.log(m / MISSED)

    def _start(self, rng: np.random.Generator) -> Array:
        """A random configuration: angles from half a turn to both sides, slides as far as all lengths together reach.

        No slide of a closed loop is longer than the sum of all other lengths.
        """
        mech = self.system.mechanism
        neutral, _ = mech.coordinates({})
        q = mech.manifold.integrate(neutral, rng.uniform(-1, 1, mech.nv) * self.widths)
        at_value, _ = mech.coordinates(self.kept)
        for name in self.kept:
            joint = find_joint(mech.model, name)
            q[joint.idx_q : joint.idx_q + joint.nq] = at_value[joint.idx_q : joint.idx_q + joint.nq]
        return q

    def _closed(self, q: Array) -> Array | None:
        """The closed pose that a start leads to, its angles within half a turn of the given configuration's."""
        q = gauss_newton(self.system, q, np.arange(self.system.nv), self.u)
        if not is_closed(self.system, q, self.u):
            return None
        near = self._turned_back(q)
        return q if near is None else near

    def _find(self, q: Array) -> FoundMode | None:
        same = (m for m in self.modes if np.abs(self.curve.wrapped(m.q, q)[self.counts]).max() < SAME)
        return next(same, None)

    def _known(self, q: Array) -> FoundMode:
        """The mode with this pose; where it is new, all others on its circuit are found with it."""
        found = self._find(q)
        if found is not None:
            return found
        number = 1 + max((m.circuit for m in self.modes), default=0)
        if self.margin(q) < RANK:
            self.warnings.append(f"circuit {number}: its first pose is singular")
            self.modes.append(FoundMode(q, number, True))
            return self.modes[-1]
        passed, warning = circuit(self.system, self.curve.angular, self.period, q, self.u)
        if warning:
            self.warnings.append(f"circuit {number}: {warning}")
        new = FoundMode(q, number, passed[0][1])
        self.modes.append(new)
        for other, rising in passed[1:]:
            pose = self._turned_back(other)
            if pose is not None and self._find(pose) is None:
                self.modes.append(FoundMode(pose, number, rising))
        return new

    def _turned_back(self, q: Array) -> Array | None:
        """A pose on a circuit with its full turns taken off; None where couplings do not let go of them."""
        near = self.curve.integrate(self.q0, self.curve.wrapped(self.q0, q))
        near = gauss_newton(self.system, near, np.arange(self.system.nv), self.u)
        same = is_closed(self.system, near, self.u) and np.abs(self.curve.wrapped(near, q)).max() < SAME
        return near if same else None
