"""Balance of forces of a mechanism at rest or in steady motion, and its exact partial derivatives.

    0 = f(t, q, v, s) + G^T lam,   0 = h(t, q, v, s),   0 = g(t, q),   v constant

In coordinates y of the null space, q (+) Z y, with minimum-norm multipliers,

    rho = Z^T f,   H = -Z^T K Z,   K = d(f + G^T lam)/dq - S h_s^+ h_q

States that h determines (currents) are functions of the configuration. An integrator, for which h_s is singular, adds
a condition on the configuration, 0 = h, like a row of a closure; its state acts as the multiplier.
"""

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import InputError, UnknownNameError
from ...system import Array
from ...tolerances import EPS, ROUNDING, VISIBLE
from ..forces.elements import ForceElements
from ..forces.sampled import SampledElement
from ..formulations.equation_partials import equation_partials
from ..hybrid.kinds.unilateral import Unilateral
from ..hybrid.switches import Mode
from ..tree.tree_terms import bias, update_motions, update_poses
from .null_space import NullSpace, constraint_null_space, project_configuration
from .spectrum import null_space
from .term_sizes import TermSizes

if TYPE_CHECKING:
    from ..mechanism import Mechanism

GRAVITY = "gravity"
STATE_ITERATIONS = 20


class ForceBalance(NamedTuple):
    """Balance of forces at a configuration.

    Attributes:
        q: configuration, (nq,).
        s: states, (ns,).
        f: all forces, (nv,).
        load: the forces that the load factor multiplies, without this factor, (nv,).
        rho: Z^T f, (k,).
        H: -d rho/dy, (k, k).
        lam: multipliers of closures and drivers, (ng,).
        holding: holding forces or torques of the locked coordinates, N m or N, (m,).
        free: null space of the rows.
        size: |M^-1/2 f| without reactions: the reference for rho.
        terms: magnitudes of the terms of K, (nv, nv), see `mbdae.mechanism.equilibrium.term_sizes`.
    """

    q: Array
    s: Array
    f: Array
    load: Array
    rho: Array
    H: Array
    lam: Array
    holding: Array
    free: NullSpace
    size: float
    terms: Array

    @property
    def indeterminate(self) -> Array:
        """Whether each holding force is statically indeterminate, (m,), since its row depends on other rows."""
        first = len(self.lam)
        return (np.abs(self.free.dependent[first : first + len(self.holding)]) > VISIBLE).any(axis=1)

    @property
    def noise(self) -> Array:
        """Rounding error of each entry of H, (k, k)."""
        Z = np.abs(self.free.Z)
        return EPS * (Z.T @ self.terms @ Z)


