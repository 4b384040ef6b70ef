"""Impact at a point: contact detection, the complementarity problem, and its impulses by name."""

from collections.abc import Collection, Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import StepError
from ...system import Array
from ...tolerances import EVALUATION_ROUNDING, MODE_ROUNDING, SOLUTION_ROUNDING, VISIBLE
from ..closures.independent_rows import mass_scaled
from .impact_law import FrictionRow, ImpactSolution, ImpactStage, solve_impact
from .switch import ImpactRow
from .switches import error_with_names

if TYPE_CHECKING:
    from .mode_point import ModePoint


class Impact(NamedTuple):
    """An impact.

    Attributes:
        t: time in s.
        where: names of the stops and closures involved.
        impulse: their impulses in N s, or N m s for rotations.
        rows: impulses of all rows, (ng,), including reactions in loops.
        loss: energy loss in J.
    """

    t: float
    where: tuple[str, ...]
    impulse: tuple[float, ...]
    rows: tuple[float, ...]
    loss: float


class RowImpact(NamedTuple):
    """One of the successive impacts at an instant, in terms of rows of the mechanism.

    M (v+ - v-) = A^T P,  A v+ + c = -E (A v- + c); impulses of sliding rows are proportional to normal impulses.

    Attributes:
        before: v-, (nv,).
        after: v+, (nv,).
        impulses: P of all rows, (ng,), in their units.
        rows: indices of the rows A that satisfy the law, (n,): bilateral, contact and sticking rows.
        restitution: coefficients of restitution E of these rows, (n,).
        switches: indices of the switches of approaching contacts, (n,); -1 for other rows.
        sliding: tangential rows whose friction is at its limit: (row, normal row, switch).
    """

    before: Array
    after: Array
    impulses: Array
    rows: Array
    restitution: Array
    switches: Array
    sliding: tuple[tuple[int, int, int], ...]


def resolve_impact(
    point: "ModePoint", unswitched: Array, recent: set[int], resting: Collection[int] = ()
) -> tuple[Array, Impact | None]:
    """Return the point after an impact, and its record, which is None if no row approaches or becomes active.

    Args:
        point: the point.
        unswitched: indices of the rows without a switch.
        recent: indices of the switches with a recent impact. If only these contacts approach, all active contacts come
            to rest together, so that none reopens another; otherwise e = 0 for them.
        resting: indices of the switches of contacts that are brought to rest although they separate.

    Raises:
        StepError: if the impact has no solution.
    """
    problem = _ImpactProblem(point, unswitched)
    problem.stop_slow_separation(resting)
    impact = problem.solve(recent)
    if impact is None:
        return point.y, None
    y, system = point.y.copy(), point.system
    y[system.nq : system.nq + system.nv] = impact.v
    y[-1] += impact.work
    return y, problem.record(impact)


def row_impacts(point: "ModePoint", unswitched: Array, recent: set[int]) -> list[RowImpact]:
    """Return the successive impacts that `resolve_impact` finds at a point, in terms of rows; empty without one."""
    problem = _ImpactProblem(point, unswitched)
    impact = problem.solve(recent)
    return [problem.by_rows(stage) for stage in impact.stages] if impact else []


