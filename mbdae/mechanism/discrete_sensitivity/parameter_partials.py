"""Exact derivatives of a mechanism's equations with respect to its parameters: masses, placements, stiffnesses, ...

A parameter is a direction in the components of a mechanism: changes dpi of the ten inertial parameters of a body, a
twist xi of a joint placement or of a frame, gravity, armature, parameters of closures, drivers and forces. The
directions are computed once, from mechanisms with other values. At a point

    inertial parameters          d(M v' + nle) = Y dpi with the bodies' regressors Y
    placements and frames        columns of K, B, G and gamma_q of a frozen free joint there, times xi
    closures, drivers, forces    sixth-order differences of these rows and laws: exact for polynomial dependence;
                                 otherwise with a width at which differences of smaller width agree along a run
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cached_property, partial
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from ...errors import InputError, NotCompiled
from ...finite_differences import converged_difference
from ...system import Array
from ...tolerances import INTERPOLATION, RANK, SOLUTION_ROUNDING, TRUNCATION
from ..closures.constraints import Constraints
from ..forces.joint_friction import KineticFrictionElement
from ..formulations.closure_friction import ClosureFriction
from ..formulations.index2 import Index2System
from ..hybrid.switches import Mode, inactive_rows
from ..tree.frames import support
from ..tree.tree_terms import update_motions, update_poses
from .constant_directions import ConstantDirections
from .friction_partials import friction
from .modal_direction import modal_partials
from .parameter_direction import SMALL, WIDTH, LawDifferences, Parameter, RowDifferences
from .perturbed_mechanisms import perturbed_mechanism
from .placement_tree import PlacementTree

if TYPE_CHECKING:
    from ..mechanism import Mechanism

UNREACHABLE, NEGLIGIBLE = TRUNCATION, SOLUTION_ROUNDING  # |dg/dp| that no motion corrects: fraction; absolute
Make = Callable[[Mapping[str, float]], "Mechanism"]
RunPoint = tuple[float, Array, Array, Array, Mode]  # (t, q, v, s, mode)
REUSED = "workspace", "core data", "native"  # names of `Parameters.cached` that stay valid for other values


class Parameters:
    """Derivatives with respect to parameters of a mechanism, bound to a workspace.

    Args:
        make: creates a mechanism with these values, for instance
            `mbdae.mechanism.formats.mechanism_file.template.Template.make`.
        values: names and values of the parameters.
        native: the compiled core, for partials with respect to placements and frames.
        are_defaults: whether the values are the defaults of ``make``.
        along: points with modes at which differences of laws and rows must be accurate.
        system: a workspace of the mechanism with these values; a new one if omitted.

    Attributes:
        mech: the mechanism with these values.
        all: the parameters, k of them.
        values: values of the parameters by name.

    Raises:
        InputError: for a parameter that changes more than numerical values.
    """

    def __init__(
        self, make: Make, values: Mapping[str, float], native: ModuleType | None = None, *, are_defaults: bool = False,
        along: Sequence[RunPoint] = (), system: Index2System | None = None,
    ) -> None:  # fmt: skip
        self.make, self.values = make, dict(values)
        self.mech = mech = make({} if are_defaults else values)
        base = {} if are_defaults else values
        self.system = s = system or Index2System(mech)
        self.all: list[Parameter] = []
        for name, value in values.items():
            perturbed = partial(perturbed_mechanism, make, base, name, value)
            self.all.append(p := Parameter(name, mech, perturbed, WIDTH * abs(value) or SMALL))
            if p.side:
                text = f"parameter {name!r} = {value:.9g} is at the end of its range"
                warnings.warn(f"{text}: its derivative is taken from {p.side}", stacklevel=2)
            if along and p.changes_elements:
                self._choose_width(p, along)
        self.laws = [LawDifferences(p, s, p.perturbed) for p in self.all]
        self.rows = [RowDifferences(p, s, p.perturbed) for p in self.all]
        placed_joints = sorted({j for p in self.all for j in p.placements})
        frames = sorted({i for p in self.all for i in p.frames})
        self.placement_tree = PlacementTree(mech, placed_joints, frames, s, native) if placed_joints or frames else None
        self._found: dict[str, tuple[Any, Any]] = {}
        tree = self.placement_tree
        self.motions = np.array([tree.motion(p) for p in self.all]).T if tree else np.empty((0, 0))

    def __len__(self) -> int:
        return len(self.all)

    @cached_property
    def constant(self) -> ConstantDirections:
        """Constant directions of the parameters; its ``components`` are None if they are not constant."""
        found = ConstantDirections(self)
        if found.components is not None:
            for laws in self.laws:
                laws.use_affinity()
            self._found = {name: x for name, x in self._found.items() if name == "workspace"}
        return found

    def write(self, values: Mapping[str, float]) -> bool:
        """Write other values in place if the directions are constant; otherwise return False and keep the values.

        Raises:
            UnknownNameError, InputError: as ``make``, for invalid values.
        """
        values = {name: values[name] for name in self.values}
        mech = self.make(values)
        if not self.constant.agree(mech, values):
            return False
        self.mech, self.values = mech, values
        self.system.bind(mech)
        for p in self.all:
            p.write(mech, partial(perturbed_mechanism, self.make, values, p.name, values[p.name]))
        for name in ("perturbed_systems", "perturbed_friction"):
            vars(self).pop(name, None)
        self._found = {name: x for name, x in self._found.items() if name in REUSED}
        if "workspace" in self._found:
            self._found["workspace"][1].bind(mech)
        return True

    def _choose_width(self, p: Parameter, along: Sequence[RunPoint]) -> None:
        """Use a width at which differences of laws and rows are accurate along a run: effects of frequencies grow.

        Raises:
            InputError: if no width is accurate.
        """
        s = self.system

        def sampled(h: float) -> dict[int, Array]:
            mechanisms, found = p.perturbed_mechanisms(h), []
            laws, rows = LawDifferences(p, s, mechanisms), RowDifferences(p, s, mechanisms)
            for t, q, v, inner, mode in along:
                mask = np.ones(s.ng)
                mask[inactive_rows(s.mechanism.switches, mode)] = 0.0
                update_motions(s.model, s.workspace, q, v, np.zeros(s.nv))
                update_poses(s.model, s.workspace, q)
                active, forces = mask[rows.indices], rows.forces(t, mask)
                rates = [{k: x * active for k, x in kind.items()} for kind in (rows.rates(t, v), rows.biases(t, v))]
                kinds = [x for x in (laws.values(t, q, v, inner), forces, *rates) if x]
                found.append({k: np.concatenate([x[k].ravel() for x in kinds]) for k in mechanisms})
            return {k: np.array([x[k] for x in found]).T for k in mechanisms}

        found = converged_difference(sampled, p.h)
        if not found.discrepancy <= INTERPOLATION:
            raise InputError(f"parameter {p.name!r} has no derivative along this run: differences do not converge")
        p.use_width(found.h)

    def enter(self, mode: Mode) -> None:
        """Enter another mode; partials of its inactive rows are 0."""
        if mode == self.system.mode:
            return
        self.system.enter(mode)
        for p, laws in zip(self.all, self.laws, strict=True):
            for perturbed in laws.perturbed.values():
                for i, (other, _) in zip(p.forces, perturbed.bound, strict=False):
                    law = self.system.laws.bound[i][0]
                    if isinstance(law, KineticFrictionElement) and isinstance(other, KineticFrictionElement):
                        other.sign[:] = law.sign

    def workspace(self, formulation: str, native: ModuleType | None) -> Any:
        """Return a workspace shared by runs; a compiled one if the core is given and supports the mechanism."""

        def find() -> Any:
            with suppress(NotCompiled):
                if native:
                    return self.mech.system(formulation, native=native)
            return self.mech.system(formulation)

        return self.cached("workspace", (formulation, native), find)

    def cached(self, name: str, key: object, find: Callable[[], Any]) -> Any:
        """Return a cached value of this name if its key is the same; otherwise compute it."""
        if name not in self._found or self._found[name][0] != key:
            self._found[name] = key, find()
        return self._found[name][1]

    def force_partials(self, t: float, q: Array, v: Array, s: Array, vdot: Array, lam: Array) -> Array:
        """Return the partials of (f + G^T lam - M v', h, power) with respect to p, (nv + ns + 1, k)."""
        system, nv = self.system, self.system.nv
        out = np.zeros((nv + len(s) + 1, len(self)))
        if not len(self):
            return out
        if self.placement_tree:
            K = self.placement_tree.force_partials(t, q, v, vdot, lam) @ self.motions
            out[:nv] += K[:nv]
            out[-1] += K[-1]
        update_motions(system.model, system.workspace, q, v, vdot)
        J = update_poses(system.model, system.workspace, q)
        for i, p in enumerate(self.all):
            out[:nv, i] -= self._inertial(p, J) + p.armature * vdot + modal_partials(p, system, q, v, vdot)
        if any(laws.perturbed for laws in self.laws):
            update_motions(system.model, system.workspace, q, v, np.zeros(nv))
        for i, (laws, rows) in enumerate(zip(self.laws, self.rows, strict=True)):
            laws.add(out[:, i], t, q, v, s)
            rows.add_forces(out[:, i], t, lam)
        return out

    def friction_partials(self, q: Array, v: Array, lam: Array, rows: Array) -> Array:
        """Return the partials of friction that depends on multipliers, and of its power, (nv + ns + 1, k).

        They are differences of friction in perturbed mechanisms; lam (r,) are the multipliers of the rows in use.
        """
        out = np.zeros((self.system.nv + self.system.ns + 1, len(self)))
        for i, (p, systems) in enumerate(zip(self.all, self.perturbed_systems, strict=True)):
            if not (p.forces or p.specs or p.placements or p.frames):
                continue  # changes neither friction nor its geometry
            for s in systems.values():
                s.enter(self.system.mode)
            found = p.quotient({k: friction(s, q, v, lam, rows) for k, s in systems.items()})
            out[: self.system.nv, i], out[-1, i] = found[:-1], found[-1]
        return out

    @cached_property
    def perturbed_systems(self) -> list[dict[int, Index2System]]:
        """Workspaces of the perturbed mechanisms."""
        return [{k: Index2System(m) for k, m in p.perturbed.items()} for p in self.all]

    @cached_property
    def perturbed_friction(self) -> list[dict[int, ClosureFriction]]:
        """Closure friction with perturbed forces and closures, in the same workspace."""
        s, out = self.system, []
        for p in self.all:
            mechanisms = p.perturbed.items() if s.closure_friction.interfaces and (p.forces or p.specs) else ()
            rows = {k: Constraints(s.model, s.workspace, m.constraints) for k, m in mechanisms}
            out.append({k: ClosureFriction(m.forces, m.closures, rows[k]) for k, m in mechanisms})
        return out

    def row_partials(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return Q = d(G v + g_t)/dp and dg/dp, (ng, k) each."""
        Q, g = np.zeros((2, self.system.ng, len(self)))
        if self.placement_tree:
            B, G = self.placement_tree.rows(t, q, v)
            Q, g = B @ self.motions, G @ self.motions
        if any(rows.perturbed for rows in self.rows):
            update_poses(self.system.model, self.system.workspace, q)
            for i, rows in enumerate(self.rows):
                rows.add_rates(Q[:, i], g[:, i], t, v)
        Q[self.system.constraints.inactive] = g[self.system.constraints.inactive] = 0.0
        return Q, g

    def bias_partials(self, t: float, q: Array, v: Array) -> Array:
        """Return d gamma/dp, (ng, k)."""
        out = np.zeros((self.system.ng, len(self)))
        if self.placement_tree:
            out = self.placement_tree.bias(q, v) @ self.motions
        if any(rows.perturbed for rows in self.rows):
            update_motions(self.system.model, self.system.workspace, q, v, np.zeros(self.system.nv))
            for i, rows in enumerate(self.rows):
                rows.add_bias(out[:, i], t, v)
        out[self.system.constraints.inactive] = 0.0
        return out

    def _inertial(self, p: Parameter, J: Array) -> Array:
        """Return the derivative of M v' + nle by a parameter, (nv,), without armature; motions are current."""
        model, data, out = self.system.model, self.system.workspace, np.zeros(self.system.nv)
        for j in set(p.inertias) | (set(range(1, model.njoints)) if p.gravity.any() else set()):
            placement, wrench = data.oMi[j], np.zeros(6)
            if j in p.inertias:
                a = data.a[j] - placement.actInv(model.gravity)
                wrench += placement.act(pin.Force(pin.bodyRegressor(data.v[j], a) @ p.inertias[j])).vector
            wrench -= (placement.act(model.inertias[j]) * pin.Motion(p.gravity, np.zeros(3))).vector
            out += support(model, j) * (wrench @ J.reshape(6, -1))
        return out

    def require_directions(self, t: float, q: Array) -> None:
        """Reject a configuration where a force has no direction, in the mechanism or in a perturbed one.

        Raises:
            InputError: names the force.
        """
        self.system.inertia(t, q)
        for laws in (self.system.laws, *(x for p in self.laws for x in p.perturbed.values())):
            laws.require_directions()

    def require_consistent(self, t: float, q: Array) -> None:
        """Reject parameters that violate closures in a way that no motion can correct: redundant rows.

        Raises:
            InputError: names the parameter.
        """
        for name in self.inconsistent(t, q):
            raise InputError(f"parameter {name!r} violates redundant closures: no derivative exists")

    def inconsistent(self, t: float, q: Array) -> list[str]:
        """Return the names of parameters that violate redundant rows in a way that no motion can correct."""
        positional = self.system.constraints.positional
        g, G = self.row_partials(t, q, np.zeros(self.system.nv))[1][positional], self.system.jacobian(q)[positional]
        residual = np.abs(g + G @ np.linalg.lstsq(G, -g, rcond=RANK)[0]).max(axis=0, initial=0.0)
        limit = np.maximum(UNREACHABLE * np.abs(g).max(axis=0, initial=0.0), NEGLIGIBLE)
        return [p.name for p, out in zip(self.all, residual > limit, strict=True) if out]