class Statics:
    """Balance of forces of a mechanism, with some coordinates locked and some forces scaled.

    Args:
        mech: the mechanism.
        t: time in s.
        v: constant velocities of locked coordinates, (nv,).
        locked: velocity indices of the locked coordinates.
        loads: names of the forces to be scaled, or ``"gravity"``.
        mode: the mode, whose closed contacts are active. Clutches and stiction are ignored, with a warning.

    Raises:
        UnknownNameError: for a force that does not exist.
        InputError: for a sampled controller, which has no equilibrium.
    """

    def __init__(
        self, mech: "Mechanism", t: float, v: Array, locked: Array, loads: Sequence[str] = (), *, mode: Mode
    ) -> None:
        self.mech, self.t, self.v, self.locked = mech, t, v, locked
        self.system = s = mech.system()
        s.enter(mode)
        if names := ", ".join(dict.fromkeys(switch.name for switch in mech.switches if type(switch) is not Unilateral)):
            warnings.warn(f"statics and modes ignore clutches and stiction: {names}", stacklevel=3)
        for law, _ in s.laws.bound:
            if isinstance(law, SampledElement):
                raise InputError(f"{law.name!r} is a sampled controller: statics and modes need a continuous one")
        for name in loads:
            if name not in (*s.laws.names, GRAVITY):
                raise UnknownNameError("force", name, (*s.laws.names, GRAVITY))
        self.scales_gravity = GRAVITY in loads
        self.loads = ForceElements([law for law, _ in s.laws.bound if law.name in loads], s.model)
        if self.loads.ns:
            raise InputError(f"a load must not have states, got {', '.join(self.loads.states())}")
        self.rows = np.eye(s.nv)[locked]
        self.sizes, self.units = TermSizes(s, v), np.append(mech.row_scales, mech.coordinate_scales[locked])
        self.factor = 1.0

    def point(self, q: Array, s: Array) -> ForceBalance:
        """Return the balance at a configuration that satisfies the closures, with states near s."""
        system = self.system
        s, U, f, load, free, G, R = self._forces(q, s)
        lam, each = free.multipliers(f), list[Array]()
        K, S, hq, hs = self.partials(q, s, lam[: system.ng], each)
        forces = np.abs(f) + np.abs(lam) @ np.abs(np.vstack([G, self.rows, R])) + abs(self.factor - 1.0) * np.abs(load)
        forces += self.sizes.forces(self.t, q, s)
        terms = self.sizes.stiffness(np.linalg.norm(U, axis=0), forces, np.abs(K) + self.sizes.partials(each)[0])
        if len(s):
            hs_inv = partial_inverse(hs, EPS * self.sizes.states(hs))
            K, terms = K - S @ hs_inv @ hq, terms + np.abs(S) @ np.abs(hs_inv) @ np.abs(hq)
        size = float(np.linalg.norm(np.linalg.solve(U.T, f)))
        if len(R):
            mu = lam[len(lam) - len(R) :]
            integrators = null_space(hs, EPS * self.sizes.states(hs)).vectors
            s = s + integrators @ np.linalg.lstsq(S @ integrators, R.T @ mu)[0]
        m = system.ng + len(self.locked)
        rho, H = free.Z.T @ f, -free.Z.T @ K @ free.Z
        return ForceBalance(q, s, f, load, rho, H, lam[: system.ng], lam[system.ng : m], free, size, terms)

    def residual_forces(self, q: Array, s: Array) -> tuple[Array, NullSpace]:
        """Return rho = Z^T f (k,) at a configuration, with states near s, and the null space, without derivatives."""
        _, _, f, _, free, *_ = self._forces(q, s)
        return free.Z.T @ f, free

    def _forces(self, q: Array, s: Array) -> tuple[Array, Array, Array, Array, NullSpace, Array, Array]:
        """Return s, U of M = U^T U, f, the load, the null space, G and the rows of integrators at a configuration."""
        s = self.states(q, s)
        U = self.system.inertia(self.t, q)
        f, load = self.system.force(self.t, q, self.v, s)[0], self.load(q)
        return s, U, f + (self.factor - 1.0) * load, load, *self.free(U, q, s)

    def free(self, U: Array, q: Array, s: Array) -> tuple[NullSpace, Array, Array]:
        """Return the null space at q, G, and the integrator rows among its constraints; J must be current."""
        G, R = self.system.jacobian(), self.integrator_conditions(q, s)[1]
        size = (np.abs(R) * self.sizes.l).max(1, initial=0.0)
        units = np.append(self.units, np.where(size > 0, size, 1.0))
        return constraint_null_space(U, np.vstack([G, self.rows, R]), units, self.sizes.l), G, R

    def term_sizes(self, balance: ForceBalance) -> Array:
        """Return the magnitudes of the terms of rho, and of its changes over 1 rad or characteristic length, (k,)."""
        return np.abs(balance.free.Z.T) @ (balance.terms @ self.sizes.l)

    def residual(self, balance: ForceBalance) -> float:
        """Return the largest ratio of rho to the magnitude of its terms, see `term_sizes`."""
        rho = np.abs(balance.rho)
        return float(np.divide(rho, self.term_sizes(balance), out=np.zeros_like(rho), where=rho > 0).max(initial=0.0))

    def project(self, q: Array, s: Array) -> Array:
        """Project a configuration onto 0 = g and the conditions of integrators; locked coordinates keep their values.

        Raises:
            StepError: if loops cannot be closed.
        """
        more = (lambda x: self.integrator_conditions(x, s)) if self.system.ns else None
        return project_configuration(self.system, self.t, q, more, locked=self.locked)

    def load(self, q: Array) -> Array:
        """Return the forces that the load factor multiplies, without this factor, (nv,); kinematics must be current."""
        s = self.system
        out = self.loads.generalized_force(self.t, q, self.v, np.empty(0))[0]
        if self.scales_gravity:
            out = out - bias(s.model, s.workspace, q, np.zeros(s.nv))
        return out

    def force(self, q: Array, s: Array) -> Array:
        """Return f at a configuration, (nv,)."""
        self.system.jacobian(q)
        update_motions(self.system.model, self.system.workspace, q, self.v)
        update_poses(self.system.model, self.system.workspace, q)
        return self.system.force(self.t, q, self.v, s)[0] + (self.factor - 1.0) * self.load(q)

    def partials(
        self, q: Array, s: Array, lam: Array, each: list[Array] | None = None
    ) -> tuple[Array, Array, Array, Array]:
        """Return K = d(f + G^T lam)/dq (nv, nv), S = df/ds (nv, ns), h_q (ns, nv), h_s (ns, ns).

        Partial derivatives of the laws are appended to ``each``, see `ForceElements.partials`.
        """
        system, nv = self.system, self.system.nv
        u, rows = np.concatenate([self.v, s, [0.0]]), np.arange(system.ng)
        partials = equation_partials(system, self.t, q, u, np.zeros(nv), lam, rows, each)
        K = partials.K[:nv].copy()
        if self.factor != 1.0:
            more = self.loads.partials(self.t, q, self.v, np.empty(0))[:nv, :nv]
            if self.scales_gravity:
                more = more - system.inertial.partials(q, np.zeros(nv), np.zeros(nv))[1]
            K += (self.factor - 1.0) * more
        return K, partials.D[:nv, nv:-1], partials.K[nv:-1], partials.D[nv:-1, nv:-1]

    def states(self, q: Array, s: Array) -> Array:
        """Return the states (ns,) with h = 0; states that h does not determine remain unchanged."""
        if not len(s):
            return s
        for _ in range(STATE_ITERATIONS):
            rates, _, hs = self.rates(q, s)
            change = partial_inverse(hs, EPS * self.sizes.states(hs)) @ rates
            s = s - change
            if (np.abs(change) <= ROUNDING * np.abs(s)).all():
                break
        return s

    def integrator_conditions(self, q: Array, s: Array) -> tuple[Array, Array]:
        """Return the residuals of integrators, (m,), and their partial derivatives, (m, nv)."""
        if not len(s):
            return np.empty(0), np.empty((0, self.system.nv))
        rates, hq, hs = self.rates(q, s)
        left = null_space(hs.T, EPS * self.sizes.states(hs).T).vectors.T
        return left @ rates, left @ hq

    def rates(self, q: Array, s: Array) -> tuple[Array, Array, Array]:
        """Return h (ns,), h_q (ns, nv) and h_s (ns, ns)."""
        system, nv = self.system, self.system.nv
        update_motions(system.model, system.workspace, q, self.v)
        update_poses(system.model, system.workspace, q)
        laws = system.laws.partials(self.t, q, self.v, s)
        return system.laws.generalized_force(self.t, q, self.v, s)[1][:-1], laws[nv:-1, :nv], laws[nv:-1, 2 * nv :]


def partial_inverse(A: Array, e: Array) -> Array:
    """Return X (n, n) with A X A = A, for A (n, n) with errors e (n, n): A^-1 on pivot rows and columns, else 0."""
    null, out = null_space(A, e), np.zeros_like(A)
    rows, columns = null.rows[: len(null.pivots)], null.pivots
    out[np.ix_(columns, rows)] = np.linalg.inv(A[np.ix_(rows, columns)])
    return out
