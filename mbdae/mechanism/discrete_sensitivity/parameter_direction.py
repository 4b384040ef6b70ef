"""One parameter of a mechanism as a direction in its components, found from mechanisms with other values."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from ...errors import InputError
from ...finite_differences import (
    ABOVE,
    BELOW,
    MAX_REDUCTIONS,
    REDUCTION,
    STENCIL,
    central_difference,
    converged_difference,
)
from ...system import Array
from ...tolerances import SUM_ROUNDING
from ..closures.constraints import Constraints
from ..forces import bind_forces
from ..formulations.index2 import Index2System

if TYPE_CHECKING:
    from ..mechanism import Mechanism

WIDTH, SMALL = 1e-2, 1e-3  # of the value; and in its unit, where it is zero: also moves positions of centimetres
KNOT_WIDTH = 1e-5  # of the value, where it is a time between polynomials of a curve
FIRST = {STENCIL: (-3, 1, 3), ABOVE: (2, 4, 6), BELOW: (-2, -4, -6)}  # times h: the ends; with 0 they detect degree 2


class PerturbedMechanisms(Mapping[int, "Mechanism"]):
    """Mechanisms with a parameter changed by k h, at the points of a difference stencil, created on demand."""

    def __init__(self, make: Callable[[float], "Mechanism"], h: float, places: tuple[int, ...]) -> None:
        self.make, self.h, self.places = make, h, places

    def __getitem__(self, k: int) -> "Mechanism":
        return self.make(k * self.h)

    def __iter__(self) -> Iterator[int]:
        return iter(self.places)

    def __len__(self) -> int:
        return len(self.places)


def _structure(model: pin.Model) -> tuple[list[str], list[Any]]:
    """Return the names of joints and frames, and the kinds of joints."""
    return [*model.names, *(f.name for f in model.frames)], list(model.joints)


def possible(make: Callable[[float], "Mechanism"], h: float) -> tuple[float, tuple[int, ...]]:
    """Return a width at which mechanisms exist, on both sides or else on one (small bodies limit inertias).

    Args:
        make: creates the mechanism with a parameter changed by the given amount.
        h: the largest width.

    Returns:
        the width, and a stencil as `mbdae.finite_differences.central_difference` takes it; the given width and the
        two-sided stencil if there are mechanisms on neither side.
    """
    for places, first in FIRST.items():
        for i in range(MAX_REDUCTIONS):
            with suppress(InputError):
                _ = [make(k * h / REDUCTION**i) for k in first]
                return h / REDUCTION**i, places
    return h, STENCIL


class Parameter:
    """A parameter as a direction in a mechanism's components.

    Args:
        name: for messages.
        mech: the mechanism.
        make: creates the mechanism with the parameter changed by the given amount.
        width: the largest width of differences.

    Attributes:
        h: the width for laws and rows.
        near: the mechanisms with the parameter changed by k h.
        places_beside: those k; one-sided where there are no mechanisms on the other side.
    """

    def __init__(self, name: str, mech: "Mechanism", make: Callable[[float], "Mechanism"], width: float) -> None:
        self.name, self.mech, self.make = name, mech, cache(make)
        self.width, self.places_beside = possible(self.make, width)
        self.use(self.width)
        self.first, model = [self.near[k] for k in FIRST[self.places_beside]], mech.model
        self._require_same_structure()
        self.inertias = self.each(model.njoints, lambda m, j: np.array(m.model.inertias[j].toDynamicParameters()))
        self.places = self.moved(mech, model.njoints, lambda m, j: m.model.jointPlacements[j])
        self.frames = self.moved(mech, model.nframes, lambda m, i: m.model.frames[i].placement)
        self.gravity = self.rate(lambda m: m.model.gravity.linear)
        self.armature = self.rate(lambda m: m.model.armature)
        self.forces = self.changed(mech.forces, lambda m: m.forces)
        self._require_same_sampling()
        self.specs = self.changed(mech.constraints, lambda m: m.constraints)
        for i in self.forces:
            self._held(*self._forces(i))
        for i in self.specs:
            self._held(*(m.constraints[i] for m in (mech, *self.first)))

    def _require_same_structure(self) -> None:
        """Reject changes of the joints, of the frames and of the states of forces."""
        mech, name = self.mech, self.name
        names, joints = _structure(mech.model)
        for other in (m.model for m in self.first):
            other_names, other_joints = _structure(other)
            if other_names != names or (other.damping != mech.model.damping).any():
                raise InputError(f"parameter {name!r} changes joints, frames or their damping: it has no derivative")
            if other_joints != joints:
                raise InputError(f"parameter {name!r} turns a joint's axis: it has no derivative, its placement has")
        if any(list(m.states) != list(mech.states) for m in self.first):
            raise InputError(f"parameter {name!r} changes what states forces have: it has no derivative there")

    def _require_same_sampling(self) -> None:
        """Reject changes of the instants at which controllers sample."""
        for i in self.forces:
            instants = {(getattr(x, "rate", 0), getattr(x, "offset", 0)) for x in self._forces(i)}
            if len(instants) > 1:
                name = getattr(self.mech.forces[i], "name", "")
                raise InputError(f"parameter {self.name!r} moves the instants of {name!r}: no derivative")

    def _forces(self, i: int) -> list[Any]:
        return [m.forces[i] for m in (self.mech, *self.first)]

    def use(self, h: float) -> None:
        """Use differences of this width."""
        self.h, self.near = h, self.beside(h)

    def beside(self, h: float) -> PerturbedMechanisms:
        """Return the mechanisms with it changed by k h."""
        return PerturbedMechanisms(self.make, h, self.places_beside)

    @property
    def side(self) -> str:
        """Description of the side of a one-sided derivative; empty if it is two-sided."""
        return {STENCIL: "", ABOVE: "above", BELOW: "below"}[self.places_beside]

    @property
    def keeps_start(self) -> bool:
        """Whether the assembled start does not depend on it: it changes gravity, or laws of forces, alone."""
        moves = self.inertias or self.places or self.frames or self.specs or self.armature.any()
        mech = self.mech
        return not moves and all((m.start_values, m.states) == (mech.start_values, mech.states) for m in self.first)

    def _held(self, own: Any, *others: Any) -> None:
        """Reject changes of times at which a signal jumps; changes of other knots affect few points."""
        if any(_times(x, "breaks") != _times(own, "breaks") for x in others):
            raise InputError(f"parameter {self.name!r} moves the instants of {own.name!r}: no derivative")
        if any(_times(x, "knots") != _times(own, "knots") for x in others):
            self.use(min(self.h, KNOT_WIDTH * self.width / WIDTH))

    def changed(self, own: Sequence[Any], of: Callable[["Mechanism"], Sequence[Any]]) -> list[int]:
        """Return the indices of the forces, or of the closures and drivers, that it changes."""
        if any(len(of(m)) != len(own) for m in self.first):
            raise InputError(f"parameter {self.name!r} changes how many forces or closures there are")
        return [i for i, x in enumerate(own) if any(of(m)[i] != x for m in self.first)]

    def quotient(self, values: Mapping[int, Array]) -> Array:
        """Return the sixth-order difference of values at k h; exactly zero where they do not change."""
        return np.array(central_difference(values, self.h))

    def rate(self, value: Callable[["Mechanism"], Array]) -> Array:
        """Return the derivative of a component of a mechanism: from the first values where these are exact."""
        (a, b, c), here = (value(m) for m in self.first), value(self.mech)
        size = np.abs(here) + np.abs(b) + np.abs(c)
        if not self.side and (np.abs(2 * c - 9 * b + 8 * here - a) <= SUM_ROUNDING * size).all():
            return np.array((c - a) / (6 * self.h))
        if self.side and (np.abs(c - 3 * b + 3 * a - here) <= SUM_ROUNDING * size).all():
            return np.array((4 * a - b - 3 * here) / ((4 if self.side == "above" else -4) * self.h))
        return converged_difference(lambda h: {k: value(m) for k, m in self.beside(h).items()}, self.width).derivative

    def each(self, n: int, value: Callable[["Mechanism", int], Array]) -> dict[int, Array]:
        """Return the derivatives of the components 1 to n - 1 of a mechanism that change."""
        found = {i: self.rate(lambda m, i=i: value(m, i)) for i in range(1, n)}  # type: ignore[misc]
        return {i: d for i, d in found.items() if d.any()}

    def moved(self, mech: "Mechanism", n: int, place: Callable[["Mechanism", int], pin.SE3]) -> dict[int, Array]:
        """Return the motions (6,) of changing placements, in their own axes."""
        found = self.each(n, lambda m, i: place(m, i).homogeneous)
        twists = {i: place(mech, i).inverse().homogeneous @ d for i, d in found.items()}
        return {i: np.array([*T[:3, 3], T[2, 1], T[0, 2], T[1, 0]]) for i, T in twists.items()}


class LawDifferences:
    """The forces that a parameter changes, with their perturbed values, in one workspace."""

    def __init__(self, p: Parameter, s: Index2System, near: PerturbedMechanisms) -> None:
        self.p, self.nv = p, s.nv
        spans = [at for i, (_, at) in enumerate(s.laws.bound) if i in p.forces]
        self.at = np.array([i for at in spans for i in range(at.start, at.stop)], int)
        beside = near.items() if p.forces else ()
        self.near = {k: bind_forces([m.forces[i] for i in p.forces], s.model, s.workspace) for k, m in beside}

    def values(self, t: float, q: Array, v: Array, s: Array) -> dict[int, Array]:
        """Return (tau, s', power) with the perturbed values, (nv + ns + 1,)."""
        return {k: np.concatenate(f.torque(t, q, v, s[self.at])) for k, f in self.near.items()}

    def add(self, to: Array, t: float, q: Array, v: Array, s: Array) -> None:
        """Add the partial derivatives of (tau, s', power), (nv + ns + 1,)."""
        if self.near:
            found = self.p.quotient(self.values(t, q, v, s))
            to[: self.nv] += found[: self.nv]
            to[self.nv + self.at] += found[self.nv : -1]
            to[-1] += found[-1]


class RowDifferences:
    """The closures and drivers that a parameter changes, with their perturbed values, in one workspace."""

    def __init__(self, p: Parameter, s: Index2System, near: PerturbedMechanisms) -> None:
        self.p, self.nv = p, s.nv
        spans = [s.constraints.spans[s.mechanism.constraints[i].name] for i in p.specs]
        self.at = np.array([i for at in spans for i in range(at.start, at.stop)], int)
        beside = near.items() if p.specs else ()
        self.near = {k: Constraints(s.model, s.workspace, [m.constraints[i] for i in p.specs]) for k, m in beside}

    def forces(self, t: float, lam: Array) -> dict[int, Array]:
        """Return (G^T lam, lam . u') with the perturbed values, (nv + 1,)."""
        own = lam[self.at]
        return {k: np.append(own @ c.jacobian(), own @ c.motion(t)[1]) for k, c in self.near.items()}

    def rates(self, t: float, v: Array) -> dict[int, Array]:
        """Return G v + g_t and g with the perturbed values, (2, r)."""
        out = {}
        for k, c in self.near.items():
            value, G = c.value(t)
            out[k] = np.array([G @ v - c.motion(t)[1], value])
        return out

    def add_forces(self, to: Array, t: float, lam: Array) -> None:
        """Add the partial derivatives of G^T lam and of the drivers' power lam . u'; J must be current."""
        if self.near:
            derivative = self.p.quotient(self.forces(t, lam))
            to[: self.nv] += derivative[:-1]
            to[-1] += derivative[-1]

    def add_rates(self, Q: Array, g: Array, t: float, v: Array) -> None:
        """Add the partial derivatives of G v + g_t and of g; J must be current."""
        if self.near:
            rate, value = self.p.quotient(self.rates(t, v))
            Q[self.at] += rate
            g[self.at] += value

    def add_bias(self, to: Array, t: float, v: Array) -> None:
        """Add the partial derivatives of gamma; velocities must be current, with accelerations for v' = 0."""
        if self.near:
            to[self.at] += self.p.quotient(self.biases(t, v))

    def biases(self, t: float, v: Array) -> dict[int, Array]:
        """Return gamma with the perturbed values, (r,)."""
        return {k: c.bias(v) - c.motion(t)[2] for k, c in self.near.items()}


def _times(x: Any, kind: str) -> list[float]:
    """Return the breaks, or the knots, of the signals of a force, closure or driver."""
    parts = x if isinstance(x, tuple) else vars(x).values()
    return [t for signal in parts if hasattr(signal, kind) for t in getattr(signal, kind)]
