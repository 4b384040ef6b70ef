"""Stages of a step of a textbook problem, explicit and implicit."""

from typing import Any, NamedTuple, Protocol

import numpy as np

from ..linear_solve import factorized, least_squares
from ..system import Array, Counts, Solver
from ..tolerances import EPS


class ProblemFunctions(Protocol):
    """The functions of a textbook problem and their partial derivatives, with counts of their evaluations."""

    counts: Counts

    def derivative(self, t: float, y: Array) -> tuple[Array, Array]:
        """Return y' (ny,) and z (nz,) from the hidden constraint."""

    def f(self, t: float, y: Array, z: Array) -> Array:
        """Return f (ny,)."""

    def g(self, t: float, y: Array) -> Array:
        """Return g (nz,)."""

    def f_y(self, t: float, y: Array, z: Array) -> Array:
        """Return the partial derivatives of f with respect to y (ny, ny)."""

    def f_z(self, t: float, y: Array, z: Array) -> Array:
        """Return the partial derivatives of f with respect to z (ny, nz)."""

    def g_y(self, t: float, y: Array) -> Array:
        """Return the partial derivatives of g with respect to y (nz, ny)."""

    def store_z(self, y: Array, z: Array) -> None:
        """Store z at y, as the starting value of Newton's method close to y."""

    def solve(self, *stage: Any) -> Array:
        """Solve 0 = residual(f(t, y, z)) for z (nz,) by Newton's method; arguments: `HessenbergSystem.solve`."""


class HessenbergChart:
    """Explicit and implicit stages of a step of a textbook problem; coordinates are x = y - y_n, and E is the identity.

    Args:
        system: the problem.
        t: start of the step.
        y: state at t, (ny,).
        z: initial z of Newton's method, (nz,).
    """

    unknowns = ()

    def __init__(self, system: ProblemFunctions, t: float, y: Array, z: Array) -> None:
        self.system, self.t, self.y, self.z = system, t, y, z

    def first(self, carry: tuple[Array, Array]) -> tuple[Array, Array]:
        """Return the carried (y', z)."""
        self.z = carry[1]
        return carry

    def stage(self, t: float, x: Array, t_hat: float, xhat: Array, factor: float) -> tuple[Array, Array]:
        """Return (y', z) with g(t_hat, y_n + xhat + factor y') = 0, by Newton's method from the last z."""
        s, y, base = self.system, self.y + x, self.y + xhat

        def constraint(F: Array) -> Array:
            return s.g(t_hat, base + factor * F)

        z = s.solve(t, y, constraint, lambda F: s.g_y(t_hat, base + factor * F), factor, self.z)
        self.z, self.last = z, (t, y, z)
        return s.f(t, y, z), z

    def point(self, x: Array) -> Array:
        """Return y_n + x, (ny,), and store z at this point."""
        y = self.y + x
        self.system.store_z(y, self.z)
        return y

    def all_multipliers(self, z: Array) -> Array:
        """Return z, (nz,): no row is redundant."""
        return z

    def project(self, e: Array) -> Array:
        """Return (1 - f_z (g_y f_z)^-1 g_y) e at the last stage, (ny,)."""
        t, y, z = self.last
        g_y, f_z = self.system.g_y(t, y), self.system.f_z(t, y, z)
        return e - f_z @ np.linalg.solve(g_y @ f_z, g_y @ e)

    def start(self) -> tuple[Array, Array]:
        """Return (y', z) at the start of the step."""
        return self.system.derivative(self.t, self.y)

    def residual(self, t: float, x: Array, dx: Array, z: Array) -> tuple[Array, Array]:
        """Return f(t, y, z) - x' (ny,) and -g(t, y) (nz,) at y = y_n + x."""
        y = self.y + x
        return self.system.f(t, y, z) - dx, -self.system.g(t, y)

    def linearize(self, x: Array, dx: Array, z: Array) -> "LinearizedHessenberg":
        """Return f_y, f_z and g_y at y = y_n + x and the start time of the step."""
        s, y = self.system, self.y + x
        return LinearizedHessenberg(s.f_y(self.t, y, z), s.f_z(self.t, y, z), s.g_y(self.t, y), s.counts, self.t)

    def end(self, t: float, x: Array, dx: Array | None, z: Array) -> tuple[Array, Array]:
        """Return y, and z, after a Gauss-Newton step for a given x' = f(t, y, z), with f_z at the end of the step."""
        s, y = self.system, self.y + x
        if dx is not None:
            z = z + least_squares(s.f_z(t, y, z), dx - s.f(t, y, z), EPS)
            self.system.store_z(y, z)  # not if dx is None: then z may not converge
        return y, z


class LinearizedHessenberg(NamedTuple):
    """Partial derivatives f_y (ny, ny), f_z (ny, nz) and g_y (nz, ny) at a point: `mbdae.system.Linearization`."""

    f_y: Array
    f_z: Array
    g_y: Array
    counts: Counts
    t: float

    def apply_E(self, e: Array) -> Array:
        """Return e, (ny,): E is the identity."""
        return e

    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """Return the identity, f_y, f_z and g_y."""
        return np.eye(len(self.f_y)), self.f_y, self.f_z, self.g_y

    def factorize(self, mu: complex) -> Solver:
        """Factorize [[1 - mu f_y, -f_z], [g_y, 0]], real or complex."""
        ny, nz = self.f_z.shape
        matrix = np.block([[np.eye(ny) - mu * self.f_y, -self.f_z], [self.g_y, np.zeros((nz, nz))]])
        solve_factorized = factorized(matrix, f"the linear system of an implicit step at t = {self.t:.17g}")
        self.counts.factorizations += 1

        def solve(r: Array, c: Array) -> tuple[Array, Array]:
            self.counts.solves += 1
            u = solve_factorized(np.concatenate([r, c / mu]))
            return u[:ny], u[ny:]

        return solve
