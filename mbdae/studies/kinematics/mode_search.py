"""Search for assembly modes from random starts, and along the circuits of the modes found.

Only whole circuits can be missed. The search ends when each mode has been found three times, and c closed starts have
led to m modes with c >= (m + 1) ln((m + 1)/0.01): another mode as likely as these would be missed with a probability
of 1 %.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...mechanism import Mechanism
from ...mechanism.assembly.position_search import gauss_newton, is_closed
from ...mechanism.closures.kinds.coupling import CouplingClosure
from ...mechanism.equations.axis_chains import axis_chains, end_distances
from ...mechanism.equations.characteristic_length import linkage_lengths
from ...mechanism.tree.frames import find_joint, find_joints
from ...mechanism.tree.joints import angle_components, translation_components
from ...system import Array
from ...tolerances import RANK, SAME_POSE
from .curve.circuits import circuit
from .curve.pose_curve import PoseCurve

if TYPE_CHECKING:
    from ...mechanism.formulations.index2 import Index2System

HITS = 3  # required hits of each mode by random starts
MISS_PROBABILITY = 0.01  # probability of missing a mode that is as likely as those found
MAX_OPEN_STARTS = 200  # number of starts after which the search is abandoned if none closes
MODE_TOLERANCE = 100 * SAME_POSE  # distance of poses of one mode
MAX_SINGULAR = 8  # number of singular modes that indicates a continuum of poses, since isolated modes rarely coincide


@dataclass
class FoundMode:
    """An assembly mode during the search.

    Attributes:
        q: configuration, (nq,).
        circuit: the number of its circuit, from 1.
        rising: whether the input increases along the circuit.
        margin: see `ModeSearch.margin`.
        hits: number of random starts that led to it.
    """

    q: Array
    circuit: int
    rising: bool
    margin: float
    hits: int = 0


class ModeSearch:
    """All poses of a mechanism at one value of its input.

    Args:
        driven: the mechanism with its drive, see `mbdae.studies.kinematics.driven_mechanism.driven_mechanism`.
        q0: a closed configuration (nq,), at any input.
        u: the input.
        distinguishing: mask of the coordinates by which modes are distinguished, (nv,).

    Attributes:
        modes: found modes, by circuit.
        starts: number of random starts.
        closed: number of starts that led to a mode.
        warnings: reasons why modes may be missing.
    """

    def __init__(self, driven: Mechanism, q0: Array, u: float, distinguishing: Array) -> None:
        self.system, self.q0, self.u, self.distinguishing = driven.system(), q0, u, distinguishing
        self.curve = PoseCurve(self.system, angle_components(driven.model))
        self.modes: list[FoundMode] = []
        self.starts = self.closed = 0
        self.warnings: list[str] = []
        drive, self.period = driven.drivers[-1], 0.0
        if drive.joint and self.curve.angular[find_joint(driven.model, drive.joint).idx_v]:
            self.period = 2 * np.pi
        self.locked_values = {d.joint: d.follow(u)[0] for d in driven.drivers if d.joint and d.motion is not None}
        sliding = [abs(d.follow(u)[0]) for d in driven.drivers if driven.row_units[driven.rows_of(d.name)[0]] == "m"]
        reach = sum(linkage_lengths(driven)) + sum(sliding) or driven.characteristic_length
        self.chains = [x for x in axis_chains(driven) if distinguishing[x.columns].all()]
        self.widths = np.where(translation_components(driven.model), reach, np.pi)

    def run(self, most: int) -> "ModeSearch":
        """Search from the given configuration, and from at most ``most`` random configurations."""
        found = self._close(self.q0)
        if found is not None:
            self._register(found)
        rng = np.random.default_rng(0)
        while self.starts < most and not self._is_complete() and not self._is_continuum():
            self.starts += 1
            found = self._close(self._start(rng))
            if found is not None:
                self.closed += 1
                self._register(found).hits += 1
        if self._is_continuum():
            self.warnings = ["poses are not isolated: the mechanism can move while the input is locked"]
        elif self.modes and not self._is_complete():
            self.warnings.append(
                f"{most} starts are too few: some modes were found fewer than {HITS} times, or all rarely"
            )
        self.modes.sort(key=lambda m: m.circuit)
        return self

    def _is_continuum(self) -> bool:
        return sum(m.margin < RANK for m in self.modes[: 2 * MAX_SINGULAR]) >= MAX_SINGULAR

    def margin(self, q: Array) -> float:
        """Return the ratio of the smallest to the largest singular value of all rows: 0 where two modes coincide."""
        G = self.curve.closures(q, self.u)[1]
        G[-1] /= self.curve.unit
        sigmas = np.linalg.svd(G, compute_uv=False)[: self.system.nv]
        return float(sigmas[-1] / sigmas[0])

    def _is_complete(self) -> bool:
        if not self.modes:
            return self.starts >= MAX_OPEN_STARTS
        m = len(self.modes) + 1
        return min(x.hits for x in self.modes) >= HITS and self.closed >= m * np.log(m / MISS_PROBABILITY)

    def _start(self, rng: np.random.Generator) -> Array:
        """Return a random configuration: angles in [-pi, pi], prismatic coordinates within the sum of all lengths.

        No prismatic coordinate of a closed loop exceeds the sum of all other lengths.
        """
        mech = self.system.mechanism
        neutral, _ = mech.coordinates({})
        q = mech.manifold.integrate(neutral, rng.uniform(-1, 1, mech.nv) * self.widths)
        at_value, _ = mech.coordinates(self.locked_values)
        for name in self.locked_values:
            joint = find_joint(mech.model, name)
            q[joint.idx_q : joint.idx_q + joint.nq] = at_value[joint.idx_q : joint.idx_q + joint.nq]
        return q

    def _close(self, q: Array) -> Array | None:
        """Return the closed pose from a start, with angles within pi of those of q0; None if it does not close."""
        q = gauss_newton(self.system, q, np.arange(self.system.nv), self.u)
        if not is_closed(self.system, q, self.u):
            return None
        unwrapped = self._unwrapped(q)
        return q if unwrapped is None else unwrapped

    def _find(self, q: Array) -> FoundMode | None:
        same = (m for m in self.modes if self._distance(m.q, q)[self.distinguishing].max() < MODE_TOLERANCE)
        return next(same, None)

    def _distance(self, q0: Array, q1: Array) -> Array:
        """Return |q1 (-) q0| up to full turns, (nv,); of axes in a chain the distance of the poses at its end."""
        distance = np.abs(self.curve.wrapped_difference(q0, q1))
        for chain, x in zip(self.chains, end_distances(self.system.mechanism, self.chains, q0, q1), strict=True):
            distance[chain.columns] = x
        return distance

    def _register(self, q: Array) -> FoundMode:
        """Return the mode with this pose; if it is new, add all modes of its circuit."""
        found = self._find(q)
        if found is not None:
            return found
        number = 1 + max((m.circuit for m in self.modes), default=0)
        margin = self.margin(q)
        if margin < RANK:
            self.warnings.append(f"circuit {number}: its first pose is singular")
            self.modes.append(FoundMode(q, number, True, margin))
            return self.modes[-1]
        crossings, warning = circuit(self.system, self.curve.angular, self.period, q, self.u)
        if warning:
            self.warnings.append(f"circuit {number}: {warning}")
        new = FoundMode(q, number, crossings[0][1], margin)
        self.modes.append(new)
        for other, rising in crossings[1:]:
            pose = self._unwrapped(other)
            if pose is not None and self._find(pose) is None:
                self.modes.append(FoundMode(pose, number, rising, self.margin(pose)))
        return new

    def _unwrapped(self, q: Array) -> Array | None:
        """Return a pose with its full turns removed; None if couplings between joints do not allow that."""
        pose = self.curve.integrate(self.q0, self.curve.wrapped_difference(self.q0, q))
        pose = gauss_newton(self.system, pose, np.arange(self.system.nv), self.u)
        is_same = (
            is_closed(self.system, pose, self.u)
            and np.abs(self.curve.wrapped_difference(pose, q)).max() < MODE_TOLERANCE
        )
        return pose if is_same else None


def coordinates_in_couplings_only(mech: Mechanism, system: "Index2System", u: float) -> Array:
    """Return a mask of the coordinates that occur in a coupling, and in no other row, (nv,): wheels, racks, cams.

    Args:
        mech: the mechanism with its drive.
        system: a workspace of the mechanism.
        u: the input.
    """
    out = np.zeros(mech.nv, bool)
    q = mech.manifold.integrate(mech.coordinates({})[0], np.random.default_rng(0).uniform(-1, 1, mech.nv))
    incidence = system.closures(q, u)[1] != 0  # at a generic pose
    remaining = {mech.rows_of(c.name)[0]: c for c in mech.closures if isinstance(c, CouplingClosure)}
    while True:
        dependent = {
            row: joint.idx_v
            for row, c in remaining.items()
            for joint in find_joints(mech.model, c.joints if c.is_linear else c.joints[:1])
            if np.count_nonzero(incidence[:, joint.idx_v]) == 1
        }
        if not dependent:
            return out
        for row, column in dependent.items():
            out[column], incidence[row] = True, False
            del remaining[row]
