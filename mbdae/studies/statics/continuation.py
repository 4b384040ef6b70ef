"""The continuation of an equilibrium over a factor on a load.

With the forces f + (p - 1) f_load, p the factor on the load, rho(y, p) = 0 is a curve of tangent tau,

    [H  -Z^T f_load] tau = 0,   predictor q (+) h Z tau_y, p + h tau_p,   corrector [H  -Z^T f_load; tau^T] x = [rho; 0]

tau_p changes sign at limit points, where the equilibrium snaps through if the load goes on; the determinant of the
corrector's matrix changes sign at branch points, where a symmetric mechanism buckles.
Source: Keller, Numerical solution of bifurcation and nonlinear eigenvalue problems (1977).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, MbdaeError, StepError
from ...mechanism.formulations.balance import Balance, Statics
from ...system import Array

LARGEST, LEAST = 0.03, 1e-7  # of a step: rad or m of every coordinate, and of the range of the factor
ROUNDED = 1e-11  # of the largest force: balanced
CORRECTIONS, POINTS, LOCATED = 8, 5000, 40
TURNED = 0.95  # cosine of the largest angle between tangents of neighbours
FLAT = 1e-9  # of the largest singular value of [H  -Z^T f_load]: a motion without force
NOTHING = 1e-13  # of the largest singular value of the corrector's matrix
STILL = 1e-6  # of a tangent: the factor does not change along it
BACK = -2.0  # ranges of the factor: where a path that runs away ends


class CriticalPoint(NamedTuple):
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


class PathPoint(NamedTuple):
    """A point of a path: the factor's share of its range, the balance, the tangent, and the determinant's sign."""

    u: float
    here: Balance
    dq: Array
    du: float
    sign: float


class Continuation:
    """Follows a path: u in [0, 1] is the factor's share of its range."""

    def __init__(self, statics: Statics, first: float, range: float) -> None:
        self.statics, self.first, self.range = statics, first, range
        self.scale = 0.0

    def run(self, start: Balance) -> tuple[list[PathPoint], list[CriticalPoint], bool]:
        """Follow the path from an equilibrium at u = 0; say whether it came to u = 1."""
        here = self.tangent(0.0, start, None)
        points, critical, h = [here], list[CriticalPoint](), LARGEST
        while len(points) < POINTS:
            there = self.step(here, h)
            if there is None:
                h /= 2
                if h < LEAST:
                    return points, critical, False
                continue
            if there.u >= 1.0:
                end = self.located(here, h, lambda p: p.u - 1.0)
                return [*points, end], critical, True
            if there.du * here.du < 0:
                points.append(self.located(here, h, lambda p: p.du))
                critical.append(self.critical("limit", points[-1]))
            elif there.sign * here.sign < 0:
                points.append(self.located(here, h, lambda p: p.sign))
                critical.append(self.critical("branch", points[-1]))
            here, h = there, min(LARGEST, 1.5 * h)
            points.append(here)
            if here.u < BACK:
                break
        return points, critical, False

    def critical(self, kind: str, at: PathPoint) -> CriticalPoint:
        """A critical point of the path."""
        return CriticalPoint(kind, float(self.first + self.range * at.u), at.here.q)

    def balance(self, q: Array, s: Array, u: float) -> Balance:
        """The balance at a closed configuration under a share of the load."""
        self.statics.factor = self.first + self.range * u
        here = self.statics.point(q, s)
        stiff = np.abs(here.H).max(initial=0.0) / np.abs(here.free.Z).max(initial=1e-300)  # times 1 rad or m
        self.scale = max(self.scale, here.size, float(stiff))
        return here

    def step(self, at: PathPoint, h: float) -> PathPoint | None:
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

    def correction(self, here: Balance, at: PathPoint, rho: Array) -> Array:
        """The change (y, u) that balances forces across the tangent of another point."""
        rows = np.column_stack([here.H, -self.range * (here.free.Z.T @ here.load)])
        along = np.append(here.free.Z.T @ self.metric(here, at.dq), at.du)
        return np.linalg.lstsq(np.vstack([rows, along]), np.append(rho, 0.0), rcond=NOTHING)[0]

    def metric(self, here: Balance, dq: Array) -> Array:
        """M dq, (nv,)."""
        return here.free.U.T @ (here.free.U @ dq)

    def tangent(self, u: float, here: Balance, before: PathPoint | None) -> PathPoint:
        """The unit tangent at a point of the path, in the direction of the point before it.

        Motions against which there is no force are no part of it.

        Raises:
            InputError: where the first equilibrium does not move with the load.
        """
        rows = np.column_stack([here.H, -self.range * (here.free.Z.T @ here.load)])
        sizes, right = np.linalg.svd(rows)[1:]
        null = right[int((sizes > FLAT * sizes.max()).sum()) :]
        onward = np.eye(len(right))[-1]
        if before is not None:
            onward = np.append(here.free.Z.T @ self.metric(here, before.dq), before.du)
        x = null.T @ (null @ onward)
        if before is None and np.linalg.norm(x) < STILL:
            at = f"at factor {self.first:g} forces let it rest anywhere or turn back"
            raise InputError(f"{at}: no path leads on from there; begin at another factor")
        x /= np.linalg.norm(x)
        neutral = np.linalg.svd(null - np.outer(null @ x, x))[2][: len(null) - 1]
        sign = float(np.linalg.slogdet(np.vstack([rows + neutral[:, :-1].T @ neutral, x]))[0])
        dq = here.free.Z @ x[:-1]
        size = max(float(np.abs(dq).max()), abs(x[-1]))
        return PathPoint(u, here, dq / size, x[-1] / size, sign)

    def located(self, at: PathPoint, h: float, value: Callable[[PathPoint], float]) -> PathPoint:
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