class _ImpactProblem:
    """Rows of all switches in contact, by their role in the impact; rates and rows scaled by characteristic lengths.

    Attributes:
        not_separating: contact rows that approach, rest, or are active: (index of the switch, row).
        separating: contact rows that already separate.
        frictional: tangential rows.
        approaching: switches whose contacts approach.
        bilateral: indices of the bilateral rows.
        conditional: bilateral rows of separating contacts, active only if the contact approaches: (switch, row).
        violated: bilateral rows whose rate is not zero before the impact.
    """

    def __init__(self, point: "ModePoint", unswitched: Array) -> None:
        self.point, self.switches = point, point.system.mechanism.switches
        self.scales, mode = point.system.mechanism.row_scales, point.system.mode
        self.rate, self.rest_speed = point.rate / self.scales, MODE_ROUNDING * point.speed
        found = {s.index: s.impact_rows(point, mode[s.index], SOLUTION_ROUNDING) for s in self.switches}
        self.rows_near_contact = {i: rows for i, rows in found.items() if rows}
        active = self._active_switches()
        self.not_separating = self._contacts(active)
        self.separating = self._contacts(i for i in self.rows_near_contact if i not in active)
        self.frictional = [(i, s) for i, s in self._rows(self.rows_near_contact) if s.friction >= 0]
        self.approaching = [i for i, s in self.not_separating if s.sign * self.rate[s.row] < -self.rest_speed]
        self._collect_bilateral(active, unswitched)

    def _active_switches(self) -> list[int]:
        mode, first = self.point.system.mode, {i: rows[0] for i, rows in self.rows_near_contact.items()}
        return [i for i, x in first.items() if x.sign * self.rate[x.row] <= self.rest_speed or mode[i]]

    def _rows(self, which: Iterable[int]) -> list[tuple[int, ImpactRow]]:
        return [(i, s) for i in which for s in self.rows_near_contact[i]]

    def _contacts(self, which: Iterable[int]) -> list[tuple[int, ImpactRow]]:
        return [(i, s) for i, s in self._rows(which) if s.sign]

    def _collect_bilateral(self, active: list[int], unswitched: Array) -> None:
        switched = [s.row for i, s in self._rows(active) if not self.rows_near_contact[i][0].sign]
        zero = EVALUATION_ROUNDING * self.point.speed
        self.violated = [k for k in (*unswitched, *switched) if abs(self.rate[k]) > zero]
        self.bilateral = [*unswitched, *(s.row for _, s in self._other_rows(active))]
        self.conditional = self._other_rows(i for i, _ in self.separating)

    def _other_rows(self, which: Iterable[int]) -> list[tuple[int, ImpactRow]]:
        return [(i, s) for i, s in self._rows(which) if not s.sign and np.isnan(s.friction)]

    def make_active_bilateral(self, recent: set[int]) -> None:
        """Treat active contacts without friction as bilateral: they come to rest together."""
        mode, frictional = self.point.system.mode, {i for i, _ in self.frictional}
        resting = [(i, s) for i, s in self.not_separating if (i in recent or mode[i]) and i not in frictional]
        self.bilateral += [s.row for _, s in resting]
        self.not_separating = [x for x in self.not_separating if x not in resting]

    def stop_slow_separation(self, resting: Collection[int]) -> None:
        """Bring to rest the contacts that separate so slowly that their gaps would remain below rounding."""
        rows = [s.row for i, s in (*self.separating, *self.conditional) if i in resting]
        self.bilateral, self.violated = [*self.bilateral, *rows], [*self.violated, *rows]
        self.separating = [x for x in self.separating if x[0] not in resting]
        self.conditional = [x for x in self.conditional if x[0] not in resting]
        self.frictional = [x for x in self.frictional if self.rows_near_contact[x[0]][0].row not in rows]

    @property
    def contacts(self) -> list[tuple[int, ImpactRow]]:
        """Contact rows of the complementarity problem."""
        return [*self.not_separating, *self.separating]

    def solve(self, recent: set[int]) -> ImpactSolution | None:
        """Solve the complementarity problem, with e = 0 for ``recent`` switches; None if no velocity jumps.

        Raises:
            StepError: if it has no solution.
        """
        if not self._velocities_jump(recent):
            return None
        point, contacts, bilateral = self.point, self.contacts, self._bilateral_rows()
        rows, signs = np.array([s.row for _, s in contacts], int), np.array([s.sign for _, s in contacts])
        e = np.array([0.0 if i in recent else s.restitution for i, s in contacts])
        G, g_t = point.values[1] / self.scales[:, None], point.values[2] / self.scales
        first = {i: k for k, (i, _) in reversed(list(enumerate(contacts)))}
        friction = [FrictionRow(first[i], G[s.row], float(g_t[s.row]), s.friction) for i, s in self.frictional]
        conditions = [first[i] for i, _ in self.conditional]
        U, gap_rates = point.system.inertia(point.t, point.q), (signs[:, None] * G[rows], signs * g_t[rows])
        try:
            bilateral_rows = G[bilateral], g_t[bilateral]
            return solve_impact(U, *bilateral_rows, *gap_rates, e, point.v, friction, point.speed, conditions)
        except StepError as reason:
            raise error_with_names(reason, self.switches, point.t, (i for i, _ in contacts)) from None

    def _bilateral_rows(self) -> Array:
        return np.array([*self.bilateral, *(s.row for _, s in self.conditional)], int)

    def record(self, impact: ImpactSolution) -> Impact | None:
        """Return the impulses by name; None for small projections of the velocity onto the rows of a mode."""
        engaged = [k for k in dict.fromkeys(self.violated) if abs(self.rate[k]) > VISIBLE * self.point.speed]
        if not self.approaching and not engaged:
            return None
        impulses = self._impulses(impact)
        names = self.point.system.mechanism.row_names
        named = [*self._contact_impulses(impulses), *((names[k], float(impulses[k])) for k in engaged)]
        where, impulse = zip(*named, strict=True) if named else ((), ())
        return Impact(self.point.t, tuple(where), tuple(impulse), tuple(impulses.tolist()), -impact.work)

    def _contact_impulses(self, impulses: Array) -> list[tuple[str, float]]:
        """Return the names and impulses of contacts, without impulses due to rounding."""
        first = [(self.switches[i].name, rows[0]) for i, rows in self.rows_near_contact.items() if rows[0].sign]
        rows, signs = np.array([s.row for _, s in first], int), np.array([s.sign for _, s in first])
        p = signs * impulses[rows]
        significant = self._are_significant(rows, p * self.scales[rows]).tolist()
        found = zip(first, p.tolist(), significant, strict=True)
        return [(name, x) for (name, _), x, is_significant in found if is_significant]

    def _are_significant(self, rows: Array, p: Array) -> Array:
        """Return which contact impulses (n,), scaled by characteristic lengths, are positive beyond rounding.

        An impulse is negligible relative to the largest impulse, or if it changes the rate of its row by rounding only.
        """
        system, G = self.point.system, self.point.values[1][rows] / self.scales[rows, None]
        B = mass_scaled(system.inertia(self.point.t, self.point.q), G)
        changes = p * np.square(B).sum(axis=0)
        return (changes > EVALUATION_ROUNDING * self.point.speed) & (p > MODE_ROUNDING * p.max(initial=0.0))

    def _velocities_jump(self, recent: set[int]) -> bool:
        """Return whether a velocity jumps; if only recent contacts approach, bring all active contacts to rest."""
        if self.approaching and all(i in recent for i in self.approaching):
            self.make_active_bilateral(recent)
        return bool(self.approaching or self.violated)

    def by_rows(self, stage: ImpactStage) -> RowImpact:
        """Return one of the successive impacts in terms of rows."""
        G, g_t = self.point.values[1:]
        speeds = G @ stage.before + g_t, G @ stage.after + g_t
        contacts = self._contacts_with_impulse(stage)
        normal = {i: s.row for i, s, _ in reversed(contacts)}
        tangential = [(s.row, normal[i], i) for i, s in self.frictional if i in normal]
        slip_speeds = np.abs(speeds[1]) / self.scales
        sliding = tuple(x for x in tangential if slip_speeds[x[0]] > self.rest_speed)
        sticking = [row for row, *_ in set(tangential) - set(sliding)]
        bilateral = dict.fromkeys([*self._bilateral_rows()[stage.active].tolist(), *sorted(sticking)])
        laws = [(s.row, e, i if s.sign * speeds[0][s.row] < 0 else -1) for i, s, e in contacts]
        rows, restitution, switches = np.array([*laws, *((row, 0.0, -1) for row in bilateral)]).reshape(-1, 3).T
        impulses, indices = self._impulses(stage), rows.astype(int)
        return RowImpact(stage.before, stage.after, impulses, indices, restitution, switches.astype(int), sliding)

    def _contacts_with_impulse(self, stage: ImpactStage) -> list[tuple[int, ImpactRow, float]]:
        """Return the contacts with an impulse: switch, row and coefficient of restitution."""
        significant = self._are_significant(np.array([s.row for _, s in self.contacts], int), stage.p)
        found = zip(self.contacts, stage.restitution.tolist(), significant.tolist(), strict=True)
        return [(i, s, e) for (i, s), e, is_significant in found if is_significant]

    def _impulses(self, impact: ImpactSolution | ImpactStage) -> Array:
        """Return the impulses of all rows, (ng,), in their units."""
        impulses = np.zeros(self.point.system.ng)
        impulses[[s.row for _, s in self.contacts]] = np.array([s.sign for _, s in self.contacts]) * impact.p
        impulses[self._bilateral_rows()] += impact.P
        impulses[[s.row for _, s in self.frictional]] = impact.friction
        return impulses / self.scales
