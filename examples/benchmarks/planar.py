"""Planar mechanisms as data, and their equations written by hand.

A planar mechanism is a tree of bars on hinges, and pins that close loops. Points are complex numbers: with the absolute
angle of bar j in q_j, every point is z = z_0 + sum_j a_j e_j(q_j), e_j = exp(i q_j), so that the equations of motion
are a few products of constant matrices with e, e' and e''. A bar whose hinge is cut has two more coordinates x and y
(e_j = q_j, a = 1 and i), and its hinge becomes a constraint. SI units, angles in rad, gravity along -y.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

import mbdae

Array = np.ndarray


@dataclass(frozen=True)
class Bar:
    """A body on a hinge; points in the body's axes, from its hinge."""

    name: str
    parent: str | None
    hinge: complex  # in the axes of the parent
    com: complex
    mass: float
    inertia: float  # about the centre of mass
    start: float  # angle relative to the parent


@dataclass(frozen=True)
class Problem:
    """A planar mechanism at rest, its applied forces, and its reference solution.

    Args:
        title: its name.
        end: time in s.
        model: makes a mechanism of mbdae whose joints have the names of the bars.
        bars: parents first.
        pins: loops: bar, point on it, bar, point on it.
        gravity: in m/s^2.
        torque: on the first bar, in N m.
        spring: bar, point on it, point of the ground, stiffness, rest length.
        reference: returns the angles relative to the parents at the end, in the order of the bars.
    """

    title: str
    end: float
    model: Callable[[], mbdae.Mechanism]
    bars: tuple[Bar, ...]
    reference: Callable[[], Array]
    pins: tuple[tuple[str, complex, str, complex], ...] = ()
    gravity: float = 9.81
    torque: float = 0.0
    spring: tuple[str, complex, complex, float, float] | None = None

    @property
    def names(self) -> list[str]:
        """Names of the bars."""
        return [b.name for b in self.bars]

    def absolute(self, q: Array) -> Array:
        """Absolute angles (..., n) from angles relative to the parents (..., n)."""
        out = np.array(q, float)
        for i, b in enumerate(self.bars):
            if b.parent:
                out[..., i] += out[..., self.names.index(b.parent)]
        return out

    def relative(self, theta: Array) -> Array:
        """Angles relative to the parents from absolute ones."""
        out = np.array(theta, float)
        for i, b in enumerate(self.bars):
            if b.parent:
                out[..., i] -= theta[..., self.names.index(b.parent)]
        return out

    def start(self) -> Array:
        """Angles relative to the parents at the start."""
        return np.array([b.start for b in self.bars])

    def gap(self, theta: Array) -> float:
        """Largest |g| in m over absolute angles, one row for each time."""
        if not self.pins:
            return 0.0
        eq = Equations(self)
        return float(np.abs(eq.B @ eq.e(theta.T)[0] + eq.B0).max())


