"""A parameter of a mechanism as a direction in its components, by differences of mechanisms with other values."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from ...errors import InputError
from ...finite_differences import ABOVE, AFFINE_STENCIL, BELOW, STENCIL, central_difference, converged_difference
from ...system import Array
from ...tolerances import SUM_ROUNDING
from ..closures.constraints import Constraints
from ..forces import bind_forces
from ..formulations.index2 import Index2System
from .modal_direction import changes_elasticity, modal_rates
from .perturbed_mechanisms import TRIAL_POINTS, PerturbedMechanisms, feasible_stencil

if TYPE_CHECKING:
    from ..mechanism import Mechanism

WIDTH, SMALL = 1e-2, 1e-3  # fraction of the value; width in its unit if the value is zero
KNOT_WIDTH = 1e-5  # fraction of the value of a time between polynomials of a curve


def _structure(model: pin.Model) -> tuple[list[str], list[Any]]:
    """Return the names of joints and frames, and the kinds of joints."""
    return [*model.names, *(f.name for f in model.frames)], list(model.joints)


class Parameter:
    """A parameter as a direction in a mechanism's components.

    Args:
        name: name of the parameter, for messages.
        mech: the mechanism.
        make: creates the mechanism with the parameter changed by the given amount.
        width: the largest width of differences.

    Attributes:
        h: the width for laws and rows.
        perturbed: the mechanisms with the parameter changed by k h.
        stencil: the values of k; one-sided if there are no mechanisms on the other side.
    """

    def __init__(self, name: str, mech: "Mechanism", make: Callable[[float], "Mechanism"], width: float) -> None:
        self.name, self.mech, self.make = name, mech, cache(make)
        self.width, self.stencil = feasible_stencil(self.make, width)
        self.use_width(self.width)
        model = mech.model
        self._require_same_structure()
        self.inertias = self.changed_rates(
            model.njoints, lambda m, j: np.array(m.model.inertias[j].toDynamicParameters())
        )
        self.placements = self.placement_motions(mech, model.njoints, lambda m, j: m.model.jointPlacements[j])
        self.frames = self.placement_motions(mech, model.nframes, lambda m, i: m.model.frames[i].placement)
        self.gravity = self.rate(lambda m: m.model.gravity.linear)
        self.armature = self.rate(lambda m: m.model.armature)
        self.forces = self.changed_items(mech.forces, lambda m: m.forces)
        self.modal, self.elastic = modal_rates(self), changes_elasticity(self)
        self._require_same_sampling()
        self.specs = self.changed_items(mech.constraints, lambda m: m.constraints)
        for i in self.forces:
            self._check_times(*self._forces(i))
        for i in self.specs:
            self._check_times(*(m.constraints[i] for m in (mech, *self.trials)))

    def write(self, mech: "Mechanism", make: Callable[[float], "Mechanism"]) -> None:
        """Use a mechanism with other values of the parameters and the same directions."""
        _ = self.keeps_start, self.keeps_states  # cached: they hold for all values
        self.mech, self.make = mech, cache(make)
        vars(self).pop("trials", None)
        self.use_width(self.h)

    @cached_property
    def trials(self) -> list["Mechanism"]:
        """Three mechanisms with the parameter changed, at `TRIAL_POINTS`."""
        return [self.perturbed_mechanisms(self.width)[k] for k in TRIAL_POINTS[self.stencil]]

    def _require_same_structure(self) -> None:
        """Reject changes of joints, of frames and of the states of forces."""
        mech, name = self.mech, self.name
        names, joints = _structure(mech.model)
        for other in (m.model for m in self.trials):
            other_names, other_joints = _structure(other)
            if other_names != names or (other.damping != mech.model.damping).any():
                raise InputError(f"parameter {name!r} changes joints, frames or their damping: it has no derivative")
            if other_joints != joints:
                text = "changes the axis of a joint: there is no derivative; change the placement of the joint instead"
                raise InputError(f"parameter {name!r} {text}")
        if any(list(m.states) != list(mech.states) for m in self.trials):
            raise InputError(f"parameter {name!r} changes which states forces have: it has no derivative there")

    def _require_same_sampling(self) -> None:
        """Reject changes of the instants at which controllers sample."""
        for i in self.forces:
            instants = {(getattr(x, "rate", 0), getattr(x, "offset", 0)) for x in self._forces(i)}
            if len(instants) > 1:
                name = getattr(self.mech.forces[i], "name", "")
                raise InputError(f"parameter {self.name!r} changes the sampling times of {name!r}: no derivative")

    def _forces(self, i: int) -> list[Any]:
        return [m.forces[i] for m in (self.mech, *self.trials)]

    def use_width(self, h: float) -> None:
        """Use differences of this width."""
        self.h, self.perturbed = h, self.perturbed_mechanisms(h)

    def perturbed_mechanisms(self, h: float) -> PerturbedMechanisms:
        """Return the mechanisms with the parameter changed by k h."""
        return PerturbedMechanisms(self.make, h, self.stencil)

    @property
    def side(self) -> str:
        """Description of the side of a one-sided derivative; empty if it is two-sided."""
        return {STENCIL: "", ABOVE: "above", BELOW: "below"}[self.stencil]

    @property
    def changes_elements(self) -> bool:
        """Whether the parameter changes closures, drivers or laws, including elasticity."""
        return bool(self.forces or self.specs or self.elastic)

    @cached_property
    def keeps_start(self) -> bool:
        """Whether the assembled start does not depend on the parameter: it changes only gravity or force laws."""
        changes = self.inertias or self.modal or self.placements or self.frames or self.specs or self.armature.any()
        mech = self.mech
        return not changes and all((m.start_values, m.states) == (mech.start_values, mech.states) for m in self.trials)

    @cached_property
    def keeps_states(self) -> bool:
        """Whether the start values of states do not depend on the parameter."""
        return all(m.states == self.mech.states for m in self.trials)

    def _check_times(self, spec: Any, *perturbed: Any) -> None:
        """Reject changes of times at which a function jumps; if other knots change, use a smaller width."""
        if any(_times(x, "nonsmooth_times") != _times(spec, "nonsmooth_times") for x in perturbed):
            raise InputError(f"parameter {self.name!r} changes the times of jumps of {spec.name!r}: no derivative")
        if any(_times(x, "knots") != _times(spec, "knots") for x in perturbed):
            self.use_width(min(self.h, KNOT_WIDTH * self.width / WIDTH))

    def changed_items(self, items: Sequence[object], items_of: Callable[["Mechanism"], Sequence[Any]]) -> list[int]:
        """Return the indices of the forces, or of the closures and drivers, that the parameter changes."""
        if any(len(items_of(m)) != len(items) for m in self.trials):
            raise InputError(f"parameter {self.name!r} changes the number of forces or closures")
        return [i for i, x in enumerate(items) if any(items_of(m)[i] != x for m in self.trials)]

    def quotient(self, values: Mapping[int, Array]) -> Array:
        """Return the sixth-order difference of values at k h; exactly zero if they do not change."""
        return np.array(central_difference(values, self.h))

    def rate(self, value: Callable[["Mechanism"], Array]) -> Array:
        """Return the derivative of a component of a mechanism; from three values if these are exact."""
        (a, b, c), nominal = (value(m) for m in self.trials), value(self.mech)
        size = np.abs(nominal) + np.abs(b) + np.abs(c)
        if not self.side and (np.abs(2 * c - 9 * b + 8 * nominal - a) <= SUM_ROUNDING * size).all():
            return np.array((c - a) / (6 * self.h))
        if self.side and (np.abs(c - 3 * b + 3 * a - nominal) <= SUM_ROUNDING * size).all():
            return np.array((4 * a - b - 3 * nominal) / ((4 if self.side == "above" else -4) * self.h))

        def values(h: float) -> dict[int, Array]:
            return {k: value(m) for k, m in self.perturbed_mechanisms(h).items()}

        return converged_difference(values, self.width).derivative

    def changed_rates(self, n: int, value: Callable[["Mechanism", int], Array]) -> dict[int, Array]:
        """Return the nonzero derivatives of the components 1 to n - 1 of a mechanism, by index."""
        found = {i: self.rate(lambda m, i=i: value(m, i)) for i in range(1, n)}  # type: ignore[misc]
        return {i: d for i, d in found.items() if d.any()}

    def placement_motions(
        self, mech: "Mechanism", n: int, placement: Callable[["Mechanism", int], pin.SE3]
    ) -> dict[int, Array]:
        """Return the motions (6,) of changing placements, in local axes."""
        rates = self.changed_rates(n, lambda m, i: placement(m, i).homogeneous)
        twists = {i: placement(mech, i).inverse().homogeneous @ d for i, d in rates.items()}
        return {i: np.array([*T[:3, 3], T[2, 1], T[0, 2], T[1, 0]]) for i, T in twists.items()}


class LawDifferences:
    """The forces that a parameter changes, with their perturbed values, in one workspace."""

    def __init__(self, p: Parameter, s: Index2System, mechanisms: PerturbedMechanisms) -> None:
        self.p, self.nv = p, s.nv
        spans = [span for i, (_, span) in enumerate(s.laws.bound) if i in p.forces]
        self.indices = np.array([i for span in spans for i in range(span.start, span.stop)], int)
        perturbed = mechanisms.items() if p.forces or p.elastic else ()
        self.perturbed = {
            k: bind_forces([m.forces[i] for i in p.forces], s.model, s.workspace, m.model) for k, m in perturbed
        }

    def use_affinity(self) -> None:
        """Use only two of the values, for laws that are affine in the parameter."""
        self.perturbed = {k: x for k, x in self.perturbed.items() if k in AFFINE_STENCIL}

    def values(self, t: float, q: Array, v: Array, s: Array) -> dict[int, Array]:
        """Return (tau, s', power) with the perturbed values, (nv + ns + 1,)."""
        return {k: np.concatenate(f.generalized_force(t, q, v, s[self.indices])) for k, f in self.perturbed.items()}

    def add(self, out: Array, t: float, q: Array, v: Array, s: Array) -> None:
        """Add the partial derivatives of (tau, s', power), (nv + ns + 1,)."""
        if self.perturbed:
            found = self.p.quotient(self.values(t, q, v, s))
            out[: self.nv] += found[: self.nv]
            out[self.nv + self.indices] += found[self.nv : -1]
            out[-1] += found[-1]


class RowDifferences:
    """The closures and drivers that a parameter changes, with their perturbed values, in one workspace."""

    def __init__(self, p: Parameter, s: Index2System, mechanisms: PerturbedMechanisms) -> None:
        self.p, self.nv = p, s.nv
        spans = [s.constraints.spans[s.mechanism.constraints[i].name] for i in p.specs]
        self.indices = np.array([i for span in spans for i in range(span.start, span.stop)], int)
        perturbed = mechanisms.items() if p.specs else ()
        self.perturbed = {
            k: Constraints(s.model, s.workspace, [m.constraints[i] for i in p.specs]) for k, m in perturbed
        }

    def forces(self, t: float, lam: Array) -> dict[int, Array]:
        """Return (G^T lam, lam . u') with the perturbed values, (nv + 1,)."""
        x = lam[self.indices]
        return {k: np.append(x @ c.jacobian(), x @ c.motion(t)[1]) for k, c in self.perturbed.items()}

    def rates(self, t: float, v: Array) -> dict[int, Array]:
        """Return G v + g_t and g with the perturbed values, (2, r)."""
        out = {}
        for k, c in self.perturbed.items():
            value, G = c.value(t)
            out[k] = np.array([G @ v - c.motion(t)[1], value])
        return out

    def add_forces(self, out: Array, t: float, lam: Array) -> None:
        """Add the partial derivatives of G^T lam and of the drivers' power lam . u'; J must be current."""
        if self.perturbed:
            derivative = self.p.quotient(self.forces(t, lam))
            out[: self.nv] += derivative[:-1]
            out[-1] += derivative[-1]

    def add_rates(self, Q: Array, g: Array, t: float, v: Array) -> None:
        """Add the partial derivatives of G v + g_t and of g; J must be current."""
        if self.perturbed:
            rate, value = self.p.quotient(self.rates(t, v))
            Q[self.indices] += rate
            g[self.indices] += value

    def add_bias(self, out: Array, t: float, v: Array) -> None:
        """Add the partial derivatives of gamma; velocities must be current, with accelerations for v' = 0."""
        if self.perturbed:
            out[self.indices] += self.p.quotient(self.biases(t, v))

    def biases(self, t: float, v: Array) -> dict[int, Array]:
        """Return gamma with the perturbed values, (r,)."""
        return {k: c.bias(v) - c.motion(t)[2] for k, c in self.perturbed.items()}


def _times(x: object, kind: str) -> list[float]:
    """Return the nonsmooth times, or the knots, of the functions of time of a force, closure or driver."""
    values = x if isinstance(x, tuple) else vars(x).values()
    return [t for u in values if hasattr(u, kind) for t in getattr(u, kind)]
