"""Mode after an event: the active set of the complementarity problem of accelerations and loads.

Velocities do not jump here any more. Candidates are rows in contact and at rest: a row either carries load within its
box and does not accelerate, or is at a bound (open, slipping) and accelerates as the bound allows. Rows are released
until the set is consistent; unilateral rows that neither press nor separate are decided by `onset`.
"""

from typing import TYPE_CHECKING

import numpy as np

from ...errors import StepError
from ...system import Array
from ...tolerances import MODE_ROUNDING, SOLUTION_ROUNDING, STILL, TRUNCATION
from .friction_lcp import FrictionBound, solve_friction_lcp
from .onset import Later, pressing
from .switch import LoadCandidate
from .switches import with_names

if TYPE_CHECKING:
    from .mode_point import ModePoint
    from .switches import Mode


Candidates = dict[int, tuple[LoadCandidate, ...]]  # by index of the switch


def select_mode(at: "ModePoint", always: Array, opened: set[int], later: Later) -> "Mode":
    """Return the mode after a point where velocities no longer jump.

    Args:
        at: the point, in the mode before.
        always: indices of the rows without a switch.
        opened: indices of switches that separate there.
        later: loads a short step later, for rows that neither press nor separate at the point itself.

    Raises:
        StepError: if friction leaves no motion, or several.
    """
    problem = _ActiveSet(at, always, opened)
    problem.release()
    problem.enter_states()
    problem.decide_undecided(later)
    return tuple(problem.mode)


