"""Evaluation of a cost and its gradient: from a run, or a curve of poses, of a mechanism with given parameters."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np

from ... import backend
from ...callbacks import call_and_report, values_text
from ...errors import InputError, is_number
from ...integrate.solve import solve
from ...mechanism import Mechanism
from ...mechanism.discrete_sensitivity.parameter_partials import Parameters
from ...solution.solution import Solution, uninterrupted
from ...system import Array
from ..factories import MechanismFactory
from ..kinematics.curve_derivatives import CurveSignals, require_monotonic
from ..kinematics.driven_mechanism import driven_mechanism
from ..kinematics.kinematics import kinematics
from ..kinematics.result import Kinematics
from ..sensitivity.cost import Cost, NamedCost, cost_name, evaluated
from ..sensitivity.gradient import RunCost, adjoint_gradients, run_cost
from ..sensitivity.run_parameters import VaryingParameters
from ..sweep.sweep_run import check_settings


class CostEvaluation(NamedTuple):
    """A cost, and a function that computes its derivatives with respect to the parameters, (k,)."""

    value: float
    derivatives: Callable[[], Array]


class SignalsAndParameters(Mapping[str, Any]):
    """Signals, and the parameters by name."""

    def __init__(self, signals: Mapping[str, Array], values: Mapping[str, float]) -> None:
        self.signals, self.values_of = signals, values

    def __getitem__(self, name: str) -> Any:
        return self.values_of[name] if name in self.values_of else self.signals[name]

    def __iter__(self) -> Iterator[str]:
        return iter([*self.values_of, *self.signals])

    def __len__(self) -> int:
        return len(self.values_of) + len(self.signals)


class _CostOfParameters(NamedCost):
    """A cost that stores its explicit derivatives with respect to the parameters separately."""

    def __init__(self, cost: Cost, values: Mapping[str, float], label: str) -> None:
        self.cost, self.values, self.explicit = cost, values, np.zeros(len(values))
        self.label = label or cost_name(cost)

    def __call__(self, signals: Mapping[str, Array]) -> Any:
        known = SignalsAndParameters(signals, self.values)
        found = call_and_report(self.label, lambda: self.cost(known), lambda: values_text(self.values))
        if not (isinstance(found, tuple | list) and len(found) == 2 and isinstance(found[1], Mapping)):
            return found
        explicit = {name: x for name, x in found[1].items() if name in self.values}
        for name, x in explicit.items():
            if not is_number(x):
                raise InputError(f"{self.label}: its derivative with respect to {name!r} is a number, got {x!r:.60}")
        self.explicit = np.array([float(explicit.get(name, 0.0)) for name in self.values])
        return found[0], {name: x for name, x in found[1].items() if name not in explicit}


@dataclass(frozen=True)
class RunMotion:
    """A run; the gradients of all its costs come from one adjoint sweep.

    Attributes:
        result: the run.
        parameters: parameters of the mechanism, for all runs.
        values: values of the parameters in this run.
        costs: evaluated costs.
        gradients: gradients of the first of these costs with respect to the parameters.
    """

    result: Solution
    parameters: VaryingParameters
    values: dict[str, float]
    costs: list[RunCost] = field(default_factory=list)
    gradients: list[Array] = field(default_factory=list)

    @property
    def bound(self) -> int:
        """Number of times that parameters were bound to runs, see `Optimum`."""
        return self.parameters.bound

    def evaluate(self, cost: Cost, label: str = "") -> CostEvaluation:
        """Evaluate a cost and its gradient; ``label`` is its name in messages."""
        function = _CostOfParameters(cost, self.values, label)
        found, i = run_cost(self.parameters.trajectory(self.result, self.values), function), len(self.costs)
        self.costs.append(found)  # gradients are computed at points where the search requests them
        return CostEvaluation(found.value, lambda: function.explicit + self._gradient(i))

    def _gradient(self, i: int) -> Array:
        if i >= len(self.gradients):
            trajectory = self.parameters.trajectory(self.result, self.values)
            pending = self.costs[len(self.gradients) :]
            self.gradients.extend(np.array(list(x.values())) for x in adjoint_gradients(trajectory, pending))
        return self.gradients[i]


@dataclass(frozen=True)
class CurveMotion:
    """A curve of poses; gradients are those of poses at fixed inputs.

    Attributes:
        result: the curve.
        make: factory of mechanisms whose last driver is the input.
        values: values of the parameters.
    """

    result: Kinematics
    make: Callable[[Mapping[str, float]], Mechanism]
    values: dict[str, float]

    bound = 0  # parameters are not bound to runs

    @cached_property
    def signals(self) -> CurveSignals:
        """Signals with their derivatives."""
        return CurveSignals(self.result, self._make_parameters)

    def _make_parameters(self) -> Parameters:
        found = Parameters(self.make, self.values, backend.load())
        found.require_consistent(float(self.result.u[0]), self.result.q[0])
        return found

    def evaluate(self, cost: Cost, label: str = "") -> CostEvaluation:
        """Evaluate a cost and its gradient; ``label`` is its name in messages."""
        function = _CostOfParameters(cost, self.values, label)
        value, derivatives = evaluated(function, self.signals, len(self.result.u))
        return CostEvaluation(
            value, lambda: function.explicit + sum(x @ self.signals.derivative(n) for n, x in derivatives.items())
        )


class Motion(Protocol):
    """A computed motion, of which costs and constraints are functions."""

    @property
    def result(self) -> Solution | Kinematics:
        """The run or the curve."""

    @property
    def bound(self) -> int:
        """Number of times that parameters were bound to runs, see `Optimum`."""

    def evaluate(self, cost: Any, label: str = "") -> CostEvaluation:
        """Evaluate a cost and its gradient; ``label`` is its name in messages."""


ComputeMotion = Callable[[dict[str, float]], Motion]


def run_function(
    factory: MechanismFactory, t_span: tuple[float, float] | None, settings: Mapping[str, Any]
) -> ComputeMotion:
    """Return a function that runs a mechanism with given parameters.

    Raises:
        UnknownNameError: for an unknown setting.
        InputError: for an incomplete run; KeyboardInterrupt for an interrupted one.
    """
    check_settings(settings, excluded=("problem", "t_span", "progress"))
    parameters = VaryingParameters(factory)

    def run(values: dict[str, float]) -> RunMotion:
        mech = factory.make(values)
        span = (0.0, mech.duration) if t_span is None else t_span
        sol = uninterrupted(solve(mech, span, **settings))
        if not sol.ended:
            raise InputError(f"the run ends at t = {sol.nodes[0][-1]:.6g}: {sol.message}")
        return RunMotion(sol, parameters, values)

    return run


def curve_function(
    factory: MechanismFactory, drive: str, first: Mechanism, options: Mapping[str, Any]
) -> ComputeMotion:
    """Return a function that traces the poses of a mechanism with given parameters over the inputs of the first curve.

    Raises:
        UnknownNameError: for an unknown setting.
        InputError: for an input that reverses, or a parameter that violates redundant rows.
    """
    check_settings(options, kinematics, ("mech", "drive"))
    first_curve = kinematics(first, drive, **options)
    span = options.get("span") or (float(first_curve.u[0]), float(first_curve.u[-1]))
    require_monotonic(first_curve, span)
    columns = first_curve.signals()
    hold = {name: float(columns[f"q.{name}"][0]) for name in first_curve.locked if f"q.{name}" in columns}
    fixed = {**options, "span": span, "hold": hold}

    def curve_motion(values: dict[str, float]) -> CurveMotion:
        found = kinematics(factory.make(values), drive, **fixed)
        require_monotonic(found, span)

        def driven(parameters: Mapping[str, float]) -> Mechanism:
            return driven_mechanism(factory.make(parameters), drive, hold, found.q[0])

        return CurveMotion(found, driven, values)

    return curve_motion
