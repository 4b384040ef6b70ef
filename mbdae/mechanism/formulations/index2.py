"""Index-2 descriptor form of a mechanism, bound to a workspace.

q' = v,   M(q) v' = f(t, q, v, s) + G(q)^T lam,   0 = G(q) v + g_t(t),   s' = h(t, q, v, s),   w' = power of the
non-conservative forces and, -lam . g_t, of the drivers; s are the states of actuators and controllers.
"""

from math import inf, isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import StepError
from ...linear_solve import lapack
from ...system import Array, System
from ..closures import independent_rows
from ..closures.constraints import Constraints
from ..hybrid.switches import Mode, inactive_rows
from ..tree import tree_terms as tree
from ..tree.pinocchio_data import PinocchioData
from . import equation_partials, features, rank_loss, residuals
from .closure_friction import ClosureFriction, solve_with_friction
from .inverse_dynamics import InverseDynamicsPartials
from .steps import index2_step, interpolation, projection, row_selection
from .steps.newmark_step import newmark_step
from .steps.variational import variational_step
from .workspace_pool import RunVariables

if TYPE_CHECKING:
    from ..mechanism import Mechanism


class Index2System(PinocchioData, RunVariables, System):
    """`mbdae.system.System` of a mechanism: y = (q, v, s, w), tangent (x, v, s, w) of length 2 nv + ns + 1, z = lam.

    A stage evaluates one mass matrix, one force, two constraint Jacobians, and factors M and G(Qhat) M^-1 G(Q)^T.
    """

    formulation, baumgarte = "index2", (0.0, 0.0)

    def __init__(self, mechanism: "Mechanism") -> None:
        self.workspace = mechanism.make_workspace()
        self._last = np.empty(0), np.empty(0)  # U and G at the last point
        self.nq, self.nv, self.ng, self.nz = mechanism.nq, mechanism.nv, mechanism.ng, mechanism.ng
        self.mode: Mode = (0,) * len(mechanism.switches)
        self.has_sticking_joints, self.driven = False, bool(mechanism.drivers)  # whether joints stick in the mode
        self.bind(mechanism)

    def bind(self, mechanism: "Mechanism") -> None:
        """Bind the workspace to a mechanism, or to a variant of it, whose parameters replace the previous ones."""
        before, self.mechanism = getattr(self, "mechanism", None), mechanism
        self.model, self.manifold = mechanism.model, mechanism.manifold
        self.laws = mechanism.bind_forces(self.workspace).attached(self)
        if not (before and before.model is mechanism.model and before.constraints is mechanism.constraints):
            self.inertial = InverseDynamicsPartials(self.model)
            tree.update_flexible(self.model, self.workspace)
            self.constraints = Constraints(self.model, self.workspace, mechanism.constraints)
            self.constraints.inactive = inactive_rows(mechanism.switches, self.mode)
            self.elimination_order = independent_rows.elimination_order(self.constraints)
        self.closure_friction = ClosureFriction(mechanism.forces, mechanism.closures, self.constraints)
        self.ns, self.ny = self.laws.ns, 2 * self.nv + self.laws.ns + 1
        self.error_components = slice(0, self.ny - (not self.driven))  # the work is included only with drivers
        self.reset()

    def closures(self, q: Array | None = None, t: float | None = None) -> tuple[Array, Array]:
        """Return g(t, q) (ng,) and G (ng, nv) of all rows.

        Without q kinematics must be current; without t, g of driven rows is nan.
        """
        self.update_rows(q)
        return self.constraints.value(t)

    def jacobian(self, q: Array | None = None) -> Array:
        """Return G (ng, nv) of all rows; without q kinematics must be current."""
        self.update_rows(q)
        return self.constraints.jacobian()

    def update_rows(self, q: Array | None) -> None:
        """Update the kinematics of rows at q."""
        self.counts.G += self.ng > 0
        if q is not None and self.ng:
            tree.update_poses(self.model, self.workspace, q)

    def g_t(self, t: float) -> Array:
        """Return g_t of all rows, (ng,); zero for closures, -u' for drivers."""
        return -self.constraints.motion(t)[1]

    def gamma(self, q: Array, v: Array, t: float | None = None) -> Array:
        """Return gamma = Gdot v + g_tt of all rows, (ng,); without t, it is nan for driven rows."""
        tree.update_motions(self.model, self.workspace, q, v, np.zeros(self.nv))
        return self.constraints.bias(v) - self.constraints.motion(t)[2]

    def inertia(self, t: float, q: Array) -> Array:
        """Return the Cholesky factor U of M(q) = U^T U, (nv, nv), zero below; leaves J and poses at q."""
        self.counts.M += 1
        self.counts.factorizations += 1
        M = tree.update_inertia(self.model, self.workspace, q)
        U, info = lapack().dpotrf(M, lower=0, clean=1)
        if info:
            if not np.isfinite(M).all():
                raise StepError("nonfinite", f"the state is not finite at t = {t:.17g}")
            joint = self.mechanism.coordinate_joint(abs(info) - 1)
            reason = tree.missing_inertia(self.model, joint)
            raise StepError("singular", f"the mass matrix is singular at joint {joint!r}, t = {t:.17g}: {reason}")
        return U

    def force(self, t: float, q: Array, v: Array, s: Array) -> tuple[Array, Array]:
        """Return f (nv,) and the rates (s', power in W), (ns + 1,); kinematics must be current at q."""
        tau, rates = self.generalized_force(t, q, v, s)
        f = tau - tree.bias(self.model, self.workspace, q, v)
        if not all(map(isfinite, f.tolist())):  # faster than `numpy.isfinite` on small arrays
            joint = self.mechanism.coordinate_joint(int(np.flatnonzero(~np.isfinite(f))[0]))
            raise StepError("nonfinite", f"the force on joint {joint!r} is not finite at t = {t:.17g}")
        return f, rates

    def generalized_force(self, t: float, q: Array, v: Array, s: Array) -> tuple[Array, Array]:
        """Return the sum of all force laws (nv,) and the rates (s', power in W); kinematics must be current at q."""
        self.counts.f += 1
        return self.laws.generalized_force(t, q, v, s)

    def energy(self, q: Array, v: Array) -> tuple[float, float]:
        """Return the kinetic energy (armature included) and the potential energy of gravity and springs, in J."""
        M = tree.update_inertia(self.model, self.workspace, q)
        kinetic = float(v @ (np.triu(M, 1) @ v)) + 0.5 * float(v @ (np.diagonal(M) * v))
        return kinetic, tree.gravity_potential(self.model, self.workspace, q) + self.laws.potential(q)

    @property
    def in_use(self) -> tuple[int, ...]:
        """See `mbdae.system.System`."""
        return () if self.rows is None else tuple(self.rows.tolist())

    def use_rows(self, rows: tuple[int, ...], frozen: bool = True) -> None:
        self.rows, self.rank, self.rows_frozen = np.array(rows, int), len(rows), frozen

    def point(self, t: float, q: Array) -> tuple[Array, Array]:
        """Return U and G at q, and update kinematics; U and G of the last stage are reused at the same q."""
        if self._last_q is not None and self.manifold.is_same_point(q, self._last_q, self.mechanism.q_scales):
            tree.update_poses(self.model, self.workspace, q)
            return self._last
        U = self.inertia(t, q)
        return U, self.jacobian()

    def all_multipliers(self, U: Array, G: Array, rows: Array, lam: Array) -> Array:
        """Return the minimum-norm multipliers of all rows, (.., ng), from those of the rows in use, (.., r)."""
        if len(rows) == self.ng:
            return lam[..., rows.argsort()]
        return independent_rows.all_multipliers(U, G, rows, lam)

    def new_workspace(self) -> "Index2System":
        """See `mbdae.system.System`; always in index-2 form."""
        out = self.mechanism.workspaces.acquire(native=self.native)
        out.ambiguous_pivot = self.ambiguous_pivot
        out.enter(self.mode)
        return out

    def rows_of_all_modes(self, t: float, q: Array, v: Array) -> tuple[Array, Array, Array, Array] | None:
        """Return g, G, g_t and gamma of all rows, active or not; None if Python must compute them."""
        return None

    def enter(self, mode: Mode) -> None:
        """Enter another mode, and reset the rank and the rows in use."""
        if mode == self.mode:
            return
        self.mode, switches = mode, self.mechanism.switches
        self.constraints.inactive, self.has_sticking_joints = inactive_rows(switches, mode), False
        for switch, state in zip(switches, mode, strict=True):
            switch.enter(self, state)
        self.rank, self.rows, self.rows_frozen, self._last_q = None, None, False, None
        self.selection_trigger, self.least_pivot_ratio = independent_rows.SelectionTrigger(self.ng), 1.0

    def order_of(self, tableau: Any) -> int:
        return tableau.order if self.closure_friction.interfaces else tableau.order_linear

    def split(self, y: Array) -> tuple[Array, Array]:
        """Return q (nq,) and v (nv,)."""
        return y[: self.nq], y[self.nq : self.nq + self.nv]

    def element_states(self, y: Array) -> Array:
        """Return the states s of force elements, (ns,)."""
        return y[self.nq + self.nv : -1]

    def breakpoint(self, t: float, sign: float) -> float:
        driven = (sign * s for s in self.constraints.nonsmooth_times if sign * s > sign * t)
        return sign * min(sign * self.laws.breakpoint(t, sign), *driven, inf)

    def jump(self, t: float, y: Array, late: float = inf) -> Array:
        """See `mbdae.system.System`: the states of sampled controllers jump."""
        q, v = self.split(y)
        return np.concatenate([q, v, self.laws.jump(t, q, v, self.element_states(y), late), y[-1:]]) if self.ns else y

    def chart(self, t: float, y: Array) -> index2_step.Index2Chart:
        if self.closure_friction.planar_slips:
            tree.update_poses(self.model, self.workspace, self.split(y)[0])
            self.closure_friction.begin_step(self.split(y)[1])
        return index2_step.Index2Chart(self, t, y, self.rows_of_step(t, y))

    def derivative(self, t: float, y: Array, guess: Array | None = None) -> tuple[Array, Array]:
        """Return (v, v', s', w') and lam (ng,) from M v' = f + G^T lam, 0 = G v' + gamma."""
        q, v = self.split(y)
        U, (f, rates) = self.inertia(t, q), self.force(t, q, v, self.element_states(y))
        rows = self.select_independent_rows(t, U, G := self.jacobian())
        slips = self.closure_friction.slip_terms(v, within_step=False) if self.closure_friction else None
        rhs = -self.gamma(q, v, t)[rows] if self.ng else np.empty(0)
        vdot, lam = self.solve(t, U, G, rows, G[rows], f, rhs, rates, slips)
        rates[-1] -= lam @ self.g_t(t)[rows]
        return np.concatenate([v, vdot, rates]), self.all_multipliers(U, G, rows, lam)

    def solve(
        self,
        t: float,
        U: Array,
        G: Array,
        rows: Array,
        Ghat: Array,
        f: Array,
        rhs: Array,
        rates: Array,
        slips: tuple[Array, Array, Array] | None,
    ) -> tuple[Array, Array]:
        """Solve for v' (nv,) and lam (r,), with friction proportional to lam, whose power is added to the rates."""
        if slips is None:
            return self.solve_saddle_point(t, U, G.take(rows, 0), Ghat, f, rhs)
        vdot, lam, power = solve_with_friction(self, t, U, G, rows, Ghat, f, rhs, slips)
        rates[-1] += power
        return vdot, lam

    def solve_saddle_point(
        self, t: float, U: Array, G: Array, Ghat: Array, f: Array, rhs: Array
    ) -> tuple[Array, Array]:
        """Solve M v' = f + G^T lam, Ghat v' = rhs by Cholesky of M = U^T U and LU of Ghat M^-1 G^T.

        With several f, (k, nv), rhs is 0 for all but the first; then v' is (k, nv), lam (k, r).
        """
        self.counts.solves += 1
        r, F = len(rhs), f if f.ndim > 1 else f[None]
        X = lapack().dpotrs(U, np.concatenate((G, F)).T, overwrite_b=1)[0].T  # G M^-1, and rows (M^-1 f)^T below
        if not r:
            return (X[0], rhs) if f.ndim == 1 else (X, np.zeros((len(f), 0)))
        self._MinvGT, self._G = X[:r].T, G
        S = X.dot(Ghat.T).T
        right = -S[:, r:] if f.ndim > 1 else rhs - S[:, r]
        if f.ndim > 1:
            right[:, 0] += rhs
        lu, piv, lam, info = lapack().dgesv(S[:, :r], right, overwrite_a=1, overwrite_b=1)
        self.counts.factorizations += 1
        pivot = np.abs(lu.diagonal())
        i, largest = pivot.argmin(), pivot[pivot.argmax()]
        self.selection_trigger.pivot_ratio = ratio = pivot[i] / largest
        self.least_pivot_ratio = min(self.least_pivot_ratio, ratio)
        if info or not ratio > independent_rows.SMALLEST_PIVOT:
            name = self.mechanism.row_names[int(self.rows[i] if self.rows is not None else 0)]
            raise StepError("singular", f"the closures' equations are singular at t = {t:.17g}: closure {name!r}")
        vdot = X[r] + lam.dot(X[:r]) if f.ndim == 1 else X[r:] + lam.T.dot(X[:r])
        if self.has_sticking_joints:  # iterative refinement removes rounding
            residual = -Ghat.dot(vdot.T)
            np.atleast_2d(residual.T)[0] += rhs
            dlam = lapack().dgetrs(lu, piv, residual)[0]
            vdot, lam = vdot + dlam.T.dot(X[:r]), lam + dlam
        return vdot, lam.T

    def carry(self, F: Array, z: Array) -> Array:
        """Return (v', s', w'); without lam, since the rows in use may change."""
        return F[self.nv :].copy()

    def add(self, y: Array, x: Array) -> Array:
        return np.concatenate([self.manifold.integrate(y[: self.nq], x[: self.nv]), y[self.nq :] + x[self.nv :]])

    def difference(self, y0: Array, y1: Array) -> Array:
        return np.concatenate([self.manifold.difference(y0[: self.nq], y1[: self.nq]), y1[self.nq :] - y0[self.nq :]])

    def rounding_loss(self, y0: Array, x: Array, y1: Array) -> Array:
        out = np.zeros(self.ny)
        out[self.nv :] = x[self.nv :] - (y1[self.nq :] - y0[self.nq :])
        if self.manifold.flat:
            out[: self.nv] = x[: self.nv] - (y1[: self.nq] - y0[: self.nq])
        return out

    partials, rate_partials = equation_partials.equation_partials, equation_partials.rate_partials
    project_state, characteristic_magnitudes = projection.project_state, projection.characteristic_magnitudes
    select_independent_rows = row_selection.select_independent_rows
    update_independent_rows = row_selection.update_independent_rows
    start, rows_of_step, newmark_step = row_selection.start, row_selection.rows_of_step, newmark_step
    variational_step, features = variational_step, property(features.features)
    smallest_pivot, pivot_ratio = row_selection.smallest_pivot, row_selection.pivot_ratio
    sparse_closures, closures_dense_or_sparse = residuals.sparse_closures, residuals.closures_dense_or_sparse
    residual, residuals = residuals.residual, residuals.residuals
    multiplier_gain, remaining_rows_dependent = row_selection.multiplier_gain, row_selection.remaining_rows_dependent
    null_spaces, vanishing_combinations = rank_loss.null_spaces, rank_loss.vanishing_combinations
    residual_of_dependent_rows, interpolant = rank_loss.residual_of_dependent_rows, interpolation.interpolant

    def component_magnitudes(self, y: Array) -> Array:
        size = np.concatenate([self.manifold.component_magnitudes(y[: self.nq]), np.abs(y[self.nq :])])
        if self.driven:
            size[-1] += self.energy(*self.split(y))[0]
        return size

    def noise(self, y: Array, relative: float) -> Array:
        out = np.zeros(self.ny)
        if self.ng:
            out[self.nv : 2 * self.nv] = relative * np.abs(self.split(y)[1]).max()
        return out
