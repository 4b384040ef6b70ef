"""Equilibria over a load that grows slowly: load-deflection curves through limit points, by continuation.

With the forces f + (p - 1) f_load, p the factor on the load, rho(y, p) = 0 is a curve of tangent tau,

    [H  -Z^T f_load] tau = 0,   predictor q (+) h Z tau_y, p + h tau_p,   corrector [H  -Z^T f_load; tau^T] x = [rho; 0]

tau_p changes sign at limit points, where the equilibrium snaps through if the load goes on; the determinant of the
corrector's matrix changes sign at branch points, where a symmetric mechanism buckles.
Source: Keller, Numerical solution of bifurcation and nonlinear eigenvalue problems (1977).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...errors import InputError, MbdaeError, StepError, UnknownNameError, require
from ...mechanism import Mechanism
from ...mechanism.formulations.balance import Balance, Statics
from ...solution.columns import coordinates, units
from ...solution.solution import Solution
from ...system import Array
from .equilibrium import balanced, settle_arguments
from .search import FLAT, symmetric

if TYPE_CHECKING:
    from ...mechanism.mechanism import Coordinates

__all__ = ["load_path"]

LARGEST, LEAST = 0.03, 1e-7  # of a step: rad or m of every coordinate, and of the range of the factor
ROUNDED = 1e-11  # of the largest force: balanced
CORRECTIONS, POINTS, LOCATED = 8, 5000, 40
TURNED = 0.95  # cosine of the largest angle between tangents of neighbours
BACK = -2.0  # ranges of the factor: where a path that runs away ends


class Event(NamedTuple):
    """A limit point or a branch point on a path.

    Attributes:
        kind: ``"limit"``: the load can be no larger nearby; ``"branch"``: paths cross.
        factor: on the load.
        q: configuration, (nq,).
    """

    kind: str
    factor: float
    q: Array

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {"kind": self.kind, "factor": self.factor, "q": self.q.tolist()}


class _At(NamedTuple):
    """A point of a path: the factor's share of its range, the balance, the tangent, and the determinant's sign."""

    u: float
    here: Balance
    dq: Array
    du: float
    sign: float


@dataclass(frozen=True)
class LoadPath:
    """Result of `load_path`.

    Attributes:
        mechanism: the mechanism.
        load: name of the force that is scaled.
        factor: on the load, (n,), along the path.
        q: configurations, (n, nq).
        unstable: number of negative eigenvalues of the stiffness, (n,).
        events: limit points and branch points.
        complete: the path came to the end of the range.
    """

    mechanism: Mechanism
    load: str
    factor: Array
    q: Array
    unstable: Array
    events: tuple[Event, ...]
    complete: bool

    @property
    def coordinates(self) -> dict[str, Array]:
        """The configurations by names ``q.<joint>``, (n,) each, see `mbdae.Solution.signals`."""
        n, mech = len(self.q), self.mechanism
        rest = np.zeros((n, mech.nv + len(mech.states) + 1))
        y = np.hstack([self.q, rest])
        lam = np.full((n, mech.ng), np.nan)
        found = coordinates(Solution(mech, np.arange(n, dtype=float), y, lam, "finished", "", {}, {}))
        return {name: x for name, x in found.items() if name.startswith("q.")}

    @property
    def moving(self) -> str:
        """The coordinate that moves the most."""
        return max(self.coordinates.items(), key=lambda item: float(np.ptp(item[1])))[0]

    def plot(self, path: str | Path, coordinate: str | None = None) -> None:
        """Draw the load over a coordinate, the one that moves the most when left out, as .png, .svg or .pdf.

        Raises:
            UnknownNameError: for a coordinate that does not exist.
            InputError: for another format, or an unwritable path.
        """
        from .. import figures
        from .figure import load_deflection

        figures.check(path)
        figures.save(load_deflection(self, coordinate), path)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "title": self.mechanism.title,
            "load": self.load,
            "complete": self.complete,
            "factor": self.factor.tolist(),
            "coordinates": {name: x.tolist() for name, x in self.coordinates.items()},
            "unstable": self.unstable.tolist(),
            "events": [e.to_dict() for e in self.events],
        }

    def __str__(self) -> str:
        name, values = self.moving, self.coordinates[self.moving]
        unit = units(self.mechanism).get(name, "")
        lines = [
            f"path of {self.mechanism.title} under {self.load}: {len(self.factor)} equilibria, "
            f"factor {self.factor[0]:.6g} to {self.factor[-1]:.6g}, {name} {values[0]:.6g} to {values[-1]:.6g} {unit}"
        ]
        said = {"limit": "limit point: it snaps", "branch": "branch point: it buckles"}
        lines += [f"  {said[e.kind]} at factor {e.factor:.12g}" for e in self.events]
        share = float((self.unstable > 0).mean())
        lines.append(f"  {100 * share:.0f} % of the equilibria are unstable")
        return "\n".join(lines if self.complete else [*lines, "  the path did not come to the end of the range"])


def load_path(
    mech: Mechanism,
    load: str,
    span: Sequence[float] = (0.0, 1.0),
    q: "Coordinates | Array | None" = None,
    *,
    t: float = 0.0,
    v: "Coordinates | Array | None" = None,
    hold: str | Iterable[str] = (),
) -> LoadPath:
    """Follow an equilibrium while a force is scaled from one factor to another.

    Args:
        mech: the mechanism.
        load: name of a force without states, or ``"gravity"``.
        span: the first and the last factor on it.
        q: where the search for the first equilibrium starts, see `mbdae.equilibrium`; so t, v and hold.
        t: time in s.
        v: constant speeds.
        hold: joints that are held.

    Returns:
        The path, also where it leads back through limit points.

    Raises:
        EquilibriumError: where there is no equilibrium at the first factor.
        UnknownNameError: for a force that does not exist.
        InputError: for a span that is none, or a mechanism without freedom.
    """
    require(mech, Mechanism, "load_path takes a Mechanism (see mbdae.load)")
    first, last = (float(x) for x in span)
    if not np.isfinite([first, last]).all() or first == last:
        raise InputError(f"a path leads from one factor to another, got {first:g} to {last:g}")
    q0, speeds, held, _ = settle_arguments(mech, q, t, v, hold)
    follow = _Follow(Statics(mech, t, speeds, held, [load]), first, last - first)
    if follow.statics.loads.names == [] and load != "gravity":
        raise UnknownNameError("force", load, [f.name for f in mech.forces])
    follow.statics.factor = first
    start = balanced(follow.statics, q0, "stable")[0]
    if not len(start.rho):
        raise InputError(f"{mech.title!r} has no freedom left: nothing moves with the load")
    points, events, complete = follow.run(start)
    bad = [int((w < -FLAT * np.abs(w).max()).sum()) for w in (symmetric(p.here.H)[0] for p in points)]
    factor = np.array([first + (last - first) * p.u for p in points])
    return LoadPath(mech, load, factor, np.array([p.here.q for p in points]), np.array(bad), tuple(events), complete)


class _Follow:
    """Follows a path: u in [0, 1] is the factor's share of its range."""

    def __init__(self, statics: Statics, first: float, range: float) -> None:
        self.statics, self.first, self.range = statics, first, range
        self.scale = 0.0

    def run(self, start: Balance) -> tuple[list[_At], list[Event], bool]:
        here = self.tangent(0.0, start, None)
        points, events, h = [here], list[Event](), LARGEST
        while len(points) < POINTS:
            there = self.step(here, h)
            if there is None:
                h /= 2
                if h < LEAST:
                    return points, events, False
                continue
            if there.u >= 1.0:
                end = self.located(here, h, lambda p: p.u - 1.0)
                return [*points, end], events, True
            if there.du * here.du < 0:
                points.append(self.located(here, h, lambda p: p.du))
                events.append(self.event("limit", points[-1]))
            elif there.sign * here.sign < 0:
                points.append(self.located(here, h, lambda p: p.sign))
                events.append(self.event("branch", points[-1]))
            here, h = there, min(LARGEST, 1.5 * h)
            points.append(here)
            if here.u < BACK:
                break
        return points, events, False

    def event(self, kind: str, at: _At) -> Event:
        return Event(kind, float(self.first + self.range * at.u), at.here.q)

    def balance(self, q: Array, s: Array, u: float) -> Balance:
        self.statics.factor = self.first + self.range * u
        here = self.statics.point(q, s)
        self.scale = max(self.scale, here.size)
        return here

    def step(self, at: _At, h: float) -> _At | None:
        """A step of the given length; None where it cannot be taken."""
        try:
            u, manifold = at.u + h * at.du, self.statics.system.manifold
            q = self.statics.close(manifold.integrate(at.here.q, h * at.dq), at.here.s)
            here = self.balance(q, at.here.s, u)
            for _ in range(CORRECTIONS):
                size = np.linalg.norm(here.rho)
                x = self.correction(here, at, here.rho)
                q = self.statics.close(manifold.integrate(here.q, here.free.Z @ x[:-1]), here.s)
                next_u = u + x[-1]
                there = self.balance(q, here.s, next_u)
                if size <= ROUNDED * self.scale and not np.linalg.norm(there.rho) < 0.5 * size:
                    break
                here, u = there, next_u
        except StepError:
            return None
        if np.linalg.norm(here.rho) > ROUNDED * self.scale:
            return None
        found = self.tangent(u, self.balance(here.q, here.s, u), at)
        before, after = (np.append(p.dq, p.du) for p in (at, found))
        return found if before @ after >= TURNED * np.linalg.norm(before) * np.linalg.norm(after) else None

    def correction(self, here: Balance, at: _At, rho: Array) -> Array:
        rows = np.column_stack([here.H, -self.range * (here.free.Z.T @ here.load)])
        along = np.append(here.free.Z.T @ self.metric(here, at.dq), at.du)
        return np.linalg.solve(np.vstack([rows, along]), np.append(rho, 0.0))

    def metric(self, here: Balance, dq: Array) -> Array:
        return here.free.U.T @ (here.free.U @ dq)

    def tangent(self, u: float, here: Balance, before: _At | None) -> _At:
        """The unit tangent at a point of the path, in the direction of the point before it."""
        rows = np.column_stack([here.H, -self.range * (here.free.Z.T @ here.load)])
        x = np.linalg.svd(rows)[2][-1]
        along = x[-1] if before is None else x[:-1] @ (here.free.Z.T @ self.metric(here, before.dq)) + x[-1] * before.du
        x = x if along >= 0 else -x
        sign = float(np.linalg.slogdet(np.vstack([rows, x]))[0])
        dq = here.free.Z @ x[:-1]
        size = max(float(np.abs(dq).max()), abs(x[-1]))
        return _At(u, here, dq / size, x[-1] / size, sign)

    def located(self, at: _At, h: float, value: Any) -> _At:
        """The point of a step where a value changes its sign, by bisection and the rule of false position."""
        low, high = 0.0, h
        here, end = at, self.step(at, h)
        if end is None:
            raise MbdaeError("a point of a path of equilibria cannot be located")
        a, b = value(at), value(end)
        best = end
        for k in range(LOCATED):
            middle = (low + high) / 2 if k % 3 == 2 or abs(a) == abs(b) == 1.0 else high - b * (high - low) / (b - a)
            found = self.step(here, middle) if low < middle < high else None
            if found is None:
                break
            c, best = value(found), found
            if c == 0:
                break
            low, high, a, b = (middle, high, c, b) if c * a > 0 else (low, middle, a, c)
        return best
