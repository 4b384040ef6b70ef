"""Local coordinates of the manifold of consistent states of a mechanism.

Let L be the coordinate scales (1 rad, characteristic lengths), G_p the independent position-level rows at q0, G all
independent rows, N, N_v orthonormal bases of the null spaces of G_p L and G L, and R one of the row space of G_p L:

    q = q0 (+) L (N xi + R mu),  g(t, q) = 0,      G v = -g_t,  N_v^T L^-1 v = eta

Every (xi, eta) close to the origin defines a state with g = 0 and G v + g_t = 0.

Source: Potra, Yen (1991), Implicit numerical integration for Euler-Lagrange equations via tangent space
parametrization, Mech. Struct. Mach. 19; Hairer, Wanner II, VII.2 (2.22) to (2.24).
"""

from typing import NamedTuple

import numpy as np

from ...arguments import number
from ...errors import StepError
from ...system import Array
from ...tolerances import CLOSED, EPS, TRUNCATION
from ..formulations.equation_partials import rate_partials
from ..formulations.index2 import Index2System

ITERATIONS = 10
HALVINGS = 12  # halvings of the increment from the last point, until Newton's iteration converges
LARGEST_STEP = 0.3  # rad or characteristic lengths: larger corrections may lead to other branches
SMALLEST_COSINE = 0.3  # between the tangent spaces at q0 and at q: beyond, Newton's iteration for mu is ill-conditioned
LARGEST_ROTATION = 2.0  # rad, of spherical, planar and free joints; J(x) is valid to 3, and solvers overshoot


class StatePartials(NamedTuple):
    """Partial derivatives of a state with respect to (x, t), (..., n + 1), and its displacement from the origin, (nv,).

    Attributes:
        displacement: displacement from the origin.
        dx: derivatives of the displacement.
        dq: derivatives of q in its tangent.
        dv: derivatives of v.
        ds: derivatives of the states of forces.
    """

    displacement: Array
    dx: Array
    dq: Array
    dv: Array
    ds: Array


