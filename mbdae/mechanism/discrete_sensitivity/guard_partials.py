"""Partial derivatives of guards with respect to y, parameters and time.

A guard is a function of g, G v + g_t, q, v and lam at a point. These have exact derivatives; the guard is
differentiated with respect to them by sixth-order differences, which are exact for linear guards: gaps, normal forces
and speeds.
"""

from typing import TYPE_CHECKING

import numpy as np

from ...finite_differences import numerical_derivative
from ...system import Array
from ...tolerances import TINY
from ..hybrid.mode_point import AllRows, ModePoint
from .impact_sensitivity import row_rate_partials

if TYPE_CHECKING:
    from ..hybrid.switch import Guard, PointFunction
    from .point_sensitivity import PointSensitivity

WIDTH = 1e-3  # relative change of the quantities of a point, for differences of guards


class GuardPartials:
    """Derivatives of the guards of a mode at a point.

    Args:
        sensitivity: partial derivatives at points, with a workspace in the mode.
        first: first point of the mode, at which guards set their references (the last tooth, a direction of slip).
        point: the point.
    """

    def __init__(self, sensitivity: "PointSensitivity", first: ModePoint, point: ModePoint) -> None:
        self.sensitivity, self.first, self.point = sensitivity, first, point
        parameters, s = sensitivity.parameters, sensitivity.system
        g, rate = row_rate_partials(parameters, point.t, point.q, point.v)
        self.columns = np.r_[0 : 2 * s.nv, s.ny : s.ny + len(parameters) + 1]  # columns of q, v, p and t
        self.n = s.ny + len(parameters) + 1
        self.g, self.rate = np.zeros((2, s.ng, self.n))
        self.g[:, self.columns], self.rate[:, self.columns] = g, rate
        self.derivative_partials: tuple[Array, Array] | None = None  # partials of y' and lam, once a guard needs them

    def gradient(self, guard: "Guard") -> Array:
        """Return the partial derivatives of a guard with respect to (y, p, t), (ny + k + 1,)."""
        if guard.needs_multipliers and self.derivative_partials is None:
            found = self.sensitivity.rate(self.point.t, self.point.y)
            self.derivative_partials = found.rate, found.lam
        piece = int(np.argmin(np.abs(guard.pieces(self.point)))) if guard.pieces else None
        value = _smooth(guard, piece)
        out = np.array([self._directional_derivative(value, j) for j in range(self.n)])
        ny = self.sensitivity.ny
        out[ny:-1] += self._parameter_partials(guard, piece)
        return out

    def _directional_derivative(self, guard: "PointFunction", j: int) -> float:
        """Return the derivative along one direction: of y, of a parameter, or of time."""
        parameters, i = self.sensitivity.parameters.all, j - self.sensitivity.ny
        h = parameters[i].width if 0 <= i < len(parameters) else WIDTH
        if self.derivative_partials:  # guards are linear in all but the multipliers
            change = h * np.abs(self.derivative_partials[1][:, j]).max() / (np.abs(self.point.lam).max() + TINY)
            h /= max(1.0, float(change / WIDTH))
        return float(numerical_derivative(lambda x: guard(self._displaced_point(j, x)), h))

    def _displaced_point(self, j: int, x: float, rows: AllRows | None = None) -> ModePoint:
        """Return the point displaced by x along a direction, with rows and multipliers to first order."""
        point, s, dy = self.point, self.sensitivity.system, np.zeros(self.sensitivity.ny)
        if j < len(dy):
            dy[j] = x
        t = point.t + (x if j == self.n - 1 else 0.0)
        out = ModePoint(s, rows or point.all_rows, t, s.add(point.y, dy))
        vars(out)["g"], vars(out)["rate"] = point.g + x * self.g[:, j], point.rate + x * self.rate[:, j]
        if self.derivative_partials:
            (F, lam), (dF, dlam) = point.derivative, self.derivative_partials
            vars(out)["derivative"] = F + x * dF[:, j], lam + x * dlam[:, j]
        return out

    def _parameter_partials(self, guard: "Guard", piece: int | None) -> Array:
        """Return the derivatives with respect to parameters in a guard: limits, teeth, ranges, directions of rows."""
        parameters, out = self.sensitivity.parameters, np.zeros(len(self.sensitivity.parameters))
        state = self.point.system.mode[guard.switch]
        kinds = [g.kind for g in self.point.system.mechanism.switches[guard.switch].guards(state)]
        for i, p in enumerate(parameters.all):
            values = {}
            for k, mech in p.perturbed.items():
                rows = AllRows(parameters.perturbed_systems[i][k]) if guard.kind == "slip" else None
                other = _smooth(mech.switches[guard.switch].guards(state)[kinds.index(guard.kind)], piece)
                other(self.first)
                values[k] = np.array(other(self._displaced_point(0, 0.0, rows)))
            out[i] = p.quotient(values)
        return out


def _smooth(guard: "Guard", piece: int | None) -> "PointFunction":
    """Return the function of a guard, or one of its smooth pieces."""
    pieces = guard.pieces
    return guard.value if pieces is None or piece is None else lambda x: pieces(x)[piece]
