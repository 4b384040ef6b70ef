"""Terms of the equations of motion at one point, and their exact derivatives.

M(q) v' = f(t, q, v, s) + G(q)^T lam,   0 = g(t, q),   0 = G v + g_t,   0 = G v' + gamma,   s' = h(t, q, v, s)
"""

import warnings
from collections.abc import Callable
from functools import cached_property
from operator import index
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from ...arguments import number
from ...errors import InputError
from ...system import Array
from ...tolerances import RANK, VISIBLE
from ..discrete_sensitivity.acceleration_sensitivity import AccelerationSensitivity, TimeDerivativePartials
from ..discrete_sensitivity.parameter_partials import Parameters
from ..formulations.equation_partials import equation_partials, gamma_partials, rate_partials, time_partials
from ..hybrid.switches import Mode

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism

Result = TypeVar("Result")


class PointPartials(NamedTuple):
    """Partial derivatives of the equations; those with respect to q are in the tangent at q.

    With r = f + G^T lam - M v' at constant v', lam:

    Attributes:
        r_q, r_v, r_s, r_t: derivatives of r, (nv, nv), (nv, nv), (nv, ns), (nv,).
        h_q, h_v, h_s, h_t: derivatives of s' = h, (ns, nv), (ns, nv), (ns, ns), (ns,).
        Gv_q, Gv_t: derivatives of G v + g_t, (ng, nv), (ng,); with respect to v it is G.
        gamma_q, gamma_v, gamma_t: derivatives of gamma, (ng, nv), (ng, nv), (ng,).
    """

    r_q: Array
    r_v: Array
    r_s: Array
    r_t: Array
    h_q: Array
    h_v: Array
    h_s: Array
    h_t: Array
    Gv_q: Array
    Gv_t: Array
    gamma_q: Array
    gamma_v: Array
    gamma_t: Array


