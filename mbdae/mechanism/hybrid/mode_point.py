"""Point of a run for guards and mode transitions, with all rows, including inactive ones."""

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...system import Array
from ...tolerances import MODE_ROUNDING, PIVOT_RANK, SOLUTION_ROUNDING
from ..closures.constraints import Constraints
from ..tree.pinocchio_data import make_data
from ..tree.tree_terms import update_motions, update_poses

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System


class AllRows:
    """All rows of a mechanism in any mode, evaluated by the core, or in a separate workspace."""

    def __init__(self, system: "Index2System") -> None:
        self.system = system

    @cached_property
    def _workspace(self) -> tuple[Any, Any, Constraints]:
        model, data = self.system.model, make_data(self.system.model)
        return model, data, Constraints(model, data, self.system.mechanism.constraints)

    def __call__(self, t: float, q: Array) -> tuple[Array, Array, Array]:
        """Return g (ng,), G (ng, nv) and g_t (ng,)."""
        if (found := self.system.rows_of_all_modes(t, q, np.zeros(self.system.nv))) is not None:
            return found[:3]
        model, data, rows = self._workspace
        update_poses(model, data, q)
        return *rows.value(t), -rows.motion(t)[1]

    def bias(self, t: float, q: Array, v: Array) -> Array:
        """Return gamma = Gdot v + g_tt, (ng,)."""
        if (found := self.system.rows_of_all_modes(t, q, v)) is not None:
            return found[3]
        model, data, rows = self._workspace
        update_motions(model, data, q, v, np.zeros(len(v)))
        update_poses(model, data, q)
        return rows.bias(v) - rows.motion(t)[2]


class ModePoint:
    """A point (t, y) of a run; its properties are computed once, on demand.

    Args:
        system: a workspace, in the mode of the point.
        all_rows: all rows of the same mechanism.
        t: time.
        y: the point, (n,).
    """

    def __init__(self, system: "Index2System", all_rows: AllRows, t: float, y: Array) -> None:
        self.system, self.all_rows, self.t, self.y = system, all_rows, t, y
        self.q, self.v = system.split(y)

    @cached_property
    def values(self) -> tuple[Array, Array, Array]:
        """Terms g (ng,), G (ng, nv) and g_t (ng,) of all rows."""
        return self.all_rows(self.t, self.q)

    @cached_property
    def g(self) -> Array:
        """Residuals g of all rows, (ng,)."""
        return self.values[0]

    @property
    def G(self) -> Array:
        """Jacobian G of all rows, (ng, nv)."""
        return self.values[1]

    @cached_property
    def rate(self) -> Array:
        """Rates G v + g_t of all rows, (ng,)."""
        _, G, g_t = self.values
        return G @ self.v + g_t

    @cached_property
    def gamma(self) -> Array:
        """Bias terms gamma of all rows, (ng,)."""
        return self.all_rows.bias(self.t, self.q, self.v)

    @cached_property
    def derivative(self) -> tuple[Array, Array]:
        """Time derivative y' (ny,) and multipliers lam (ng,) in the mode of the workspace."""
        return self.system.derivative(self.t, self.y)

    @cached_property
    def null_multipliers(self) -> Array:
        """A basis N (ng, k) of the null space of G^T in the mode, G^T N = 0."""
        active = np.setdiff1d(np.arange(self.system.ng), self.system.constraints.inactive)
        left, singular_values, _ = np.linalg.svd(self.G[active])
        r = int(np.count_nonzero(singular_values > PIVOT_RANK * singular_values[:1]))
        out = np.zeros((self.system.ng, len(active) - r))
        out[active] = left[:, r:]
        return out

    @property
    def lam(self) -> Array:
        """Multipliers lam in the mode of the workspace, (ng,)."""
        return self.derivative[1]

    @property
    def vdot(self) -> Array:
        """Accelerations v' in the mode of the workspace, (nv,)."""
        return self.derivative[0][len(self.v) : 2 * len(self.v)]

    @cached_property
    def rounding(self) -> float:
        """Rounding error of multipliers: bound on a computed multiplier whose exact value is 0."""
        U = self.system.inertia(self.t, self.q)
        largest = np.abs(U.T @ (U @ self.vdot)).max() + np.abs(self.G.T @ self.lam).max(initial=0.0)
        return SOLUTION_ROUNDING * float(largest)

    def acceleration(self, row: int) -> float:
        """Return G v' + gamma of a row."""
        return float(self.G[row] @ self.vdot + self.gamma[row])

    @cached_property
    def speed(self) -> float:
        """Largest speed, in rad/s and characteristic lengths per s, plus the characteristic rate."""
        mech = self.system.mechanism
        return mech.characteristic_rate + float(np.abs(self.v / mech.coordinate_scales).max())

    def is_at_rest(self, row: int) -> bool:
        """Return whether G v + g_t of a row is zero to within `velocity_tolerance`."""
        return bool(abs(self.rate[row]) <= self.velocity_tolerance(row))

    def velocity_tolerance(self, row: int) -> float:
        """Return the speed below which a row counts as at rest, in its unit."""
        return MODE_ROUNDING * self.speed * float(self.system.mechanism.row_scales[row])
