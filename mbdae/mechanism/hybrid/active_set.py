"""Mode after an event: the active set of the complementarity problem of accelerations and multipliers.

Velocities are continuous at this point. Candidates are rows in contact and at rest: either the multiplier of a row is
within its bounds and the row does not accelerate, or it is at a bound (separating, slipping) and the row accelerates in
the direction that the bound allows. Rows are released until the set is consistent; `undecided_rows` handles unilateral
rows that neither carry a force nor separate.
"""

from typing import TYPE_CHECKING

import numpy as np

from ...errors import StepError
from ...system import Array
from ...tolerances import MODE_ROUNDING, SOLUTION_ROUNDING, TRUNCATION, ZERO_SPEED
from ..closures.independent_rows import mass_scaled
from .friction_lcp import FrictionBound, solve_friction_lcp
from .impact_law import project_out, range_and_inverse
from .switch import CandidateRow
from .switches import error_with_names
from .undecided_rows import MultipliersAfterStep, rows_that_stay_active

if TYPE_CHECKING:
    from .mode_point import ModePoint
    from .switches import Mode


Candidates = dict[int, tuple[CandidateRow, ...]]  # by index of the switch


def select_mode(
    point: "ModePoint", unswitched: Array, separated: set[int], multipliers_after_step: MultipliersAfterStep
) -> "Mode":
    """Return the mode after an event, at a point where velocities are continuous.

    Args:
        point: the point, in the mode before.
        unswitched: indices of the rows without a switch.
        separated: indices of the switches whose contacts separate in the event.
        multipliers_after_step: the multipliers after a short step, for undecided rows.

    Raises:
        StepError: if friction has no solution, or several (Painleve paradox), or if no force can keep a row closed.
    """
    problem = _ActiveSet(point, unswitched, separated)
    problem.release()
    problem.require_solution()
    problem.enter_states()
    problem.decide_undecided(multipliers_after_step)
    return tuple(problem.mode)