class EquationsAtPoint:
    """Terms of the equations of motion at (t, q, v, s), evaluated on access; arrays may be kept and changed.

    The point need not satisfy the constraints: ``g`` and ``Gv`` are their violations. Rows of stops, clutches and
    sticking joints are active according to ``mode``, see `mbdae.Solution.modes`: by default none is.

    Args:
        mechanism: the mechanism.
        t: time in s.
        q: configuration (nq,).
        v: velocity (nv,); zero if omitted.
        s: states of forces (ns,); start values if omitted.
        mode: the state of each switch.
        native: the compiled core, which then computes v' and lam.

    Raises:
        InputError: for wrong shapes, values that are not finite, a q off the manifold, or an unknown mode.
    """

    def __init__(
        self,
        mechanism: "Mechanism",
        t: float,
        q: Array,
        v: Array | None = None,
        s: Array | None = None,
        *,
        mode: Mode = (),
        native: ModuleType | None = None,
    ) -> None:
        m, self.mechanism, self.native = mechanism, mechanism, native
        self.t = number("t", t)
        self.q = m.configuration(q)
        self.v = np.zeros(m.nv) if v is None else m.vector("v", v, m.nv)
        self.s = m.vector("s", list(m.states.values()) if s is None else s, len(m.states))
        try:
            self.mode = tuple(map(index, mode)) or (0,) * len(m.switches)
        except TypeError:
            raise InputError(f"{m.title}: a mode is the state of each switch, 0, 1, ..., got {mode!r:.60}") from None
        sizes = [len(switch.states) for switch in m.switches]
        if len(self.mode) != len(sizes) or any(x not in range(n) for x, n in zip(self.mode, sizes, strict=True)):
            raise InputError(f"{m.title}: mode {self.mode} does not fit {len(sizes)} switches with {sizes} states")

    def __repr__(self) -> str:
        return f"<equations of {self.mechanism.title} at t = {self.t:.9g} s>"

    def _evaluate(self, evaluate: "Callable[[Index2System], Result]") -> Result:
        """Evaluate a function of a workspace in this mode, with kinematics at q and slip directions from v."""
        pool = self.mechanism.workspaces
        system = pool.acquire(native=self.native)
        system.enter(self.mode)
        system.jacobian(self.q)
        system.closure_friction.update_slip_directions(self.v)
        found = evaluate(system)
        pool.release(system)
        return found

    @cached_property
    def y(self) -> Array:
        """The point in the format of runs: (q, v, s, w = 0)."""
        return np.concatenate([self.q, self.v, self.s, [0.0]])

    @cached_property
    def M(self) -> Array:
        """Mass matrix, armature included, (nv, nv)."""
        return self.mechanism.mass_matrix(self.q)

    @cached_property
    def _forces(self) -> tuple[Array, Array]:
        def evaluate(system: "Index2System") -> tuple[Array, Array]:
            system.inertia(self.t, self.q)
            return system.force(self.t, self.q, self.v, self.s)

        return self._evaluate(evaluate)

    @property
    def f(self) -> Array:
        """All forces except those of constraints, minus Coriolis, centrifugal and gravity terms, (nv,), in N and N m.

        Friction proportional to constraint forces is not in f, but in ``vdot`` and ``lam``.
        """
        return self._forces[0]

    @property
    def sdot(self) -> Array:
        """Rates s' of the states of forces, (ns,)."""
        return self._forces[1][:-1]

    @property
    def power(self) -> float:
        """Power of the non-conservative forces in W, without drivers."""
        return float(self._forces[1][-1])

    @cached_property
    def _constraints(self) -> tuple[Array, Array]:
        def evaluate(system: "Index2System") -> tuple[Array, Array]:
            g, G = system.closures(t=self.t)
            return g.copy(), G.copy()

        return self._evaluate(evaluate)

    @property
    def g(self) -> Array:
        """Constraints at position level, (ng,), in m and rad; 0 for velocity rows."""
        return self._constraints[0]

    @property
    def G(self) -> Array:
        """Constraint Jacobian of all rows, (ng, nv); inactive rows are 0."""
        return self._constraints[1]

    @cached_property
    def g_t(self) -> Array:
        """Partial time derivative of g, (ng,): minus the prescribed rates of drivers."""
        return self._evaluate(lambda system: system.g_t(self.t))

    @property
    def Gv(self) -> Array:
        """Constraints at velocity level, G v + g_t, (ng,)."""
        return self.G @ self.v + self.g_t

    @cached_property
    def gamma(self) -> Array:
        """Constraint bias at acceleration level, Gdot v + g_tt, (ng,)."""
        return self._evaluate(lambda system: system.gamma(self.q, self.v, self.t))

    @cached_property
    def _accelerations(self) -> tuple[Array, Array]:
        return self._evaluate(lambda system: system.derivative(self.t, self.y))

    @property
    def vdot(self) -> Array:
        """Accelerations from M v' = f + G^T lam, 0 = G v' + gamma, (nv,).

        Raises:
            StepError: if the constraints or the mass matrix are singular there.
        """
        nv = self.mechanism.nv
        return self._accelerations[0][nv : 2 * nv]

    @property
    def lam(self) -> Array:
        """Multipliers of all rows from the same system, (ng,), of minimum norm if rows are dependent."""
        return self._accelerations[1]

    @cached_property
    def energies(self) -> tuple[float, float]:
        """Kinetic energy, and potential energy of gravity and springs, in J."""
        return self._evaluate(lambda system: system.energy(self.q, self.v))

    def partials(self, vdot: Array | None = None, lam: Array | None = None) -> PointPartials:
        """Return the partial derivatives of the equations, at ``vdot`` and ``lam`` or at those of the point.

        Raises:
            InputError: for friction proportional to constraint forces, which is not a term of f, or for wrong lengths.
            StepError: if v' and lam are needed and do not exist.
        """
        m, nv = self.mechanism, self.mechanism.nv
        a = self.vdot if vdot is None else m.vector("vdot", vdot, nv)
        z = self.lam if lam is None else m.vector("lam", lam, m.ng)

        def evaluate(s: "Index2System") -> PointPartials:
            s.closure_friction.reject("a table of partial derivatives")
            at = equation_partials(s, self.t, self.q, self.y[m.nq :], a, z, np.arange(m.ng))
            f_t, Gv_t, gamma_t = time_partials(s, self.t, self.q, self.v, self.s, z)
            gamma_q, gamma_v = gamma_partials(s, self.q, self.v)
            inner = slice(nv, -1)
            return PointPartials(
                at.K[:nv], at.D[:nv, :nv], at.D[:nv, inner], f_t[:nv],
                at.K[inner], at.D[inner, :nv], at.D[inner, inner], f_t[inner],
                at.B, Gv_t, gamma_q, gamma_v, gamma_t,
            )  # fmt: skip

        return self._evaluate(evaluate)

    @cached_property
    def _dependence(self) -> Array:
        """Derivatives (k, 2 nv) with respect to (q, v) of terms that vanish as long as constraints are dependent.

        With w^T G = 0, G N = 0 the terms are w^T G(q) N, zero at constant rank of G, and w^T gamma.
        """

        def evaluate(system: "Index2System") -> Array:
            system.derivative(self.t, self.y)
            if system.rows is None:
                return np.empty((0, 2 * self.mechanism.nv))
            U, S, Vt = np.linalg.svd(self.G)
            rank = np.count_nonzero(RANK * S[0] < S)
            W, every = U[:, rank:].T, np.arange(self.mechanism.ng)
            by_v = W @ gamma_partials(system, self.q, self.v)[1]
            by_q = [W @ rate_partials(system, self.t, self.q, n, every)[1] for n in Vt[rank:]]
            zero = np.zeros_like(by_v)
            return np.vstack([np.hstack([zero, by_v]), *(np.hstack([block, zero]) for block in by_q)])

        return self._evaluate(evaluate)

    @cached_property
    def _rates(self) -> TimeDerivativePartials:
        def evaluate(system: "Index2System") -> TimeDerivativePartials:
            system.closure_friction.reject_planar_slips("v' and lam")
            none = Parameters(lambda _: self.mechanism, {}, system=system)
            return AccelerationSensitivity(system, none).rate(self.t, self.y)

        return self._evaluate(evaluate)

    @cached_property
    def _derivative(self) -> Array:
        """Derivative of (v', lam, s') with respect to (q, v, s, t), (nv + ng + ns, 2 nv + ns + 1)."""
        m, n = self.mechanism, 2 * self.mechanism.nv + len(self.s)
        found = np.vstack([self._rates.rate[m.nv : 2 * m.nv], self._rates.lam, self._rates.rate[2 * m.nv : n]])
        return found[:, [*range(n), -1]]

    def jvp(self, dq: Array, dv: Array, ds: Array | None = None, dt: float = 0.0) -> tuple[Array, Array, Array]:
        """Return the changes of (v', lam, s') along one direction of (q in the tangent, v, s, t).

        Where constraints are dependent, derivatives exist only along directions that preserve the dependence, such as
        consistent motions; a warning is issued for any other direction.

        Raises:
            InputError: unless all are finite numbers of the right shapes; for a contact that slides in two directions.
            StepError: if the constraints or the mass matrix are singular there.
        """
        m, dt = self.mechanism, number("dt", dt)
        ds = np.zeros(len(self.s)) if ds is None else m.vector("ds", ds, len(self.s))
        along = np.concatenate([m.vector("dq", dq, m.nv), m.vector("dv", dv, m.nv), ds, [dt]])
        violated = np.abs(self._dependence @ along[: 2 * m.nv]).max(initial=0.0)
        if violated > VISIBLE * np.abs(along).max():
            text = f"{m.title}: its dependent constraints become independent along (dq, dv): no derivative exists"
            warnings.warn(text, stacklevel=2)
        vdot, lam, sdot = np.split(self._derivative @ along, [m.nv, m.nv + m.ng])
        return vdot, lam, sdot

    def vjp(
        self, vdot: Array, lam: Array | None = None, sdot: Array | None = None
    ) -> tuple[Array, Array, Array, float]:
        """Return derivatives of <vdot, v'> + <lam, lam'> + <sdot, s'> with respect to q (tangent), v, s, t: adjoint."""
        m, ns = self.mechanism, len(self.s)
        lam = np.zeros(m.ng) if lam is None else m.vector("lam", lam, m.ng)
        sdot = np.zeros(ns) if sdot is None else m.vector("sdot", sdot, ns)
        bar = np.concatenate([m.vector("vdot", vdot, m.nv), lam, sdot]) @ self._derivative
        return bar[: m.nv], bar[m.nv : 2 * m.nv], bar[2 * m.nv : -1], float(bar[-1])
