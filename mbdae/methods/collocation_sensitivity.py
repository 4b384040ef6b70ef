"""Tangent and adjoint of a collocation step, with respect to initial value, parameters and step size.

The stage equations are solved to rounding, so the implicit function theorem applies to the computed values: with the
partial derivatives of the equations of each stage (`mbdae.system.StagePartials`) at the solution,

    F_i dF_i + X_i dX_i + Z_i dZ_i = -(Y_i dy + P_i dp + T_i dt_i),   dX_i = h sum_j a_ij dF_j + dh sum_j a_ij F_j
    dy_1 = Y dy + X dX_s

is one linear system for all stages, and the adjoint solves its transpose. The iteration leaves a larger error in Z_i
than in X_i and F_i; Z_i is then recomputed to be consistent with these. Guess and iteration of the step have no effect.

Source: Hairer, Lubich, Roche, Lecture Notes in Mathematics 1409 (1989), chapter 7, for the stages.
"""

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs

from ..errors import StepError
from ..system import Array, DiscreteSensitivity, State, System
from ..tolerances import SOLUTION_ROUNDING
from .collocation import repeated_step

if TYPE_CHECKING:
    from .radau import RadauIIA



class CollocationSensitivity:
    """Tangent and adjoint of a step from (t, y) to t + h; arguments as for `mbdae.methods.step_sensitivity`.

    Raises:
        StepError: if the stages cannot be solved.
    """

    def __init__(
        self, system: System, sensitivity: DiscreteSensitivity, method: "RadauIIA", t: float, h: float, state: State
    ) -> None:
        self.sensitivity, self.h, self.a = sensitivity, h, (a := method.arrays)
        chart, found = repeated_step(system, a, t, h, state.y, method.patience)
        self.K, Z, self.ny = found.K, found.Z, system.ny
        xs = h * (a.A @ self.K)
        self.stages = []
        for at in zip(t + a.c * h, xs, self.K, Z, strict=True):
            stage, z = sensitivity.implicit(chart, *at), at[-1]
            dz = np.linalg.lstsq(stage.z[: self.ny], chart.residual(*at)[0])[0]
            if np.abs(dz).max(initial=0.0) > SOLUTION_ROUNDING * (1 + np.abs(z).max(initial=0.0)):
                z += dz
                stage = sensitivity.implicit(chart, *at)
            self.stages.append(stage)
        s, m = len(a.c), system.ny + Z.shape[1]
        matrix = np.zeros((s, m, s, m))
        for i, stage in enumerate(self.stages):
            matrix[i, :, :, : self.ny] = h * a.A[i][:, None] * stage.x[:, None]
            matrix[i, :, i, : self.ny] += stage.F
            matrix[i, :, i, self.ny :] = stage.z
        self.matrix = matrix.reshape(s * m, s * m)
        self.lu, self.pivots, info = dgetrf(self.matrix)
        if info:
            raise StepError("singular", f"the equations of the step from t = {t:.17g} are singular")
        self.Y, self.X = sensitivity.end(xs[-1])
        self.state = State(chart.end(t + h, xs[-1].copy(), self.K[-1], Z[-1])[0])

    def forward(self, dy: Array, carry: Array, dp: Array, dh: Array | None = None) -> tuple[Array, Array]:
        """Return the tangents of the new y, (ny, m), and of the carry, which is empty."""
        a, moved = self.a, self.a.A @ self.K
        right = np.array([stage.y @ dy + stage.p @ dp for stage in self.stages])
        if dh is not None:
            for i, stage in enumerate(self.stages):
                right[i] += np.outer(stage.x @ moved[i] + a.c[i] * stage.t[:, 0], dh)
        dF = -self._solve(right)[:, : self.ny]
        dx = self.h * np.tensordot(a.A[-1], dF, 1)
        if dh is not None:
            dx += np.outer(moved[-1], dh)
        return self.Y @ dy + self.X @ dx, carry

    def reverse(self, y: Array, carry: Array) -> tuple[Array, Array, Array]:
        """Return the cotangents of y, (ny, m), the carry and the parameters, (k, m), from those after the step."""
        right = np.zeros((len(self.stages), len(self.stages[0].F), y.shape[1]))
        right[:, : self.ny] = -self.h * self.a.A[-1][:, None, None] * (self.X.T @ y)
        out, p = self.Y.T @ y, np.zeros((self.sensitivity.k, y.shape[1]))
        for stage, mu in zip(self.stages, self._solve(right, transposed=1), strict=True):
            out, p = out + stage.y.T @ mu, p + stage.p.T @ mu
        return out, carry, p

    def _solve(self, right: Array, transposed: int = 0) -> Array:
        flat, matrix = right.reshape(len(self.lu), -1), self.matrix.T if transposed else self.matrix
        out = dgetrs(self.lu, self.pivots, flat, trans=transposed)[0]
        out += dgetrs(self.lu, self.pivots, flat - matrix @ out, trans=transposed)[0]  # rows differ by powers of h
        return out.reshape(right.shape)
