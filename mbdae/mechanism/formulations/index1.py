"""Index-1 form of a mechanism: an ordinary differential equation for the accelerations.

    q' = v,   M(q) v' = f(t, q, v) + G(q)^T lam,   0 = G v' + gamma + 2 alpha (G v + g_t) + beta^2 g

Explicit methods advance it in the coordinates of a step, scipy's solvers in the raw coordinates q: dq/dt = T(q) v with
the tangent map T, the derivative of q (+) x at x = 0, (nq, nv). Neither g nor G v + g_t is enforced: alpha and beta in
1/s damp their drift (Baumgarte, Comput. Methods Appl. Mech. Eng. 1 (1972)).
"""

from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError
from ...system import Array, State
from .index2 import Index2System
from .steps.index2_step import Index2Chart

if TYPE_CHECKING:
    from ..mechanism import Mechanism


class Index1System(Index2System):
    """Acceleration form of a mechanism, for solvers of y' = F(t, y) without manifold coordinates.

    Args:
        mechanism: the mechanism.
        baumgarte: alpha and beta in 1/s; zeros for none.
        core: the compiled core, see `mbdae.mechanism.formulations.compiled_systems`.

    Raises:
        InputError: unless baumgarte is two numbers that are not negative.
    """

    formulation = "index1"

    def __init__(self, mechanism: "Mechanism", baumgarte: tuple[float, float] = (0.0, 0.0), **core: ModuleType) -> None:
        try:
            pair = np.asarray(baumgarte, float)
        except (TypeError, ValueError):
            pair = np.empty(0)
        if pair.shape != (2,) or not (np.isfinite(pair).all() and (pair >= 0).all()):
            raise InputError(f"baumgarte is a pair (alpha, beta) in 1/s, not negative, got {baumgarte!r}")
        self.baumgarte = self.alpha, self.beta = float(pair[0]), float(pair[1])
        super().__init__(mechanism, **core)

    def gamma(self, q: Array, v: Array, t: float | None = None) -> Array:
        """Return gamma + 2 alpha (G v + g_t) + beta^2 g of all rows, (ng,); kinematics must be current at q."""
        gamma = super().gamma(q, v, t)
        if not (self.alpha or self.beta):
            return gamma
        g, G = self.closures(None, t)
        rate = G @ v - self.constraints.motion(t)[1]
        return gamma + 2 * self.alpha * rate + self.beta**2 * g

    def chart(self, t: float, y: Array) -> "Index1Chart":
        return Index1Chart(self, t, y, super().chart(t, y).rows)

    def update_independent_rows(self, t: float, state: State) -> State:
        """Select the rows in use; v is not projected, since its drift affects all rows."""
        super().update_independent_rows(t, state)
        return state

    def normalized(self, y: Array) -> Array:
        """Return the point of raw coordinates with normalized quaternions and (cos, sin) pairs."""
        return np.concatenate([self.manifold.normalized(y[: self.nq]), y[self.nq :]])

    def rate(self, t: float, y: Array) -> tuple[Array, Array]:
        """Return dy/dt = (T v, v', w') in raw coordinates, (nq + nv + 1,), and lam (ng,)."""
        y = self.normalized(y)
        F, lam = self.derivative(t, y)
        if self.manifold.flat:
            return F, lam
        dq = self.manifold.coordinate_partials(y[: self.nq]) @ F[: self.nv]
        return np.concatenate([dq, F[self.nv :]]), lam


class Index1Chart(Index2Chart):
    """Step in coordinates (x, v, s, w) whose stages satisfy only the hidden constraint."""

    def stage(self, t: float, x: Array, t_hat: float, xhat: Array, factor: float) -> tuple[Array, Array]:
        """Return (x', v', s', w') and lam of all rows, (ng,); ``that``, ``xhat`` and ``factor`` are not used."""
        s, nv = self.system, self.system.nv
        F, lam = s.derivative(t, s.add(self.y, x))
        return np.concatenate([s.manifold.tangent(x[:nv], F[:nv]), F[nv:]]), lam

    def all_multipliers(self, z: Array) -> Array:
        """Return the multipliers of the last stage, at the end of the step, which are those of all rows."""
        return z
