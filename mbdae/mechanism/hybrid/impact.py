"""Impact at a point: detect the contacts, assemble the complementarity problem, solve it, name the impulses."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import StepError
from ...system import Array
from ...tolerances import EVALUATION_ROUNDING, MODE_ROUNDING, SOLUTION_ROUNDING, VISIBLE
from .impact_law import FrictionRow, ImpactSolution, solve_impact
from .switch import ImpactRow
from .switches import with_names

if TYPE_CHECKING:
    from .mode_point import ModePoint



class Impact(NamedTuple):
    """An impact.

    Attributes:
        t: time in s.
        where: names of the stops and closures that take part.
        impulse: of each of them in N s, or N m s for rotations.
        rows: impulses of all rows, (ng,), including those transmitted by loops.
        loss: of energy in J.
    """

    t: float
    where: tuple[str, ...]
    impulse: tuple[float, ...]
    rows: tuple[float, ...]
    loss: float


def resolve_impact(at: "ModePoint", always: Array, soft: set[int]) -> tuple[Array, Impact | None]:
    """Return the point after an impact, and its record; None if no row approaches or becomes active.

    Args:
        at: the point.
        always: indices of the rows without a switch.
        soft: switches with an impact a moment ago. If only these approach, all active contacts come to rest together,
            so that none reopens another; otherwise e = 0 for them.

    Raises:
        StepError: if the impact has no solution.
    """
    problem = _ImpactProblem(at, always)
    if not problem.approaching and not problem.violated:
        return at.y, None
    if problem.approaching and all(i in soft for i in problem.approaching):
        problem.keep_resting_rows(soft)
    impact = problem.solve(soft)
    y, system = at.y.copy(), at.system
    y[system.nq : system.nq + system.nv] = impact.v
    y[-1] += impact.work
    return y, problem.record(impact)


class _ImpactProblem:
    """Rows of all switches near contact, by their part in the impact; rates and rows in characteristic lengths.

    Attributes:
        closing: contact rows that approach, rest, or are active: (index of the switch, row).
        separating: contact rows that already separate.
        frictional: tangential rows.
        approaching: switches whose contacts approach.
        kept: indices of the bilateral rows.
        violated: those of `kept` that are not at rest before.
    """

    def __init__(self, at: "ModePoint", always: Array) -> None:
        self.at, self.switches = at, at.system.mechanism.switches
        self.scales, mode = at.system.mechanism.row_scales, at.system.mode
        self.rate, self.still = at.rate / self.scales, MODE_ROUNDING * at.speed
        near = {s.at: s.impact_rows(at, mode[s.at], SOLUTION_ROUNDING) for s in self.switches}
        self.found = {i: rows for i, rows in near.items() if rows}
        hit = self._hit()
        self.closing = self._contacts(hit)
        self.separating = self._contacts(i for i in self.found if i not in hit)
        self.frictional = [(i, s) for i, s in self._rows(self.found) if s.share >= 0]
        self.approaching = [i for i, s in self.closing if s.sign * self.rate[s.row] < -self.still]
        self._keep(hit, always)

    def _hit(self) -> list[int]:
        mode, first = self.at.system.mode, {i: rows[0] for i, rows in self.found.items()}
        return [i for i, x in first.items() if x.sign * self.rate[x.row] <= self.still or mode[i]]

    def _rows(self, which: Iterable[int]) -> list[tuple[int, ImpactRow]]:
        return [(i, s) for i in which for s in self.found[i]]

    def _contacts(self, which: Iterable[int]) -> list[tuple[int, ImpactRow]]:
        return [(i, s) for i, s in self._rows(which) if s.sign]

    def _keep(self, hit: list[int], always: Array) -> None:
        bilateral = [s.row for i, s in self._rows(hit) if not self.found[i][0].sign]
        self.violated = [k for k in (*always, *bilateral) if abs(self.rate[k]) > EVALUATION_ROUNDING * self.at.speed]
        self.kept = [*always, *(s.row for _, s in self._rows(hit) if not s.sign and np.isnan(s.share))]

    def keep_resting_rows(self, soft: set[int]) -> None:
        """Keep active contacts without friction: they come to rest together."""
        mode, with_friction = self.at.system.mode, {i for i, _ in self.frictional}
        rests = [(i, s) for i, s in self.closing if (i in soft or mode[i]) and i not in with_friction]
        self.kept += [s.row for _, s in rests]
        self.closing = [x for x in self.closing if x not in rests]

    @property
    def contacts(self) -> list[tuple[int, ImpactRow]]:
        """Contact rows of the complementarity problem."""
        return [*self.closing, *self.separating]

    def solve(self, soft: set[int]) -> ImpactSolution:
        """Solve the complementarity problem, with e = 0 for ``soft`` switches.

        Raises:
            StepError: if it has no solution.
        """
        at, contacts, kept = self.at, self.contacts, np.array(self.kept, int)
        rows, signs = np.array([s.row for _, s in contacts], int), np.array([s.sign for _, s in contacts])
        e = np.array([0.0 if i in soft else s.restitution for i, s in contacts])
        G, g_t = at.values[1] / self.scales[:, None], at.values[2] / self.scales
        first = {i: k for k, (i, _) in reversed(list(enumerate(contacts)))}
        friction = [FrictionRow(first[i], G[s.row], float(g_t[s.row]), s.share) for i, s in self.frictional]
        U, closing = np.triu(at.system.inertia(at.t, at.q)), (signs[:, None] * G[rows], signs * g_t[rows])
        try:
            return solve_impact(U, G[kept], g_t[kept], *closing, e, at.v, friction, at.speed)
        except StepError as reason:
            raise with_names(reason, self.switches, at.t, (i for i, _ in contacts)) from None

    def record(self, impact: ImpactSolution) -> Impact | None:
        """Return the impulses by name; None for small velocity projections onto the rows of a mode."""
        joined = [k for k in dict.fromkeys(self.violated) if abs(self.rate[k]) > VISIBLE * self.at.speed]
        if not self.approaching and not joined:
            return None
        whole = self._impulses(impact)
        named = [*self._pressing(whole), *((self.at.system.mechanism.row_names[k], float(whole[k])) for k in joined)]
        where, impulse = zip(*named, strict=True) if named else ((), ())
        return Impact(self.at.t, tuple(where), tuple(impulse), tuple(whole.tolist()), -impact.work)

    def _pressing(self, whole: Array) -> list[tuple[str, float]]:
        """Return names and impulses of the contacts that press."""
        first = [(self.switches[i].name, rows[0]) for i, rows in self.found.items()]
        hits = [(name, float(s.sign * whole[s.row])) for name, s in first if s.sign]
        return [(name, p) for name, p in hits if p > 0]

    def _impulses(self, impact: ImpactSolution) -> Array:
        """Return the impulses of all rows, (ng,), in their units."""
        whole = np.zeros(self.at.system.ng)
        whole[[s.row for _, s in self.contacts]] = np.array([s.sign for _, s in self.contacts]) * impact.p
        whole[np.array(self.kept, int)] += impact.P
        whole[[s.row for _, s in self.frictional]] = impact.friction
        return whole / self.scales
