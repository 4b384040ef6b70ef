"""Continuation of an equilibrium over a load factor.

With the forces f + (p - 1) f_load, p the factor on the load, rho(y, p) = 0 defines a curve with tangent tau,

    [H  -Z^T f_load] tau = 0,   predictor q (+) h Z tau_y, p + h tau_p,   corrector [H  -Z^T f_load; tau^T] x = [rho; 0]

tau_p changes sign at limit points, where the equilibrium snaps through if the load increases further. At branch points,
where a symmetric mechanism buckles, one or several eigenvalues of H change sign: those with indices between the numbers
of negative eigenvalues before and after the step, each located as a root along the path. For forces without a potential
branch points are sign changes of the determinant of the corrector's matrix, which double roots do not change.
At contacts that close or open the path has a corner, see `mbdae.studies.statics.contact_changes`.
Source: Keller, Numerical solution of bifurcation and nonlinear eigenvalue problems (1977).
"""

from collections.abc import Callable

import numpy as np

from ...errors import InputError, StepError
from ...mechanism.equilibrium.equilibrium_equations import ForceBalance, Statics
from ...mechanism.equilibrium.spectrum import CERTAIN, curvature, null_space, scale_of
from ...mechanism.flexible.linear_range import deflection_exceeds_size
from ...system import Array
from ...tolerances import EPS, ITERATION_ROUNDING, ROUNDING, SAME_STATE, SMALLEST_PART, THREE_DIGITS, VISIBLE
from ..path_location import locate
from .contact_changes import Change, ContactMode
from .path_point import CriticalPoint, PathPoint
from .trust_region import symmetric

MAX_STEP, MIN_STEP = 0.03, SMALLEST_PART  # in rad or characteristic lengths, and the range of the factor
MAX_CORRECTIONS, MAX_POINTS = 8, 5000
MIN_COSINE = 0.95  # smallest cosine between the tangents at both ends of a step
TRIAL_STEP = THREE_DIGITS  # step that determines the direction in which a margin increases
MIN_FIRST_STEP = 0.1 * MAX_STEP  # first step after a change of a contact
LOWEST_FRACTION = -2.0  # fraction of the factor range at which a diverging path ends


