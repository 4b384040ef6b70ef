"""Discrete sensitivity of a run between steps: hidden constraint, projections, jumps, starts, energies.

Derivatives are those of the computed steps, not of the continuous flow: dy (ny,) in the tangent at y, dp (k,) of k
parameters. Maps are matrices with columns for (dy, dp). The compiled core differentiates steps
(mbdae/native/sensitivity).
"""

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ...errors import AssemblyError, InputError, StepError
from ...finite_differences import converged_difference, numerical_jacobian
from ...system import Array
from ...tolerances import INTERPOLATION, ITERATION_ROUNDING, PIVOT_RANK
from ..assembly.assembly import assemble_start
from ..hybrid.switches import inactive_rows
from .acceleration_sensitivity import AccelerationSensitivity, TimeDerivativePartials
from .parameter_direction import Parameter
from .parameter_partials import Parameters
from .slip_friction_partials import with_slip_friction_partials

if TYPE_CHECKING:
    from ..._native import Parameters as NativeParameters
    from ..formulations.compiled_systems import CompiledSystem

START_REDUCTIONS = 3  # reductions of the difference width of starts, limited by the assembly tolerance
JUMP_WIDTH = 1e-3  # width of differences of sampled controllers (user functions), in units of q, v, or of states


class PointSensitivity(AccelerationSensitivity):
    """Partial derivatives of the maps between the steps of a run.

    Args:
        system: a workspace that freezes the rows in use.
        parameters: the varied parameters, k of them.
        native: the parameters bound to the core.
    """

    system: "CompiledSystem"

    def __init__(self, system: "CompiledSystem", parameters: Parameters, native: "NativeParameters") -> None:
        super().__init__(system, parameters)
        self.system, self.native, self.stabilized = system, native, system.formulation == "ggl"

    @property
    def n_carry(self) -> int:
        """Length of the carry of methods with an explicit first stage: (v', s', w'), in GGL form after M^-1 G^T mu."""
        return self.ny - (0 if self.stabilized else self.system.nv)

    def restarted_carry(self, t: float, y: Array) -> Array:
        """Return the partials of the carry restarted at y, (nc, ny + k); there M^-1 G^T mu = 0."""
        out = np.zeros((self.n_carry, self.ny + self.k))
        rate = self.rate(t, y, multipliers=False).rate[self.system.nv :, : self.ny + self.k]
        out[self.n_carry - len(rate) :] = rate
        return out

    def multipliers(self, t: float, y: Array) -> tuple[Array, Array, TimeDerivativePartials]:
        """Return y' (ny,), the multipliers of all rows (ng,) with friction in inactive rows, and their partials."""
        found, (F, lam) = self.rate(t, y), self.system.derivative(t, y)
        lam, dlam = with_slip_friction_partials(self, *self.system.split(y), lam[: self.system.ng], found.lam)
        return F, lam, found._replace(lam=dlam)

    def projection(self, t: float, y: Array) -> Array:
        """Return the partials of `mbdae.system.System.project_state` at y: each Gauss-Newton step, and v.

        They are (ny, ny + k).
        """
        return self._projected_point(t, y, True)[1]

    def row_update(self, t: float, y: Array) -> Array:
        """Return the partials of v projected onto rows newly in use, (ny, ny + k)."""
        return self._projected_point(t, y, False)[1]

    def _projected_point(self, t: float, y: Array, positions: bool) -> tuple[Array, Array]:
        """Return the projected point, with q and v or only v projected, and its partials.

        Raises:
            StepError: if the core cannot compute it.
        """
        found = self.system.core.projection(self.native, t, np.ascontiguousarray(y), positions)
        if found is None:
            raise StepError("singular", f"the projection at t = {t:.9g} s cannot be differentiated")
        return found[0], found[1].T

    def jump(self, t: float, y: Array, late: float = np.inf) -> Array:
        """Return the partials of `mbdae.system.System.jump` at y, (ny, ny + k), by differences of controllers."""
        s, out = self.system, np.eye(self.ny, self.ny + self.k)
        if s.ns:
            widths = JUMP_WIDTH * np.append(s.mechanism.motion_scales, np.ones(s.ns))
            jumps = numerical_jacobian(
                lambda x: s.element_states(s.jump(t, s.add(y, np.append(x, 0.0)), late)), self.ny - 1, widths
            )
            out[2 * s.nv : -1, : self.ny - 1] = jumps
        for i, (p, laws) in enumerate(zip(self.parameters.all, self.parameters.laws, strict=True)):
            if laws.perturbed and len(laws.indices):
                (q, v), inner = s.split(y), s.element_states(y)[laws.indices]
                found = {k: f.jump(t, q, v, inner, late) for k, f in laws.perturbed.items()}
                out[2 * s.nv + laws.indices, self.ny + i] = p.quotient(found)
        return out

    def initial_impact(self, t: float, y: Array) -> tuple[Array, Array]:
        """Return the start point with v projected onto the rows of a mode, and its partials, including impact work."""
        nq, nv = self.system.nq, self.system.nv
        at, out = self._projected_point(t, y, False)
        before, after = (self.energy(y[:nq], w[nq : nq + nv])[0] for w in (y, at))
        out[-1] += after @ np.vstack([out, np.eye(self.k, self.ny + self.k, self.ny)]) - before
        return at, out

    def start(self, t: float, y: Array) -> Array:
        """Return the partials of q and v of the mechanism's start with respect to the parameters, (ny, k).

        They are sixth-order differences of assembly; components that closures determine are then corrected exactly.
        """
        s, out, nv = self.system, np.zeros((self.ny, self.k)), self.system.nv
        mech = self.parameters.mech
        base, (q, v) = mech.point(t=t), s.split(y)
        inactive, all_inactive = s.constraints.inactive, inactive_rows(mech.switches, (0,) * len(mech.switches))
        s.constraints.inactive = all_inactive  # a start is assembled without unilateral rows
        G, positional = s.jacobian(q), s.constraints.positional
        B = s.constraints.partials(v, np.zeros(s.ng))[1]
        s.constraints.inactive = inactive
        assembled, every = bool(s.ng and mech.start_values.assemble), np.arange(nv)
        fixed_q, fixed_v = assemble_start(mech, t)[2:] if assembled else (every, every)
        free_q, free_v = np.setdiff1d(every, fixed_q), np.setdiff1d(every, fixed_v)
        determined = assembled and all(_determine_all(A) for A in (G[np.ix_(positional, free_q)], G[:, free_v]))
        for i, p in enumerate(self.parameters.all):
            if p.keeps_start or (determined and all(m.start_values == mech.start_values for m in p.trials)):
                continue  # or closures and fixed coordinates determine all components
            try:
                out[:, i] = self._start_quotient(p, t, base)
            except AssemblyError as e:  # the change of the parameter is too large
                if p.name.startswith("start.") or not determined:
                    raise InputError(f"the start cannot be assembled near this value of {p.name!r}: {e}") from None
        if not assembled:
            return out
        g = self.parameters.row_partials(t, q, np.zeros(nv))[1]
        residual = (G @ out[:nv] + g)[positional]
        out[free_q] -= np.linalg.pinv(G[np.ix_(positional, free_q)], rcond=PIVOT_RANK) @ residual
        residual = G @ out[nv : 2 * nv] + B @ out[:nv] + self.parameters.row_partials(t, q, v)[0]
        out[nv + free_v] -= np.linalg.pinv(G[:, free_v], rcond=PIVOT_RANK) @ residual
        return out

    def _start_quotient(self, p: Parameter, t: float, base: Array) -> Array:
        """Return the derivative of the assembled start with respect to a parameter, (ny,), by sixth-order differences.

        Raises:
            AssemblyError: if the change of the parameter is too large.
            InputError: if the start jumps.
        """
        s, scales = self.system, self.parameters.mech.motion_scales
        found = converged_difference(
            lambda h: {k: s.difference(base, m.point(t=t)) for k, m in p.perturbed_mechanisms(h).items()},
            p.width, np.append(ITERATION_ROUNDING * scales, np.zeros(s.ns + 1)), START_REDUCTIONS,
        )  # fmt: skip
        if not found.discrepancy <= INTERPOLATION:
            raise InputError(f"the assembled start jumps with {p.name!r}: no derivative")
        return found.derivative

    def start_states(self) -> Array:
        """Return the partials of the start values of states with respect to the parameters, (ns, k)."""
        out = np.zeros((self.system.ns, self.k))
        for i, p in enumerate(self.parameters.all):
            if not p.keeps_states:
                out[:, i] = p.quotient({k: np.array(list(m.states.values())) for k, m in p.perturbed.items()})
        return out

    def energy(self, q: Array, v: Array) -> Array:
        """Return the partials of the kinetic and the potential energy, (2, ny + k)."""
        s, nv, out = self.system, self.system.nv, np.zeros((2, self.ny + self.k))
        rest = np.zeros(nv)
        M, weight, _ = (a.copy() for a in s.inertial.partials(q, rest, rest))
        out[0, :nv] = 0.5 * v @ (s.inertial.partials(q, rest, v)[1] - weight)
        out[0, nv : 2 * nv] = M @ v
        gravity = pin.nonLinearEffects(s.model, s.workspace, q, rest).copy()
        pin.forwardKinematics(s.model, s.workspace, q, rest)
        pin.computeJointJacobians(s.model, s.workspace, q)
        out[1, :nv] = gravity - s.laws.split_generalized_force(0.0, q, rest, np.zeros(s.ns))[0]
        for i, (p, systems) in enumerate(zip(self.parameters.all, self.parameters.perturbed_systems, strict=True)):
            out[:, self.ny + i] = p.quotient({k: np.array(other.energy(q, v)) for k, other in systems.items()})
        return out


def _determine_all(G: Array) -> bool:
    """Return whether the rows determine all free coordinates of a start."""
    return int(np.linalg.matrix_rank(G, PIVOT_RANK)) == G.shape[1] if G.size else not G.shape[1]