class _ActiveSet:
    """Candidates of a point, and the states of the others.

    Attributes:
        mode: states of all switches.
        left: candidates that are not released.
        separating: those of them that separate, unless others press them.
        lam, rates, scale: multipliers, accelerations G v' + gamma and their sizes, (ng,) each, of the candidates that
            do not separate.
    """

    def __init__(self, at: "ModePoint", always: Array, opened: set[int]) -> None:
        self.at, self.always, self.switches = at, always, at.system.mechanism.switches
        self.mode, self.left = list(at.system.mode), Candidates()
        for s in self.switches:
            candidates = s.load_candidates(at, self.mode[s.at], SOLUTION_ROUNDING)
            if candidates and at.is_at_rest(candidates[0].row):
                self.left[s.at] = candidates
        for s in self.switches:
            if s.at not in self.left:
                self.mode[s.at] = s.next_state(at, (), (), False)
        self.separating, self.largest = {i for i in opened if i in self.left}, 0.0

    def release(self) -> None:
        """Release rows outside of their boxes until there are none."""
        changed = True
        while changed:
            self.active = {i: c for i, c in self.left.items() if i not in self.separating}
            self.lam, self.rates, self.scale = self._solve()
            self.largest = max(self.largest, float(np.abs(self.lam).max(initial=0.0)))
            changed = self._keep_pressed() or self._release_unloaded()

    def _keep_pressed(self) -> bool:
        """Keep a row that cannot separate because others press it; False if there is none."""
        pressed = [i for i in self.separating if self._approaches(self.left[i][0])]
        self.separating -= set(pressed[:1])
        return bool(pressed)

    def _release_unloaded(self) -> bool:
        """Release rows outside of their boxes that change the load of others; False if there are none."""
        self.held = {i: self._held(c[0]) for i, c in self.active.items()}
        gone = [i for i, held in self.held.items() if not held and _releases(self.active[i])]
        for i in gone:  # less friction while slipping changes the load of the others
            del self.left[i]
            self._next_state(i, self.active[i] if self.active[i][0].slips else (), False)
        return bool(gone)

    def enter_states(self) -> None:
        """Set the states of the candidates that remain."""
        for i, c in self.active.items():
            self._next_state(i, c, self.held[i])
        for i in self.separating:
            self._next_state(i, (), False)

    def decide_undecided(self, later: Later) -> None:
        """Decide unilateral rows that neither press nor separate by their loads a short step later."""
        alone = {i: c[0] for i, c in self.active.items() if len(c) == 1 and c[0].one_sided}
        undecided = {i: x for i, x in alone.items() if self._undecided(x)}
        if undecided:
            others = tuple(0 if i in undecided else k for i, k in enumerate(self.mode))
            active = pressing(others, undecided, later)
            for i, x in undecided.items():
                self._next_state(i, (x,), i in active)

    def _next_state(self, i: int, candidates: tuple[LoadCandidate, ...], held: bool) -> None:
        lam, rates = [self.lam[c.row] for c in candidates], [self.rates[c.row] for c in candidates]
        self.mode[i] = self.switches[i].next_state(self.at, lam, rates, held)

    def _undecided(self, c: LoadCandidate) -> bool:
        """Return whether a row neither presses nor separates, to the rounding of the forces at the point."""
        at, row = self.at, self.at.G[c.row]
        along = np.linalg.solve(np.triu(at.system.inertia(at.t, at.q)).T, row)
        least = STILL / SOLUTION_ROUNDING * at.rounding * float(along @ along) / (float(np.abs(row).max()) or 1.0)
        zero = max(MODE_ROUNDING * self.largest, at.rounding)
        return bool(abs(self.lam[c.row]) <= zero and abs(self.rates[c.row]) <= least)

    def _held(self, c: LoadCandidate) -> bool:
        if c.slips:  # some redundant rows may be at a limit while all of them stick
            return bool(abs(self.rates[c.row]) <= STILL * self.scale[c.row])
        near = MODE_ROUNDING * self.largest
        return bool(c.lower + near < self.lam[c.row] < c.upper - near)

    def _approaches(self, c: LoadCandidate) -> bool:
        inward = -self.rates[c.row] if np.isfinite(c.lower) else self.rates[c.row]
        mech = self.at.system.mechanism
        largest = mech.characteristic_rate**2 + float(np.abs(self.rates / mech.row_scales).max())
        return bool(inward > STILL * largest * mech.row_scales[c.row])

    def _solve(self) -> tuple[Array, Array, Array]:
        """Solve the complementarity problem of the active candidates."""
        at, found = self.at, self.active
        base = tuple(0 if i in found else state for i, state in enumerate(self.mode))
        rates = self._unloaded_accelerations(base)
        lam, scale = np.zeros(at.system.ng), np.abs(rates)
        candidates = [c for cs in found.values() for c in cs]
        rows = np.array([c.row for c in candidates], int)
        if not len(rows):
            return lam, rates, scale
        bounds = np.array([c.lower for c in candidates]), np.array([c.upper for c in candidates])
        B, Q = self._mass_metric(base)
        C = _across(Q, B[:, rows])
        C[:, np.linalg.norm(C, axis=0) <= TRUNCATION * np.linalg.norm(B[:, rows], axis=0)] = 0.0  # active anyway
        lam[rows] = self._loads(C, rates[rows], *bounds)
        width = bounds[1] - bounds[0]
        scale[rows] += (C * C).sum(axis=0) * np.where(np.isfinite(width), width, 0.0)
        return lam, rates + _across(Q, B).T @ (C @ lam[rows]), scale

    def _loads(self, C: Array, c: Array, lower: Array, upper: Array) -> Array:
        """Solve for the multipliers of the active candidates, see `friction_lcp`."""
        try:
            return solve_friction_lcp(C, c, lower, upper, _friction_bounds(self.active))
        except StepError as reason:
            frictional = (i for i, cs in self.active.items() if any(c.share >= 0 for c in cs))
            raise with_names(reason, self.switches, self.at.t, frictional) from None

    def _unloaded_accelerations(self, base: "Mode") -> Array:
        """Return G v' + gamma of all rows (ng,) in a mode where no candidate is active."""
        at, system, before = self.at, self.at.system, self.at.system.mode
        system.enter(base)
        F, _ = system.derivative(at.t, at.y)
        system.enter(before)
        return at.G @ F[system.nv : 2 * system.nv] + at.gamma

    def _mass_metric(self, base: "Mode") -> tuple[Array, Array]:
        """Return M^-1/2 G^T (nv, ng), and an orthonormal basis of its columns that are kept in a mode, (nv, r)."""
        at = self.at
        B = np.linalg.solve(np.triu(at.system.inertia(at.t, at.q)).T, at.G.T)
        carried = {row for s, state in zip(self.switches, base, strict=True) for row in s.active(state)}
        kept = np.array([*self.always, *sorted(carried)], int)
        if not len(kept):
            return B, np.zeros((len(B), 0))
        left, sizes, _ = np.linalg.svd(B[:, kept], full_matrices=False)
        return B, left[:, sizes > TRUNCATION * sizes[:1]]


def _releases(candidates: tuple[LoadCandidate, ...]) -> bool:
    """Return whether rows outside of their box change the load of others when they are released."""
    return len(candidates) > 1 or candidates[0].slips


def _across(Q: Array, B: Array) -> Array:
    """Return the components of columns B across an orthonormal basis Q."""
    return B - Q @ (Q.T @ B) if Q.shape[1] else B


def _friction_bounds(found: Candidates) -> dict[int, FrictionBound]:
    """Return the friction bounds of the tangential rows, by their place among all candidates."""
    bounds, first = dict[int, FrictionBound](), 0
    for cs in found.values():
        bounds |= {first + k: FrictionBound(first, c.share, c.drag) for k, c in enumerate(cs) if c.share >= 0}
        first += len(cs)
    return bounds
