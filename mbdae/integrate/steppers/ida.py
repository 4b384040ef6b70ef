"""BDF of variable order and step size: IDA of SUNDIALS, by the package scikit-sundae.

The equations y' = f(t, y, z), 0 = g(t, y) become a fully implicit system with the integrals of the multipliers as
unknowns,

    0 = E (f(t, y, Z') - y'),   0 = g(t, y),

which lowers the index by one (Gear, SIAM J. Numer. Anal. 27 (1990)): BDF computes the same y, with z = Z', and its
linear systems remain well-conditioned for small steps. z is not in the error norm, whose order it would reduce. Z is,
with the tolerance of its effect f_z Z on y: otherwise Newton's iteration would end before z has converged, with large
errors in problems that are nonlinear in z. Formulation ``"index2"`` satisfies G v = 0, and g drifts; ``"ggl"``, the
stabilized form of Gear, Gupta, Leimkuhler, is what BDF codes integrate.

A multistep method needs one coordinate system for its whole history, so configurations are integrated in raw
coordinates with unit vectors u (quaternions, cosines and sines): P(q) q' = v and 0 = (|u|^2 - 1)/2, where P is the
left inverse of the partial derivatives of q (+) x. The history, unlike the state at a node, is never normalized or
projected: closures and unit vectors hold up to the tolerance of Newton's iteration, a third of that of the error.

Source: Hindmarsh et al., ACM Trans. Math. Softw. 31 (2005); Brenan, Campbell, Petzold (1996), chapter 5.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ...discovery import lazy_import
from ...errors import InputError, StepError
from ...finite_differences import numerical_jacobian
from ...mechanism.formulations.index2 import Index2System
from ...system import Array, Step, System
from .library_solver import UNCONTROLLED, LibrarySolver, LibraryStepper
from .stepper import smallest_step

if TYPE_CHECKING:
    from ..run.run_state import RunState

block_diag = lazy_import("scipy.linalg", "block_diag")
RATE_WIDTH = 1e-4  # width in rad of difference quotients of rates of configurations


class IdaSolver(LibrarySolver):
    """IDA: BDF of orders 1 to 5."""

    family = "BDF"
    excludes: ClassVar[Mapping[str, str]] = {
        "events": "it does not restart where the state jumps",
        "switches": "it does not restart in modes of stops, stiction, clutches and contacts",
    }
    in_core = False

    @property
    def missing(self) -> str:
        try:
            import sksundae.ida  # noqa: F401
        except ModuleNotFoundError:
            return "method 'ida' needs scikit-sundae: pip install \"mbdae[sundials]\""
        return ""

    def stepper(self, system: System, *control: Any) -> "Ida":
        """See `LibrarySolver.stepper`."""
        return Ida(self, system, *control)


IDA = IdaSolver("ida", 5)


class Ida(LibraryStepper):
    """Steps of IDA; the number of rejected steps is not reported (None).

    Raises:
        InputError: for several atol on a manifold.
    """

    def __init__(self, method: IdaSolver, system: System, *control: Any) -> None:
        super().__init__(method, system, *control)
        from sksundae.ida import IDA as solver

        self._create, self.system = solver, system
        self.unknowns: Any = ()
        self.raw = RawCoordinates(system)
        if self.atol.ndim and self.raw.units:
            raise InputError("method 'ida' needs one number as atol for quaternions and unbounded revolute joints")

    def _begin_step(self, run: "RunState") -> None:
        """Create the chart of the next step; start IDA at a new point, or with new rows in use."""
        y = run.state.y
        self.chart, self.start = self.system.chart(run.t, y), y
        if self.solver is not None and self.chart.unknowns == self.unknowns and np.array_equal(y, self.end):
            return
        F, z = self.chart.start()
        self.unknowns, self.m = self.chart.unknowns, len(z)
        self.solver = self._create(
            self._residual,
            jacfn=self._jacobian,
            rtol=float(self.rtol),
            atol=self._tolerances(y, F, z),
            first_step=self.first_size(run) or 0.0,
            max_step=self.max_step if np.isfinite(self.max_step) else 0.0,
        )
        start = np.concatenate([y, np.zeros(self.m)])
        self.solver.init_step(run.t, start, np.concatenate([self.raw.tangent_map(y) @ F, z]))

    def _tolerances(self, y: Array, F: Array, z: Array) -> Array:
        """Return absolute tolerances of y, and of Z: changes of Z that change y by its tolerance, (n + m,)."""
        s, at = self.system, self.system.error_components
        E, _, L, _ = self.chart.linearize(np.zeros(s.ny), F, z).matrices()
        f_z = np.abs(np.linalg.solve(E, L))[at]
        tolerances_y = np.full(len(y), UNCONTROLLED)
        tolerances_y[: len(y) - s.ny + len(f_z)] = self.atol
        tolerance = self.atol + self.rtol * s.characteristic_magnitudes(y)[at]
        return np.concatenate([tolerances_y, 1 / (f_z / tolerance[:, None]).max(axis=0)])

    def propose(self, run: "RunState") -> tuple[float, float]:
        """Let IDA take a step; return its size and end time.

        Raises:
            StepError: if IDA fails.
        """
        run.rejected = None
        self._begin_step(run)
        stop = run.interval.stop
        result = self.solver.step(stop, method="onestep", tstop=stop)
        if not result.success:
            raise StepError("step_size", f"IDA stopped at t = {result.t:.17g}: {result.message}")
        t = run.interval.end if result.t == stop else float(result.t)
        if abs(t - run.t) < smallest_step(run.t, run.t1):
            raise StepError("step_size", f"the steps of IDA fell below rounding at t = {run.t:.17g}")
        self.result = result
        return abs(t - run.t), t

    def take(self, run: "RunState", h: float) -> Step:
        """Return the current point of IDA, with the multipliers there."""
        n = len(run.state.y)
        y, dy = self.result.y[:n], self.result.yp
        x = self.raw.to_chart(self.start, y, dy[:n])[0]
        self.end, z = self.chart.end(run.t + run.sign * h, x, None, dy[n:])
        return self.end_of_step(self.end, z)

    def restart(self) -> None:
        """Start IDA again after a jump."""
        self.solver = self.h = None

    def _residual(self, t: float, u: Array, du: Array, out: Array) -> None:
        """Evaluate the residuals at u = (y, Z), (n + m,)."""
        n, counts = len(u) - self.m, self.system.counts
        r, c = self.chart.residual(t, *self.raw.to_chart(self.start, u[:n], du[:n]), du[n:])
        counts.newton += 1
        counts.solves += 1
        out[:] = np.concatenate([r, c, self.raw.unit_residuals(u[:n])])

    def _jacobian(self, t: float, u: Array, du: Array, res: Array, cj: float, out: Array) -> None:
        """Evaluate their partials with respect to u plus cj times those with respect to u', (n + m, n + m)."""
        n, ny, m, counts = len(u) - self.m, self.system.ny, self.m, self.system.counts
        x_dx = self.raw.to_chart(self.start, u[:n], du[:n])
        E, A, L, C = self.chart.linearize(*x_dx, du[n:]).matrices()
        x_y, dx_y = self.raw.partials(x_dx[0], u[:n], du[:n])
        counts.factorizations += 1
        out[:] = 0.0
        out[:ny, :n], out[:ny, n:] = A @ x_y - E @ (cj * x_y + dx_y), cj * L
        out[ny : ny + m, :n] = -C @ x_y
        for i, block in enumerate(self.raw.units):
            out[ny + m + i, block] = u[block]