class Continuation:
    """Path of equilibria over u in [0, 1], the fraction of the factor's range.

    Args:
        statics: equilibrium equations of the first mode.
        mode: contacts that are closed in the first mode.
        loads: names of the scaled forces.
        first: the first factor.
        span: last minus first factor.
    """

    def __init__(self, statics: Statics, mode: ContactMode, loads: list[str], first: float, span: float) -> None:
        self.statics, self.mode, self.loads, self.first, self.span = statics, mode, loads, first, span
        self.l = statics.sizes.l

    def run(self, start: ForceBalance) -> tuple[list[PathPoint], list[CriticalPoint], bool]:
        """Trace the path from an equilibrium at u = 0; return points, critical points, and whether it reached u = 1."""
        point = self.tangent(0.0, start, None)
        points, critical, h, changes = [point], list[CriticalPoint](), MAX_STEP, 0
        while len(points) < MAX_POINTS and changes <= self.mode.max_changes:
            next_point = self.step(point, h)
            if next_point is None:
                h /= 2
                if h < MIN_STEP:
                    return points, critical, False
                continue
            beyond = next_point.u >= 1.0
            h, next_point, change = self.shorten(point, next_point, h)
            ended = beyond and change is None
            found = self.critical(point, next_point, h) if h else []
            points += [*(at for at, _ in found), next_point]
            critical += [event for _, event in found]
            diverges = next_point.u < LOWEST_FRACTION
            if ended or diverges or deflection_exceeds_size(self.statics.mech.model, next_point.balance.q):
                return points, critical, ended
            if change:
                after = self.continue_after(next_point, change.contact)
                critical.append(self._change(next_point, after, change.contact))
                if after is None:
                    break
                points.append(after)
                changes, next_point, h = (changes + 1 if not h else 1), after, MIN_FIRST_STEP
            else:
                changes = 0
            point, h = next_point, min(MAX_STEP, 1.5 * h)
        return points, critical, False

    def continue_after(self, corner: PathPoint, k: int) -> PathPoint | None:
        """Enter the mode after a change of contact k, and return its first point; None if the path ends.

        The tangent has the direction in which the margin of the contact increases from zero, by a secant.
        """
        self.mode = self.mode.after_change(k)
        self.statics = self.mode.statics(self.statics, self.loads)
        try:
            balance = self.balance(self.statics.project(corner.balance.q, corner.balance.s), corner.balance.s, corner.u)
            forward = self.tangent(corner.u, balance, corner)
        except (StepError, InputError):
            return None
        growth = []
        for start in (forward, forward._replace(dq=-forward.dq, du=-forward.du)):
            next_point = self.step(start, TRIAL_STEP)
            growth.append((self.mode.margin(k, next_point) - self.mode.margin(k, start) if next_point else 0.0, start))
        grown, start = max(growth, key=lambda item: item[0])
        return self.step(start, -TRIAL_STEP * self.mode.margin(k, start) / grown) if grown > 0 else None

    def shorten(self, point: PathPoint, next_point: PathPoint, h: float) -> tuple[float, PathPoint, Change | None]:
        """Shorten a step to the first change of a contact, or to u = 1; return the step length, point and change."""
        change = self.mode.first_change(self.locate_zero, point, next_point, h)
        if change:
            h, next_point = change.h, change.point
        if next_point.u >= 1.0:
            return *self.locate_zero(point, h, lambda p: p.u - 1.0), None
        return h, next_point, change

    def _change(self, before: PathPoint, after: PathPoint | None, k: int) -> CriticalPoint:
        """Return the point at which a contact has changed."""
        kind, name = "contact" if k in self.mode.closed else "separation", self.mode.contacts.switches[k].name
        reverses = after is not None and after.du * before.du < 0
        found = self._critical_point(kind, after or before, np.empty((0, len(self.l))))
        return found._replace(contact=name, reverses=reverses)

    def critical(self, point: PathPoint, after: PathPoint, h: float) -> list[tuple[PathPoint, CriticalPoint]]:
        """Return the critical points of a step, in order."""
        if after.du * point.du < 0:
            root = self.locate_zero(point, h, lambda p: p.du)[1]
            shape = root.dq[None] / np.linalg.norm(root.balance.free.U @ root.dq)
            return [(root, self._critical_point("limit", root, shape))]
        if point.curvature is None or after.curvature is None:
            if after.sign * point.sign > 0:
                return []
            root = self.locate_zero(point, h, lambda p: p.sign)[1]
            return [(root, self._critical_point("branch", root, root.balance.free.Z[:, :0].T))]
        return self._branches(point, after, h)

    def _branches(self, point: PathPoint, next_point: PathPoint, h: float) -> list[tuple[PathPoint, CriticalPoint]]:
        """Return the branch points of a step: roots of one or several eigenvalues."""
        a, b = point.curvature, next_point.curvature
        assert a is not None
        assert b is not None
        regular = point if a.flat <= b.flat else next_point  # an end of the step may be a branch point
        flat = min(a.flat, b.flat)
        numbers = range(*sorted((a.negative, b.negative)))
        roots = [self.locate_zero(point, h, lambda p, k=k: eigenvalue(p, k, flat)) for k in numbers]  # type: ignore[misc]
        out: list[tuple[PathPoint, CriticalPoint]] = []
        roots.sort(key=lambda root: root[0])
        while roots:
            branch_point = roots[0][1]
            m = sum(abs(other.u - branch_point.u) <= SAME_STATE for _, other in roots)
            shapes = buckling_shapes(branch_point, m, regular)
            out.append((branch_point, self._critical_point("branch", branch_point, shapes)))
            roots = roots[m:]
        return out

    def _critical_point(self, kind: str, point: PathPoint, shapes: Array) -> CriticalPoint:
        factor = float(self.first + self.span * point.u)
        return CriticalPoint(kind, factor, point.balance.q, shapes, reverses=kind == "limit")

    def balance(self, q: Array, s: Array, u: float) -> ForceBalance:
        """Return the balance at a closed configuration under a fraction of the load."""
        self.statics.factor = self.first + self.span * u
        return self.statics.point(q, s)

    def step(self, point: PathPoint, h: float) -> PathPoint | None:
        """Return the point after a step of length h; None if it fails."""
        residual = self.statics.residual
        try:
            u, manifold = point.u + h * point.du, self.statics.system.manifold
            q = self.statics.project(manifold.integrate(point.balance.q, h * point.dq), point.balance.s)
            balance = self.balance(q, point.balance.s, u)
            for _ in range(MAX_CORRECTIONS):
                size = residual(balance)
                x = self.correction(balance, point)
                q = self.statics.project(manifold.integrate(balance.q, balance.free.Z @ x[:-1]), balance.s)
                next_u = u + float(x[-1])
                corrected = self.balance(q, balance.s, next_u)
                if size <= ITERATION_ROUNDING and not residual(corrected) < 0.5 * size:
                    break
                balance, u = corrected, next_u
        except StepError:
            return None
        if residual(balance) > ITERATION_ROUNDING:
            return None
        if len(balance.s):  # of integrators
            balance = self.balance(balance.q, balance.s, u)
        found = self.tangent(u, balance, point)
        before, after = (np.append(p.dq / self.l, p.du) for p in (point, found))
        return found if before @ after >= MIN_COSINE * np.linalg.norm(before) * np.linalg.norm(after) else None

    def rows(self, balance: ForceBalance) -> tuple[Array, Array]:
        """Return [H  -Z^T f_load] (k, k + 1) with scaled rows for unknowns (d y, u), and scales (d, 1), (k + 1,)."""
        d = np.append(scale_of(balance.noise), 1.0)
        return np.column_stack([balance.H, -self.span * (balance.free.Z.T @ balance.load)]) / np.outer(d[:-1], d), d

    def tangent_map(self, balance: ForceBalance, d: Array) -> Array:
        """Return the map from (d y, u) to (dq / l, u), (nv + 1, k + 1)."""
        Z = balance.free.Z / self.l[:, None]
        return np.block([[Z, np.zeros((len(Z), 1))], [np.zeros(Z.shape[1]), np.ones(1)]]) / d

    def correction(self, balance: ForceBalance, point: PathPoint) -> Array:
        """Return the correction (y, u) that balances forces, orthogonal to the tangent of the previous point."""
        rows, d = self.rows(balance)
        along = np.append(point.dq / self.l, point.du) @ self.tangent_map(balance, d)
        size = np.linalg.norm(rows[:, -1]) or 1.0
        columns = np.append(np.ones(len(rows)), 1 / size)
        A = np.vstack([rows, along / np.linalg.norm(along * columns)]) * columns
        x = np.linalg.lstsq(A, np.append(balance.rho / d[:-1], 0.0), rcond=CERTAIN * EPS)[0]
        return x * columns / d

    def tangent(self, u: float, balance: ForceBalance, before: PathPoint | None) -> PathPoint:
        """Return the unit tangent at a point of the path, in the direction of the previous tangent.

        It has no component along motions without stiffness.

        Raises:
            InputError: if the first equilibrium does not move with the load.
        """
        rows, d = self.rows(balance)
        load_noise = EPS * abs(self.span) * self.statics.term_sizes(balance)
        null = null_space(rows, np.column_stack([balance.noise, load_noise]) / np.outer(d[:-1], d)).vectors
        Q, R = np.linalg.qr(self.tangent_map(balance, d) @ null)
        direction = np.eye(len(Q))[-1] if before is None else np.append(before.dq / self.l, before.du)
        c = Q.T @ direction
        if before is None and np.linalg.norm(c) < VISIBLE:
            problem = f"the equilibrium at factor {self.first:g} is neutral or a limit point"
            raise InputError(f"{problem}: no unique path starts there; begin at another factor")
        if len(c) == 1 and abs(c[0]) < ROUNDING:  # perpendicular to the previous tangent, at a corner
            c = np.ones(1)
        tau = Q @ c / np.abs(Q @ c).max()
        x = null @ np.linalg.solve(R, c)
        x /= np.linalg.norm(x)
        basis = np.linalg.qr(null)[0].T
        neutral = np.linalg.svd(basis - np.outer(basis @ x, x))[2][: len(basis) - 1]
        sign = float(np.linalg.slogdet(np.vstack([rows + neutral[:, :-1].T @ neutral, x]))[0])
        found = curvature(balance.H, balance.noise) if symmetric(balance.H, balance.noise) else None
        return PathPoint(u, balance, tau[:-1] * self.l, float(tau[-1]), found, sign)

    def locate_zero(self, point: PathPoint, h: float, value: Callable[[PathPoint], float]) -> tuple[float, PathPoint]:
        """Return the step length at a sign change of a value, and the point."""
        return locate(self.step, point, h, value, "equilibria")


