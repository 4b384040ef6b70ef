"""Tangent and adjoint of a half-explicit step, with respect to initial value, parameters and step size.

The step is the computed one, with fixed size, rows and number of stages. The tangent passes through the stages in
order; the adjoint passes through them in reverse order with the transposed systems,

    dX_i = h sum_{j<i} a_ij dF_j,   dXhat_i = h sum_{j<i} ahat_ij dF_j,   dF_i = stage(dX_i, dXhat_i, dy, dp)
    dy_1 = Y dy + X h sum b_i dF_i

so that <w, J u> = <J^T w, u> to rounding. The system provides the stages (`mbdae.system.DiscreteSensitivity`).

Source: Hager, Numer. Math. 87 (2000), for explicit methods; here for the linear systems of half-explicit stages.
"""

from typing import TYPE_CHECKING

import numpy as np

from ..system import Array, DiscreteSensitivity, State, System

if TYPE_CHECKING:
    from .tableau import Tableau


class StepSensitivity:
    """Partial derivatives of a step from (t, y) to t + h, whose stages are recomputed.

    Args:
        system: as for `mbdae.methods.half_explicit_step.half_explicit_step`.
        sensitivity: discrete sensitivity of the same system.
        tableau: a method.
        t: time.
        h: step, signed.
        state: state at the start, with the carry of the method.

    Attributes:
        state: state at the end, with the carry of the method.
        carries: whether the method carries anything.

    Raises:
        StepError: if a stage cannot be solved.
    """

    def __init__(
        self, system: System, sensitivity: DiscreteSensitivity, tableau: "Tableau", t: float, h: float, state: State
    ) -> None:
        self.sensitivity, self.h, self.carries, self.a = sensitivity, h, tableau.explicit_first, tableau.arrays
        a, first = self.a, int(tableau.explicit_first)
        chart, n = system.chart(t, state.y), len(a.c)
        self.F, self.stages, z = np.zeros((n, system.ny)), [], np.empty(0)
        if first:
            self.F[0], z = chart.first(state.carry)
        for i in range(first, n):
            x, xhat, factor = h * a.A[i].dot(self.F), h * a.Ahat[i].dot(self.F), h * a.Ahat[i, i]
            times = t + a.c[i] * h, t + a.chat[i] * h
            self.F[i], z = chart.stage(times[0], x, times[1], xhat, factor)
            self.stages.append(sensitivity.stage(chart, times, x, xhat, factor, self.F[i], z))
        x = h * a.b.dot(self.F)
        self.Y, self.X = sensitivity.end(x)
        self.state = State(chart.point(x), system.carry(self.F[-1], z) if first else None)

    def forward(self, dy: Array, carry: Array, dp: Array, dh: Array | None = None) -> tuple[Array, Array]:
        """Return the tangents of the new y, (ny, m), and of the new carry.

        Args:
            dy: tangents of y, (ny, m).
            carry: tangents of the carry, (nc, m); ignored if nothing is carried.
            dp: tangents of the parameters, (k, m).
            dh: tangents of the step size, (m,).
        """
        a, h, first = self.a, self.h, int(self.carries)
        n = len(dy)
        dF = np.zeros((len(a.c), self.sensitivity.width, dy.shape[1]))
        if first:
            dF[0] = self.sensitivity.first(dy, carry)
        for i, stage in enumerate(self.stages, first):
            dx, dxhat = (h * np.tensordot(row[:i], dF[:i, :n], 1) for row in (a.A[i], a.Ahat[i]))
            clock = None
            if dh is not None:
                clock = np.outer([a.c[i], a.chat[i], a.Ahat[i, i]], dh)
                dx, dxhat = (d + np.outer(row[:i] @ self.F[:i], dh) for d, row in ((dx, a.A[i]), (dxhat, a.Ahat[i])))
            dF[i] = stage.forward(dx, dxhat, dy, dp, clock)
        dx = h * np.tensordot(a.b, dF[:, :n], 1)
        if dh is not None:
            dx += np.outer(a.b @ self.F, dh)
        return self.Y @ dy + self.X @ dx, self.sensitivity.carried(dF[-1]) if first else carry

    def reverse(self, y: Array, carry: Array) -> tuple[Array, Array, Array]:
        """Return the cotangents of y, (ny, m), the carry and the parameters, (k, m), from those after the step."""
        a, h, first = self.a, self.h, int(self.carries)
        n = len(y)
        F = np.zeros((len(a.c), self.sensitivity.width, y.shape[1]))
        F[:, :n] = h * a.b[:, None, None] * (self.X.T @ y)
        if first:
            F[-1] += self.sensitivity.carried_reverse(carry)
        out, p = self.Y.T @ y, np.zeros((self.sensitivity.k, y.shape[1]))
        for i in range(len(a.c) - 1, first - 1, -1):
            x, xhat, own, numbers = self.stages[i - first].reverse(F[i])
            out, p = out + own, p + numbers
            F[:i, :n] += h * (a.A[i, :i, None, None] * x + a.Ahat[i, :i, None, None] * xhat)
        if not first:
            return out, carry, p
        own, carry = self.sensitivity.first_reverse(F[0])
        return out + own, carry, p