class LocalCoordinates:
    """Coordinates x = (xi, eta, s) of the states near a consistent state (q, v, s).

    Args:
        system: a workspace of the mechanism, in its mode.
        t: time in s.
        y: the point (q, v, s, w), origin of the coordinates.

    Attributes:
        x0: the state in these coordinates, (n,), xi = 0.
        n: degrees of freedom in position and in velocity, and states of forces.

    Raises:
        StepError: if the constraints are singular there.
    """

    def __init__(self, system: Index2System, t: float, y: Array) -> None:
        self.system, self.mechanism = system, (m := system.mechanism)
        self.q0, nv = y[: m.nq], m.nv
        system.derivative(t, y)  # fixes the rank
        self._positional, self._scales = np.asarray(m.positional, bool), m.coordinate_scales
        G = self._scaled(system.jacobian(self.q0))
        self._across, self._N = _row_and_null_space(G[self._positional])
        self._Nv = _row_and_null_space(G)[1]
        self.sizes = self._N.shape[1], self._Nv.shape[1], system.ns
        self.n = sum(self.sizes)
        self._origin = self._last = t, np.zeros(self.sizes[0]), np.zeros(self._across.shape[1])
        speeds = self._Nv.T @ (y[m.nq : m.nq + nv] / self._scales)
        self.x0 = np.concatenate([np.zeros(self.sizes[0]), speeds, y[m.nq + nv : -1]])

    def _split(self, x: Array) -> tuple[Array, Array, Array]:
        k, m, _ = self.sizes
        return x[:k], x[k : k + m], x[k + m :]

    def _position(self, t: float, xi: Array) -> tuple[Array, Array]:
        """Return the displacement (nv,) from q0 at which g(t, q) = 0, and q (nq,), on the branch through q0.

        Newton's iteration starts from the last point; where it fails, intermediate points are computed first.

        Raises:
            StepError: beyond the range of the coordinates.
        """
        start, targets = self._last, [(t, xi)]
        while targets:
            found = self._corrected(*start, *targets[-1])
            if found is not None:
                start = (*targets.pop(), found)
            elif len(targets) > HALVINGS:
                self._last = self._origin
                raise StepError("chart", f"t = {t:.17g} is beyond the range of these local coordinates: restart them")
            else:
                targets.append((0.5 * (start[0] + targets[-1][0]), 0.5 * (start[1] + targets[-1][1])))
        self._last = start
        displacement = self._displacement(start[1], start[2])
        return displacement, self.system.manifold.integrate(self.q0, displacement)

    def _displacement(self, xi: Array, mu: Array) -> Array:
        return self._scales * (self._N @ xi + self._across @ mu)

    def _corrected(self, _t: float, _xi: Array, mu: Array, t: float, xi: Array) -> Array | None:
        """Return mu at (t, xi) by Gauss-Newton iteration to rounding, from a close point; None if it diverges."""
        system, rows, last = self.system, self._positional, np.inf
        scales, across = self.mechanism.row_scales[rows], self._scales[:, None] * self._across
        for _ in range(ITERATIONS):
            displacement = self._displacement(xi, mu)
            g, G = (a[rows] for a in system.closures(system.manifold.integrate(self.q0, displacement), t))
            size = float(np.abs(g / scales).max(initial=0.0))
            if not EPS < size < last:
                break
            last, step = size, _solve(G @ self._velocities(displacement, across), g, scales)
            if not np.abs(step).max(initial=0.0) <= LARGEST_STEP:
                return None
            mu = mu - step
        return mu if min(size, last) <= CLOSED else None

    def _scaled(self, G: Array) -> Array:
        """Return rows (ng, nv) in rad and characteristic lengths."""
        return G * self._scales / self.mechanism.row_scales[:, None]

    def _velocities(self, displacement: Array, rates: Array) -> Array:
        """Return J^-1 rates at a displacement (nv,), for columns of rates (nv, k)."""
        if not rates.size:
            return rates
        return np.column_stack([self.system.manifold.velocity(displacement, rate) for rate in rates.T])

    def _point(self, t: float, x: Array) -> tuple[Array, Array, Array]:
        """Return the displacement (nv,), and y and G there.

        Raises:
            InputError: unless t and x are finite numbers of the right shape.
        """
        t = number("t", t)
        xi, eta, s = self._split(self.mechanism.vector("x", x, self.n))
        displacement, q = self._position(t, xi)
        G = self.system.jacobian(q)
        v = self._velocity(G, np.concatenate([-self.system.g_t(t), eta]))
        return displacement, np.concatenate([q, v, s, [0.0]]), G

    def _velocity(self, G: Array, right: Array) -> Array:
        """Return v of G v = ., N_v^T L^-1 v = ., from (ng + m, ...)."""
        weights = np.concatenate([self.mechanism.row_scales, np.ones(self._Nv.shape[1])])
        return _solve(np.vstack([G, self._Nv.T / self._scales]), right, weights)

    def state(self, t: float, x: Array) -> tuple[Array, Array, Array]:
        """Return q (nq,), v (nv,) and s (ns,) of x (n,); g = 0 and G v + g_t = 0 to rounding.

        Raises:
            StepError: beyond the range of the coordinates.
        """
        m, y = self.mechanism, self._point(t, x)[1]
        return y[: m.nq], y[m.nq : m.nq + m.nv], y[m.nq + m.nv : -1]

    def margin(self, t: float, x: Array) -> float:
        """Return the margin of x within the range of the coordinates: 1 at their origin, 0 at the boundary.

        It is meant as a terminal event of a solver, with direction -1, followed by `restart`. It is the smaller of two
        measures: the cosine of the largest angle between the null spaces of G at q and at q0, and the largest rotation
        of a joint.
        """
        displacement, _, G = self._point(t, x)
        groups = self.system.manifold.group_joints
        rotations = [float(np.linalg.norm(displacement[s][angles])) for _, s, _, angles in groups]
        N = np.linalg.svd(self._scaled(G))[2][self.mechanism.nv - self._Nv.shape[1] :].T if len(G) else self._Nv
        cosine = float(np.linalg.svd(N.T @ self._Nv, compute_uv=False).min(initial=1.0))
        rotation = max(rotations, default=0.0)
        return min((cosine - SMALLEST_COSINE) / (1 - SMALLEST_COSINE), 1 - rotation / LARGEST_ROTATION)

    def partials(self, t: float, x: Array) -> StatePartials:
        """Return the exact partial derivatives of the state with respect to (x, t).

        Raises:
            StepError: beyond the range of the coordinates.
        """
        (displacement, y, _), s, m, (k, f, ns) = self._point(t, x), self.system, self.mechanism, self.sizes
        nv, rows, D = m.nv, self._positional, self._scales[:, None]
        q, v = s.split(y)
        G, B = (a.copy() for a in rate_partials(s, t, q, v, np.arange(m.ng)))
        # derivatives of x with respect to (xi, t) along the manifold; then of q in its tangent, and of v
        along, across = self._velocities(displacement, D * self._N), self._velocities(displacement, D * self._across)
        right = np.column_stack([G[rows] @ along, s.g_t(t)[rows]])
        dmu = _solve(G[rows] @ across, right, m.row_scales[rows])
        dx = np.column_stack([self._N, np.zeros(nv)]) - self._across @ dmu
        dx = D * np.insert(dx, [k] * (f + ns), 0.0, axis=1)
        dq = self._velocities(displacement, dx)
        right = np.vstack([-B @ dq, np.eye(f, self.n + 1, k)])
        right[: m.ng, -1] += s.constraints.motion(t)[2]  # -g_tt
        return StatePartials(displacement, dx, dq, self._velocity(G, right), np.eye(ns, self.n + 1, k + f))

    def coordinates_of(self, y: Array) -> Array:
        """Return x (n,) of a consistent point y = (q, v, s, w): xi = N^T (q (-) q0), eta = N_v^T v."""
        m = self.mechanism
        displacement = self.system.manifold.difference(self.q0, y[: m.nq]) / self._scales
        return np.concatenate(
            [self._N.T @ displacement, self._Nv.T @ (y[m.nq : m.nq + m.nv] / self._scales), y[m.nq + m.nv : -1]]
        )

    def coordinate_tangents(self, y: Array, dy: Array) -> Array:
        """Return the tangents (n, m) of `coordinates_of` at y for tangents dy (ny, m) of the point."""
        m, nv, manifold = self.mechanism, self.mechanism.nv, self.system.manifold
        displacement, rates = manifold.difference(self.q0, y[: m.nq]), np.zeros((nv, dy.shape[1]))
        for k, d in enumerate(dy[:nv].T):
            rates[:, k] = manifold.tangent(displacement, d)
        D = self._scales[:, None]
        return np.vstack([self._N.T @ (rates / D), self._Nv.T @ (dy[nv : 2 * nv] / D), dy[2 * nv : -1]])


def _row_and_null_space(G: Array) -> tuple[Array, Array]:
    """Return orthonormal bases of the row space (nv, r) and the null space (nv, nv - r) of scaled rows (ng, nv)."""
    if not len(G):
        return np.empty((G.shape[1], 0)), np.eye(G.shape[1])
    _, S, Vt = np.linalg.svd(G)
    r = np.count_nonzero(TRUNCATION * S[0] < S)
    return Vt[:r].T, Vt[r:].T


def _solve(A: Array, b: Array, scales: Array) -> Array:
    """Return the solution x (n, ...) of consistent equations A x = b (m, ...), m >= n, scaled by ``scales`` (m,)."""
    A, b = A / scales[:, None], (b.T / scales).T
    if A.shape[0] == A.shape[1]:
        return np.linalg.solve(A, b)
    x = np.linalg.lstsq(A, b, rcond=EPS)[0]
    return x + np.linalg.lstsq(A, b - A @ x, rcond=EPS)[0]  # refined