class _ActiveSet:
    """Candidate rows at a point, and the states of all switches without candidates.

    Attributes:
        mode: states of all switches.
        remaining: candidates that are not released.
        separating: switches in ``remaining`` whose contacts separate, unless their gaps would close.
        lam, rates, scale: multipliers, accelerations G v' + gamma and their magnitudes, (ng,) each, for the candidates
            that do not separate.
    """

    def __init__(self, point: "ModePoint", unswitched: Array, separated: set[int]) -> None:
        self.point, self.unswitched, self.switches = point, unswitched, point.system.mechanism.switches
        self.mode, self.remaining = list(point.system.mode), Candidates()
        for s in self.switches:
            candidates = s.candidate_rows(point, self.mode[s.index], SOLUTION_ROUNDING)
            if candidates and s.is_at_rest(point, candidates[0].row):
                self.remaining[s.index] = candidates
        for s in self.switches:
            if s.index not in self.remaining:
                self.mode[s.index] = s.next_state(point, (), (), False)
        self.separating, self.largest = {i for i in separated if i in self.remaining}, 0.0

    def release(self) -> None:
        """Release rows outside their bounds until none is left."""
        changed = True
        while changed:
            self.active = {i: c for i, c in self.remaining.items() if i not in self.separating}
            self.lam, self.rates, self.scale = self._solve()
            self.largest = max(self.largest, float(np.abs(self.lam).max(initial=0.0)))
            changed = self._retain_approaching() or self._release_inactive()

    def _retain_approaching(self) -> bool:
        """Retain one row that cannot separate because its gap would close; return False if there is none."""
        approaching = [i for i in self.separating if self._approaches(self.remaining[i][0])]
        self.separating -= set(approaching[:1])
        return bool(approaching)

    def _release_inactive(self) -> bool:
        """Release rows outside their bounds if this changes other multipliers; return False if there are none."""
        self.is_active = {i: self._is_active(c[0]) for i, c in self.active.items()}
        released = [i for i, active in self.is_active.items() if not active and _releases(self.active[i])]
        for i in released:  # the smaller friction while slipping changes the other multipliers
            del self.remaining[i]
            self._next_state(i, self.active[i] if self.active[i][0].is_bounded else (), False)
        return bool(released)

    def require_solution(self) -> None:
        """Check that rows with zero multipliers do not close: a row that depends on closures cannot stop their motion.

        Raises:
            StepError: with the names of such rows.
        """
        idle = [(i, c[0]) for i, c in self.active.items() if c[0].is_unilateral and not self.is_active[i]]
        if blocked := [i for i, c in idle if self._approaches(c)]:
            reason = "closures or drivers move against its direction, and no force on it can stop them"
            raise error_with_names(StepError("impact", reason), self.switches, self.point.t, blocked)

    def enter_states(self) -> None:
        """Set the states of the remaining candidates."""
        for i, c in self.active.items():
            self._next_state(i, c, self.is_active[i])
        for i in self.separating:
            self._next_state(i, (), False)

    def decide_undecided(self, multipliers_after_step: MultipliersAfterStep) -> None:
        """Set the states of undecided unilateral rows by their multipliers after a short step."""
        unilateral = {i: c[0] for i, c in self.active.items() if len(c) == 1 and c[0].is_unilateral}
        undecided = {i: x for i, x in unilateral.items() if self._is_undecided(x)}
        if undecided:
            base = tuple(0 if i in undecided else k for i, k in enumerate(self.mode))
            active = rows_that_stay_active(base, undecided, multipliers_after_step)
            for i, x in undecided.items():
                self._next_state(i, (x,), i in active)

    def _next_state(self, i: int, candidates: tuple[CandidateRow, ...], active: bool) -> None:
        lam, rates = [self.lam[c.row] for c in candidates], [self.rates[c.row] for c in candidates]
        self.mode[i] = self.switches[i].next_state(self.point, lam, rates, active)

    def _is_undecided(self, c: CandidateRow) -> bool:
        """Return whether multiplier and acceleration of a row are both zero, to the rounding of the forces."""
        point, row = self.point, self.point.G[c.row]
        direction = mass_scaled(point.system.inertia(point.t, point.q), row[None])[:, 0]
        error = point.rounding / (float(np.abs(row).max()) or 1.0) * float(direction @ direction)  # of accelerations
        smallest = ZERO_SPEED / SOLUTION_ROUNDING * error
        zero = max(MODE_ROUNDING * self.largest, point.rounding)
        return bool(abs(self.lam[c.row]) <= zero and abs(self.rates[c.row]) <= smallest)

    def _is_active(self, c: CandidateRow) -> bool:
        if c.is_bounded:  # some redundant rows may be at a limit while all of them stick
            return bool(abs(self.rates[c.row]) <= ZERO_SPEED * self.scale[c.row])
        margin = MODE_ROUNDING * self.largest
        return bool(c.lower + margin < self.lam[c.row] < c.upper - margin)

    def _approaches(self, c: CandidateRow) -> bool:
        inward = -self.rates[c.row] if np.isfinite(c.lower) else self.rates[c.row]
        mech = self.point.system.mechanism
        largest = mech.characteristic_rate**2 + float(np.abs(self.rates / mech.row_scales).max())
        return bool(inward > ZERO_SPEED * largest * mech.row_scales[c.row])

    def _solve(self) -> tuple[Array, Array, Array]:
        """Solve the complementarity problem of the active candidates."""
        point, found = self.point, self.active
        base = tuple(0 if i in found else state for i, state in enumerate(self.mode))
        rates = self._unconstrained_accelerations(base)
        lam, scale = np.zeros(point.system.ng), np.abs(rates)
        candidates = [c for cs in found.values() for c in cs]
        rows = np.array([c.row for c in candidates], int)
        if not len(rows):
            return lam, rates, scale
        bounds = np.array([c.lower for c in candidates]), np.array([c.upper for c in candidates])
        B, Q = self._mass_scaled_rows(base)
        C = project_out(Q, B[:, rows])
        C[:, np.linalg.norm(C, axis=0) <= TRUNCATION * np.linalg.norm(B[:, rows], axis=0)] = 0.0  # dependent rows
        lam[rows] = self._multipliers(C, rates[rows], *bounds)
        width = bounds[1] - bounds[0]
        scale[rows] += (C * C).sum(axis=0) * np.where(np.isfinite(width), width, 0.0)
        return lam, rates + project_out(Q, B).T @ (C @ lam[rows]), scale

    def _multipliers(self, C: Array, c: Array, lower: Array, upper: Array) -> Array:
        """Solve for the multipliers of the active candidates, see `friction_lcp`."""
        try:
            return solve_friction_lcp(C, c, lower, upper, _friction_bounds(self.active))
        except StepError as reason:
            frictional = (i for i, cs in self.active.items() if any(c.friction >= 0 for c in cs))
            raise error_with_names(reason, self.switches, self.point.t, frictional) from None

    def _unconstrained_accelerations(self, base: "Mode") -> Array:
        """Return G v' + gamma of all rows (ng,) in a mode where no candidate is active."""
        point, system, before = self.point, self.point.system, self.point.system.mode
        system.enter(base)
        F, _ = system.derivative(point.t, point.y)
        system.enter(before)
        return point.G @ F[system.nv : 2 * system.nv] + point.gamma

    def _mass_scaled_rows(self, base: "Mode") -> tuple[Array, Array]:
        """Return M^-1/2 G^T (nv, ng), and an orthonormal basis of the span of its active columns, (nv, r)."""
        point = self.point
        B = mass_scaled(point.system.inertia(point.t, point.q), point.G)
        switched = {row for s, state in zip(self.switches, base, strict=True) for row in s.active_rows(state)}
        active = np.array([*self.unswitched, *sorted(switched)], int)
        return B, range_and_inverse(B[:, active])[0]


def _releases(candidates: tuple[CandidateRow, ...]) -> bool:
    """Return whether releasing rows outside their bounds changes other multipliers."""
    return len(candidates) > 1 or candidates[0].is_bounded


def _friction_bounds(found: Candidates) -> dict[int, FrictionBound]:
    """Return the friction bounds of the tangential rows, by their index among all candidates."""
    bounds, first = dict[int, FrictionBound](), 0
    for cs in found.values():
        tangential = [(first + k, c) for k, c in enumerate(cs) if c.friction >= 0]
        bounds |= {k: FrictionBound(first, c.friction, c.sliding_ratio) for k, c in tangential}
        first += len(cs)
    return bounds
