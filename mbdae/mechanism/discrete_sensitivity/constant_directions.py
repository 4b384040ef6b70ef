"""Parameters whose directions are constant: other values are written into existing workspaces and core data.

    theta(p) = theta(p_0) + D (p - p_0),   tau = C u   where D changes either C or u, not both

theta: inertial parameters of bodies, gravity, armature, and coefficients of linear laws: entries of C, polynomials u.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pinocchio as pin

from ...errors import MbdaeError
from ...system import Array
from ...tolerances import SOLUTION_ROUNDING
from ..forces.linear import LinearElement

if TYPE_CHECKING:
    from ..mechanism import Mechanism
    from .parameter_partials import Parameters

POINTS = ((1.0, 0.618), (-0.732, 0.414))  # in widths: signed change of the first parameter, ratio of the next


class Components(NamedTuple):
    """Numerical components of a mechanism, (n,), that may be linear in parameters.

    Attributes:
        numbers: the components.
        factors: for each component, twice the index of its law, plus 1 for entries of u; -1 for components of bodies.
        rest: all other properties of the laws.
    """

    numbers: Array
    factors: Array
    rest: list[Any]


class ConstantDirections:
    """Directions D (n, k) of the components that parameters change, valid for all values with which they `agree`.

    Args:
        parameters: bound parameters.
    """

    def __init__(self, parameters: "Parameters") -> None:
        self.mech, self.forces = parameters.mech, sorted({i for p in parameters.all for i in p.forces})
        self.values, self.workspace = np.array([*parameters.values.values()]), parameters.system.workspace
        self.components = self._components(self.mech) if _may_be_constant(parameters) else None
        if self.components is not None and not (self._differentiate(parameters) and self._agrees_nearby(parameters)):
            self.components = None

    def _differentiate(self, parameters: "Parameters") -> bool:
        """Determine D; return whether all components exist for nearby values and contain no product of parameters."""
        assert self.components is not None
        self.keeps_states = all(p.keeps_states for p in parameters.all)
        perturbed = [{k: self._components(m) for k, m in p.perturbed.items()} for p in parameters.all]
        if any(x is None or x.rest != self.components.rest for values in perturbed for x in values.values()):
            return False
        self.D = np.array([
            p.quotient({k: x.numbers for k, x in values.items() if x is not None})
            for p, values in zip(parameters.all, perturbed, strict=True)
        ]).T  # fmt: skip
        changed = set(self.components.factors[self.D.any(axis=1)].tolist())
        return not any(i >= 0 and i ^ 1 in changed for i in changed)

    def _agrees_nearby(self, parameters: "Parameters") -> bool:
        """Return whether D predicts the components where all parameters differ."""
        widths = np.array([p.width for p in parameters.all])
        for size, ratio in POINTS:
            values = self.values + size * ratio ** np.arange(len(widths)) * widths
            named = dict(zip(parameters.values, values.tolist(), strict=True))
            try:
                if not self.agree(parameters.make(named), named):
                    return False
            except MbdaeError:
                return False
        return True

    def agree(self, mech: "Mechanism", values: Mapping[str, float]) -> bool:
        """Return whether a mechanism with other values has the components that the directions predict."""
        if self.components is None or not self._has_same_other_components(mech):
            return False
        found = self._components(mech)
        if found is None or found.rest != self.components.rest:
            return False
        if self.keeps_states and mech.states != self.mech.states:
            return False
        change = np.array([*values.values()]) - self.values
        numbers, factors = self.components.numbers, self.components.factors
        size = np.abs(numbers) + np.abs(self.D) @ np.abs(change)
        for factor in set(factors.tolist()) - {-1}:  # coefficients of a curve have common rounding errors
            size[factors == factor] = size[factors == factor].max(initial=0.0)
        return bool((np.abs(found.numbers - numbers - self.D @ change) <= SOLUTION_ROUNDING * size).all())

    def _has_same_other_components(self, mech: "Mechanism") -> bool:
        """Return whether rows, placements and other forces are the same."""
        pairs = zip(mech.forces, self.mech.forces, strict=False)
        comparable = len(mech.forces) == len(self.mech.forces) and mech.constraints == self.mech.constraints
        if not comparable or any(a != b for i, (a, b) in enumerate(pairs) if i not in self.forces):
            return False
        return mech.model is self.mech.model or _placements(mech.model) == _placements(self.mech.model)

    def _components(self, mech: "Mechanism") -> Components | None:
        """Return the components of a mechanism; None if one of the laws is not linear."""
        model, data = mech.model, self.workspace
        numbers = [np.array([x.toDynamicParameters() for x in model.inertias]).ravel(), model.gravity.linear]
        numbers += [np.array(model.armature)]
        factors, rest = [np.full(sum(map(len, numbers)), -1)], list[Any]()
        for i, force in enumerate(mech.forces[i] for i in self.forces):
            law = None if callable(force) else force.bind(model, data)
            if not isinstance(law, LinearElement):
                return None
            signals = [_signal(u) for u in law.u]
            u_values = [x for _, values in signals for x in values]
            C_values = [x[-1] for x in law.terms]
            C_values += [x for s in law.springs for x in (s.stiffness, s.stiffness * s.rest)]
            numbers.append(np.array([*C_values, *u_values], float))
            factors += [np.full(len(C_values), 2 * i), np.full(len(u_values), 2 * i + 1)]
            rest.append([x[:-1] for x in law.terms] + [s[:2] for s in law.springs] + [fixed for fixed, _ in signals])
        return Components(np.concatenate(numbers), np.concatenate(factors), rest)


def _may_be_constant(parameters: "Parameters") -> bool:
    """Return whether the parameters change only these components, and may increase and decrease."""
    other = any(p.specs or p.placements or p.frames or p.modal or p.elastic or p.side for p in parameters.all)
    return bool(parameters.all) and parameters.mech.workspaces.pooled and not other


def _signal(u: Any) -> tuple[Any, Sequence[float]]:
    """Return the properties of a function of time that must not change, and coefficients in which it is linear."""
    data = u.core_data()
    if data["kind"] == "polynomials":
        return (tuple(data["b"]), data["degree"], data["period"]), [*data["a"], data["rise"]]
    if data["kind"] == "harmonic":
        amplitude, omega, phase, offset = data["a"]
        return (omega, phase), [amplitude, offset]
    return u, []


def _placements(model: pin.Model) -> list[Any]:
    """Return joints, and all placements of joints and frames."""
    placed = [*model.jointPlacements, *(f.placement for f in model.frames)]
    return [list(model.joints), list(model.names), [x.homogeneous.tolist() for x in placed]]