@dataclass
class Equations:
    """M(q) v' = f(q, v) + G(q)^T lam, 0 = g(q), for columns of q, v and v'; g, lam are complex, one for each pin.

    Args:
        problem: the mechanism.
        cut: names of bars whose hinges are constraints.
    """

    problem: Problem
    cut: tuple[str, ...] = ()
    C: Array = field(init=False)

    def __post_init__(self) -> None:
        p, names = self.problem, self.problem.names
        self.n = len(names) + 2 * len(self.cut)
        self.angle = np.arange(self.n)[:, None] < len(names)
        self.m = np.array([b.mass for b in p.bars])
        self.inertia = np.zeros((self.n, 1))
        self.inertia[: len(names), 0] = [b.inertia for b in p.bars]
        points = [self.point(b.name, b.com) for b in p.bars]
        A = np.array([row for row, _ in points])
        self.C = A.conj().T @ (self.m[:, None] * A)
        self.weight = (A.conj().T @ (-1j * p.gravity * self.m))[:, None]
        loops = [(self.point(a, at_a), self.point(b, at_b)) for a, at_a, b, at_b in p.pins]
        for name in self.cut:
            b = p.bars[names.index(name)]
            loops.append((self.point(b.parent, b.hinge), self.point(name, 0j)))
        self.B = np.array([a[0] - b[0] for a, b in loops]).reshape(len(loops), self.n)
        self.B0 = np.array([[a[1] - b[1]] for a, b in loops]).reshape(len(loops), 1)
        self.nc = len(loops)
        if p.spring:
            self.spring, self.anchor = self.point(p.spring[0], p.spring[1]), p.spring[2]

    def point(self, name: str | None, at: complex) -> tuple[Array, complex]:
        """Coefficients a (n,) and the constant z_0 of a point of a bar."""
        if name is None:
            return np.zeros(self.n, complex), at
        p = self.problem
        i = p.names.index(name)
        if name in self.cut:
            row, const = np.zeros(self.n, complex), 0j
            k = len(p.names) + 2 * self.cut.index(name)
            row[k : k + 2] = 1, 1j
        else:
            row, const = self.point(p.bars[i].parent, p.bars[i].hinge)
        row[i] += at
        return row, const

    def e(self, q: Array) -> tuple[Array, Array, Array]:
        """Return e, e' and e'' for columns of q."""
        if self.n == len(self.problem.bars):
            w = np.exp(1j * q)
            return w, 1j * w, -w
        w = np.exp(1j * q)
        return np.where(self.angle, w, q), np.where(self.angle, 1j * w, 1), np.where(self.angle, -w, 0)

    def force(self, e: Array, de: Array) -> Array:
        """Generalized forces of gravity, spring and torque, (n, k)."""
        p = self.problem
        f = (de.conj() * self.weight).real
        if p.spring:
            row, const = self.spring
            d = self.anchor - row @ e - const
            length = np.abs(d)
            f += (de.conj() * row.conj()[:, None] * (p.spring[3] * (1 - p.spring[4] / length) * d)).real
        f[0] += p.torque
        return f

    def acceleration(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return v' (n,) and lam (2 nc,), real parts first, from the hidden constraint; q and v of length n."""
        e, de, dde = self.e(q[:, None])
        M = (de.conj() * self.C * de.T).real + np.diag(self.inertia[:, 0])
        J = self.B * de.T
        G = np.vstack([J.real, J.imag])
        bent = dde[:, 0] * v * v
        rhs = self.force(e, de)[:, 0] - (de[:, 0].conj() * (self.C @ bent)).real
        hidden = -(self.B @ bent)
        K = np.zeros((self.n + 2 * self.nc, self.n + 2 * self.nc))
        K[: self.n, : self.n], K[: self.n, self.n :], K[self.n :, : self.n] = M, -G.T, G
        x = np.linalg.solve(K, np.concatenate([rhs, hidden.real, hidden.imag]))
        return x[: self.n], x[self.n :]

    def ggl(self, t: float, y: Array, yp: Array) -> Array:
        """Residual F(t, y, y') for y = (q, v, integrals of mu and lam), vectorized over columns.

        0 = q' - v - G^T mu,  0 = M v' - f - G^T lam,  0 = g,  0 = G v  (Gear, Gupta, Leimkuhler 1985)
        """
        flat = y.ndim == yp.ndim == 1
        y, yp = np.broadcast_arrays(*(x[:, None] if x.ndim == 1 else x for x in (y, yp)))
        n, nc = self.n, self.nc
        q, v, vdot = y[:n], y[n : 2 * n], yp[n : 2 * n]
        mu, lam = (yp[i : i + nc] + 1j * yp[i + nc : i + 2 * nc] for i in (2 * n, 2 * n + 2 * nc))
        e, de, dde = self.e(q)
        bar, BH = de.conj(), self.B.conj().T
        inertial = (bar * (self.C @ (de * vdot + dde * v * v))).real + self.inertia * vdot
        g, rate = self.B @ e + self.B0, self.B @ (de * v)
        rows = (
            yp[:n] - v - (bar * (BH @ mu)).real, inertial - self.force(e, de) - (bar * (BH @ lam)).real,
            g.real, g.imag, rate.real, rate.imag,
        )  # fmt: skip
        out = np.concatenate(rows)
        return out[:, 0] if flat else out

    def ggl_partials(self, t: float, y: Array, yp: Array) -> tuple[Array, Array]:
        """Return dF/dy and dF/dy' of `ggl`, square matrices of size 2 n + 4 nc."""
        n, nc = self.n, self.nc
        q, v, vdot = y[:n, None], y[n : 2 * n, None], yp[n : 2 * n, None]
        mu, lam = (yp[i : i + nc] + 1j * yp[i + nc : i + 2 * nc] for i in (2 * n, 2 * n + 2 * nc))
        _, de, dde = self.e(q)
        bar, bend, C, BH = de.conj(), dde.conj()[:, 0], self.C, self.B.conj().T
        J, bent = self.B * de.T, self.B * (dde * v).T
        G, H = np.vstack([J.real, J.imag]), np.vstack([bent.real, bent.imag])
        dF, dFp = np.zeros((2, 2 * n + 4 * nc, 2 * n + 4 * nc))
        x, w, m, z = slice(0, n), slice(n, 2 * n), slice(2 * n, 2 * n + 2 * nc), slice(2 * n + 2 * nc, None)
        ddde = np.where(self.angle, -de, 0)
        own = (C @ (de * vdot + dde * v * v) - self.weight)[:, 0] - BH @ lam
        dF[x, x], dF[x, w] = -np.diag((bend * (BH @ mu)).real), -np.eye(n)
        dF[w, x] = (bar * C * (dde * vdot + ddde * v * v).T).real + np.diag((bend * own).real) - self._stiffness(q)
        dF[w, w] = 2 * (bar * C * (dde * v).T).real
        dF[m, x], dF[z, x], dF[z, w] = G, H, G
        dFp[x, x], dFp[x, m] = np.eye(n), -G.T
        dFp[w, w], dFp[w, z] = (bar * C * de.T).real + np.diag(self.inertia[:, 0]), -G.T
        return dF, dFp

    def _stiffness(self, q: Array) -> Array:
        """Derivative (n, n) of the spring's generalized force."""
        if not self.problem.spring:
            return np.zeros((self.n, self.n))
        (row, const), (*_, stiffness, rest) = self.spring, self.problem.spring
        e, de, dde = (x[:, 0] for x in self.e(q))
        d = self.anchor - row @ e - const
        tension, move = 1 - rest / abs(d), -row * de
        change = stiffness * (tension * move + rest / abs(d) ** 3 * (d.conjugate() * move).real * d)
        return np.outer((row * de).conj(), change).real + np.diag(((row * dde).conj() * stiffness * tension * d).real)