def eigenvalue(p: PathPoint, k: int, flat: int) -> float:
    """Return eigenvalue k of H, not counting eigenvalues that are always zero; 0 if it is zero to rounding.

    Args:
        p: a point of a path.
        k: index of the eigenvalue, in ascending order.
        flat: number of eigenvalues that are zero along the path.
    """
    found = p.curvature
    if found is None or found.negative <= k < found.negative + found.flat - flat:
        return 0.0
    return float(found.values[k if k < found.negative else k + found.flat])


def buckling_shapes(point: PathPoint, m: int, before: PathPoint) -> Array:
    """Return m M-orthonormal motions without stiffness, which have stiffness at the previous point, (m, nv)."""
    assert point.curvature is not None
    assert before.curvature is not None
    U, flat = point.balance.free.U, before.curvature.flat
    cluster = np.abs(point.curvature.values).argsort()[: m + flat]
    shapes = U @ point.balance.free.Z @ np.linalg.qr(point.curvature.vectors[:, cluster])[0]
    if flat:
        free = np.linalg.qr(U @ before.balance.free.Z @ before.curvature.vectors[:, before.curvature.signs == 0])[0]
        shapes = np.linalg.svd(shapes - free @ (free.T @ shapes), full_matrices=False)[0][:, :m]
    return np.linalg.solve(U, shapes).T
