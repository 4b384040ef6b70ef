"""Transitions at guard zeros: an impact, and then the selection of the active set."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from ...errors import StepError
from ...mechanism.hybrid.friction_lcp import FrictionBound, solve_friction_lcp
from ...mechanism.hybrid.impact_law import RANK, STILL, FrictionRow, solve_impact
from ...mechanism.hybrid.mode_point import ROUNDING, AllRows, ModePoint
from ...mechanism.hybrid.switch import ImpactRow, LoadCandidate
from ...solution.impact_record import Impact
from ...system import Array
from .onset import later, pressing

if TYPE_CHECKING:
    from ...mechanism.formulations.index2 import Index2System
    from ...mechanism.hybrid.switches import Mode
    from ..run import RunState

NEAR = 1e-12  # rad or characteristic lengths: closer rows are in contact: the height of a microsecond's flight
EXACT = 1e-13  # of the largest speed: accuracy of kept rows after an impact
APPROACHING = 1e-9  # of the largest acceleration
JUMP = 1e-6  # of the largest speed: speed violation of newly active rows
HELD = 1e-9  # of the accelerations that a limit causes: smaller ones are zero
LOADED = 1e-10  # of the largest multiplier, including those of newly slipping rows: smaller ones are zero


class Transition:
    """Impacts and mode selection of a mechanism.

    Args:
        system: the run's workspace.
    """

    def __init__(self, system: "Index2System") -> None:
        self.system, self.all_rows = system, AllRows(system)
        self.switches = system.mechanism.switches
        switched = {row for s in self.switches for row in s.rows}
        self.always = np.array([k for k in range(system.ng) if k not in switched], int)

    def point(self, t: float, y: Array) -> ModePoint:
        """Return a point in the mode of the workspace."""
        return ModePoint(self.system, self.all_rows, t, y)

    def resolve_impact(self, at: ModePoint, soft: set[int]) -> tuple[Array, Impact | None]:
        """Return the point after an impact, and its record; None if no row approaches or becomes active.

        Args:
            at: the point.
            soft: switches with an impact a moment ago. If only these approach, all active contacts come to rest
                together, so that none reopens another; otherwise e = 0 for them.
        """
        mode, system = self.system.mode, self.system
        found = {s.at: s.impact_rows(at, mode[s.at], NEAR) for s in self.switches}
        found = {i: x for i, x in found.items() if x}
        scales = system.mechanism.row_scales
        rate, still = at.rate / scales, STILL * at.speed
        hit = [i for i, (x, *_) in found.items() if x.sign * rate[x.row] <= still or mode[i]]
        touched: list[tuple[int, ImpactRow]] = [(i, s) for i in hit for s in found[i] if s.sign]
        approaching = [i for i, s in touched if s.sign * rate[s.row] < -still]
        bound = [s.row for i in hit if not found[i][0].sign for s in found[i]]
        missed = [k for k in (*self.always, *bound) if abs(rate[k]) > EXACT * at.speed]
        if not approaching and not missed:
            return at.y, None
        others = [s.row for i in hit for s in found[i] if not s.sign and np.isnan(s.share)]
        apart = [(i, s) for i in found if i not in hit for s in found[i] if s.sign]
        frictional = [(i, s) for i in found for s in found[i] if s.share >= 0]
        if approaching and all(i in soft for i in approaching):
            with_friction = {i for i, _ in frictional}
            rests = [(i, s) for i, s in touched if (i in soft or mode[i]) and i not in with_friction]
            others += [s.row for _, s in rests]
            touched = [x for x in touched if x not in rests]
        kept = np.array([*self.always, *others], int)
        both = [*touched, *apart]
        rows = np.array([s.row for _, s in both], int)
        signs = np.array([s.sign for _, s in both])
        e = np.array([0.0 if i in soft else s.restitution for i, s in both])
        G, g_t = at.values[1] / scales[:, None], at.values[2] / scales
        U = np.triu(system.inertia(at.t, at.q))
        by = [next(k for k, (j, _) in enumerate(both) if j == i) for i, _ in frictional]
        pairs = zip(by, frictional, strict=True)
        friction_rows = [FrictionRow(k, G[s.row], float(g_t[s.row]), s.share) for k, (_, s) in pairs]
        try:
            closing = signs[:, None] * G[rows], signs * g_t[rows]
            impact = solve_impact(U, G[kept], g_t[kept], *closing, e, at.v, friction_rows, at.speed)
        except StepError as reason:
            raise self._named(reason, at.t, (i for i, _ in both)) from None
        y = at.y.copy()
        y[system.nq : system.nq + system.nv] = impact.v
        y[-1] += impact.work
        whole = np.zeros(system.ng)
        whole[rows] = signs * impact.p
        whole[kept] += impact.P
        whole[[s.row for _, s in frictional]] = impact.friction
        whole /= scales
        hits = [(self.switches[i].name, s.sign * whole[s.row]) for i in found for s in found[i][:1] if s.sign]
        joined = [k for k in dict.fromkeys(missed) if abs(rate[k]) > JUMP * at.speed]
        if not approaching and not joined:  # smaller velocity projections onto the rows of a mode do not count
            return y, None
        impulses = [(name, float(p)) for name, p in hits if p > 0]
        impulses += [(system.mechanism.row_names[k], float(whole[k])) for k in joined]
        where, impulse = zip(*impulses, strict=True) if impulses else ((), ())
        loss = -impact.work
        return y, Impact(at.t, tuple(where), tuple(impulse), tuple(whole.tolist()), loss)

    def choice(self, run: "RunState", t: float, y: Array, opened: set[int]) -> "Mode":
        """Select the mode after a point where velocities no longer jump.

        Args:
            run: the run, whose method decides about rows that neither press nor separate at the point itself.
            t: time.
            y: the point.
            opened: indices of switches that separate there.
        """
        before = self.system.mode
        at = self.point(t, y)
        found: dict[int, tuple[LoadCandidate, ...]] = {}
        for s in self.switches:
            candidates = s.load_candidates(at, before[s.at], NEAR)
            if candidates and at.is_at_rest(candidates[0].row):
                found[s.at] = candidates
        mode, left = list(before), dict(found)
        for s in self.switches:
            if s.at not in found:
                mode[s.at] = s.next_state(at, (), (), False)
        waiting, largest = {i for i in opened if i in left}, 0.0
        while True:
            among = {i: c for i, c in left.items() if i not in waiting}
            lam, rates, scale = self._constrained_accelerations(at, mode, among)
            largest = max(largest, float(np.abs(lam).max(initial=0.0)))
            pressed = [i for i in waiting if self._approaches(at, left[i][0], rates)]
            if pressed:  # it cannot separate: others press it
                waiting -= set(pressed[:1])
                continue
            held = {i: self._held(c[0], lam, rates, scale, LOADED * largest) for i, c in among.items()}
            gone = [i for i, yes in held.items() if not yes and (len(among[i]) > 1 or among[i][0].slips)]
            if not gone:
                break
            left = {i: c for i, c in left.items() if i not in gone}
            for i in gone:  # less friction while slipping changes the load of the others
                c = among[i] if among[i][0].slips else ()
                mode[i] = self.switches[i].next_state(at, [lam[x.row] for x in c], [rates[x.row] for x in c], False)
        for i, c in among.items():
            values = [lam[x.row] for x in c], [rates[x.row] for x in c]
            mode[i] = self.switches[i].next_state(at, *values, held[i])
        for i in waiting:
            mode[i] = self.switches[i].next_state(at, (), (), False)
        alone = {i: c[0] for i, c in among.items() if len(c) == 1 and c[0].one_sided}
        undecided = {i: x for i, x in alone.items() if self._undecided(at, x, lam, rates, LOADED * largest)}
        if undecided:
            others = tuple(0 if i in undecided else k for i, k in enumerate(mode))
            presses = pressing(others, undecided, later(run, at))
            for i, x in undecided.items():
                mode[i] = self.switches[i].next_state(at, lam[[x.row]].tolist(), rates[[x.row]].tolist(), i in presses)
        return tuple(mode)

    def _undecided(self, at: ModePoint, c: LoadCandidate, lam: Array, rates: Array, near: float) -> bool:
        """Return whether a row neither presses nor separates, to the rounding of the forces at the point."""
        row = at.G[c.row]
        along = np.linalg.solve(np.triu(self.system.inertia(at.t, at.q)).T, row)
        least = HELD / ROUNDING * at.rounding * float(along @ along) / (float(np.abs(row).max()) or 1.0)
        return bool(abs(lam[c.row]) <= max(near, at.rounding) and abs(rates[c.row]) <= least)

    def _named(self, reason: StepError, t: float, which: Iterable[int]) -> StepError:
        names = " and ".join(repr(self.switches[i].name) for i in dict.fromkeys(which))
        return StepError(reason.status, f"{names}: {reason}, at t = {t:.17g}")

    def _held(self, c: LoadCandidate, lam: Array, rates: Array, scale: Array, near: float) -> bool:
        if c.slips:  # some redundant rows may be at a limit while all of them stick
            return bool(abs(rates[c.row]) <= HELD * scale[c.row])
        return bool(c.lower + near < lam[c.row] < c.upper - near)

    def _approaches(self, at: ModePoint, c: LoadCandidate, rates: Array) -> bool:
        inward = -rates[c.row] if np.isfinite(c.lower) else rates[c.row]
        mech = self.system.mechanism
        largest = mech.characteristic_rate**2 + float(np.abs(rates / mech.row_scales).max())
        return bool(inward > APPROACHING * largest * mech.row_scales[c.row])

    def _constrained_accelerations(
        self, at: ModePoint, mode: list[int], found: dict[int, tuple[LoadCandidate, ...]]
    ) -> tuple[Array, Array, Array]:
        """Return multipliers, accelerations G v' + gamma and their sizes, (ng,) each, with loads on candidates."""
        system, before = self.system, self.system.mode
        base = tuple(0 if i in found else state for i, state in enumerate(mode))
        system.enter(base)
        F, _ = system.derivative(at.t, at.y)
        system.enter(before)
        rates = at.G @ F[system.nv : 2 * system.nv] + at.gamma
        lam, scale = np.zeros(system.ng), np.abs(rates)
        rows = np.array([c.row for cs in found.values() for c in cs], int)
        if not len(rows):
            return lam, rates, scale
        lower, upper = (np.array([getattr(c, k) for cs in found.values() for c in cs]) for k in ("lower", "upper"))
        carried = {row for s, state in zip(self.switches, base, strict=True) for row in s.active(state)}
        kept = np.array([*self.always, *sorted(carried)], int)
        U = np.triu(system.inertia(at.t, at.q))
        B = np.linalg.solve(U.T, at.G.T)
        C = B[:, rows]
        if len(kept):
            left, sizes, _ = np.linalg.svd(B[:, kept], full_matrices=False)
            Q = left[:, sizes > RANK * sizes[:1]]
            C = C - Q @ (Q.T @ C)
            C[:, np.linalg.norm(C, axis=0) <= RANK * np.linalg.norm(B[:, rows], axis=0)] = 0.0  # active anyway
        limits, first = dict[int, FrictionBound](), 0
        for cs in found.values():
            limits |= {first + k: FrictionBound(first, c.share, c.drag) for k, c in enumerate(cs) if c.share >= 0}
            first += len(cs)
        try:
            lam[rows] = solve_friction_lcp(C, rates[rows], lower, upper, limits)
        except StepError as reason:
            raise self._named(reason, at.t, (i for i, cs in found.items() if any(c.share >= 0 for c in cs))) from None
        vdot = C @ lam[rows]
        free = B - Q @ (Q.T @ B) if len(kept) else B
        bounded = np.where(np.isfinite(upper - lower), upper - lower, 0.0)
        scale[rows] += (C * C).sum(axis=0) * bounded
        return lam, rates + free.T @ vdot, scale