class RawCoordinates:
    """Points y as vectors (n,), and their coordinates x in a chart at y_n, y = y_n (+) x (ny,).

    Attributes:
        units: components of y that form unit vectors.
    """

    def __init__(self, system: System) -> None:
        self.system, self.units = system, list[slice]()
        if isinstance(system, Index2System):
            self.manifold, self.nq, self.nv = system.manifold, system.nq, system.nv
            self.units = system.manifold.unit_blocks

    def tangent_map(self, y: Array) -> Array:
        """Return the partial derivatives of the components of y (+) x with respect to x at x = 0, (n, ny)."""
        if not self.units:
            return np.eye(len(y))
        return block_diag(self.manifold.coordinate_partials(y[: self.nq]), np.eye(len(y) - self.nq))

    def _tangent(self, q: Array) -> Array:
        """Return P, (nv, nq), which maps q' to the velocity."""
        T = self.manifold.coordinate_partials(q)
        return np.linalg.solve(T.T @ T, T.T)

    def _rate(self, x: Array, q: Array, dq: Array) -> Array:
        """Return x' (nv,) at q = q_n (+) x from q' (nq,)."""
        return self.manifold.tangent(x, self._tangent(q) @ dq)

    def to_chart(self, start: Array, y: Array, dy: Array) -> tuple[Array, Array]:
        """Return x and x' (ny,) from y and y', (n,), in the chart at a start (n,)."""
        if not self.units:
            return y - start, dy
        q = self.manifold.normalized(y[: self.nq])
        x = self.system.difference(start, np.concatenate([q, y[self.nq :]]))
        return x, np.concatenate([self._rate(x[: self.nv], q, dy[: self.nq]), dy[self.nq :]])

    def unit_residuals(self, y: Array) -> Array:
        """Return (|u|^2 - 1)/2 of each unit vector."""
        return np.array([(y[block] @ y[block] - 1) / 2 for block in self.units])

    def partials(self, x: Array, y: Array, dy: Array) -> tuple[Array, Array]:
        """Return the partial derivatives of x and of x' with respect to y, at constant y', (ny, n) each."""
        n = len(y)
        if not self.units:
            return np.eye(n), np.zeros((n, n))
        nq, nv = self.nq, self.nv
        q = self.manifold.normalized(y[:nq])
        P = self._tangent(q)

        def rate(d: Array) -> Array:
            return self._rate(x[:nv] + self.manifold.tangent(x[:nv], d), self.manifold.integrate(q, d), dy[:nq])

        rest = np.eye(n - nq)
        x_q = self.manifold.tangent(x[:nv], P)
        return block_diag(x_q, rest), block_diag(numerical_jacobian(rate, nv, RATE_WIDTH) @ P, 0 * rest)
