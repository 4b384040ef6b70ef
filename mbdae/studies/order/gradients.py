"""Verification of derivatives of runs: agreement with difference quotients, and order of convergence.

There are two checks for each method. Its tangent at the coarsest steps is compared with difference quotients of runs
with the same steps, of order six and several widths; the smallest difference counts, since larger ones are dominated by
truncation or rounding. And the tangents must converge with the step size to the derivative of the motion with the
order of the method, by the rules of `mbdae.studies.order.measurement`.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...data_types import JsonObject
from ...errors import InputError, as_list, is_count
from ...finite_differences import STENCIL, central_difference
from ...integrate.options.span import checked_span
from ...integrate.run.run_setup import common_backend
from ...integrate.solve import solve
from ...integrate.trajectory.differentiable_runs import DIFFERENTIABLE
from ...mechanism import Mechanism, ModelSource
from ...mechanism.discrete_sensitivity.perturbed_mechanisms import feasible_stencil
from ...mechanism.formats.mechanism_file.parameter_units import parameter_units
from ...mechanism.tree.coordinate_units import quantity_units
from ...methods import METHODS, Method
from ...methods import method as find_method
from ...solution.problem import mechanism_of
from ...solution.solution import Solution
from ...system import Array
from ...tolerances import COINCIDENT, EPS, NEGLIGIBLE, THREE_DIGITS
from ...units import common_unit, quantity, substituted
from ..factories import factory_of
from ..sensitivity.sensitivity import sensitivity
from .measurement import MIN_OUTPUTS, Measurement, Progress, run_until_interrupted
from .result import OrderStudy

__all__ = ["check_gradients"]

SIGNIFICANT = 10.0  # multiple of the spread of the quotients above which a difference is significant
WIDTHS = (3e-4, 1e-3, 3e-3)  # widths of quotients, relative to the parameter
MAX_REFINEMENT = 4  # largest multiple of the coarsest number of steps, if coarser runs fail
MIN_VELOCITY = NEGLIGIBLE  # admissible part of a random velocity, below which there is no degree of freedom


@dataclass(frozen=True)
class GradientStudy(OrderStudy):
    """Result of `check_gradients`: an order study of the derivatives of q and v, extended by checks of the tangents.

    Attributes:
        of: name of the parameter.
        differences: differences between tangent and difference quotients by method, relative to the largest derivative,
            or to a thousandth of the largest |q| or |v| divided by the parameter, if larger; nan if no run finishes.
        uncertainties: differences of the two best difference quotients by method, relative to the same scale.
    """

    of: str = ""
    differences: dict[str, float] = field(default_factory=dict)
    uncertainties: dict[str, float] = field(default_factory=dict)

    def is_refuted(self, name: str) -> bool:
        """Return whether difference quotients refute a method's tangent."""
        return self.differences[name] > max(COINCIDENT, SIGNIFICANT * self.uncertainties[name])

    @property
    def holds(self) -> bool:
        """Whether every tangent is exact, and every order was estimated and reaches its claim."""
        return super().holds and all(x <= COINCIDENT for x in self.differences.values())

    @property
    def refuted(self) -> bool:
        """Whether some tangent is refuted, or some observed order is below its claim."""
        return super().refuted or any(map(self.is_refuted, self.differences))

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        more = {"differences": self.differences, "uncertainties": self.uncertainties}
        return {**super().to_dict(), "of": self.of, **more}

    def __str__(self) -> str:
        title = f"{self.title}, T = {quantity(self.T, 's', 'g')}"
        out = [f"derivatives with respect to {self.of}: tangent against quotients, observed (claimed) order, {title}"]
        for name, row in self.orders.items():
            difference, spread = self.differences[name], self.uncertainties[name]
            more = f" (quotients: {spread:.0e})" if difference > COINCIDENT else ""
            seen = [f"{x.quantity} {'-' if x.observed is None else f'{x.observed:.2f}'} ({x.claimed})" for x in row]
            bad = [f"{x.quantity}: {x.verdict}" for x in row if x.verdict != "holds"]
            out.append("  ".join([f"{name:8s} {difference:7.0e}{more}", *seen, *(["; ".join(bad)] if bad else [])]))
        return "\n".join([*out, self.computed_by, *self.missing_text()])


def check_gradients(
    mech: Mechanism | ModelSource,
    methods: str | Iterable[str] | None = None,
    *,
    parameter: str | None = None,
    T: float | None = None,
    steps: int | None = None,
    model: Any = None,
    progress: Progress | None = None,
) -> GradientStudy:
    """Compare tangents of runs with difference quotients of runs, and observe the order of the derivatives.

    Args:
        mech: a mechanism, or an argument of `mbdae.load`, with the start of its order study.
        methods: a name or several; all half-explicit and Radau IIA methods when left out.
        parameter: dotted name of the parameter, as in `mbdae.sensitivity`; when left out, derivatives are those
            along a random change of the start velocity that is compatible with the closures.
        T: end time in s; that of the model when left out.
        steps: coarsest number of steps, at least five. From the model file when left out.
        model: factory of the mechanism for values of the parameter; by default its source files.
        progress: called with the name of each run.

    Raises:
        UnknownNameError: for an unknown method or parameter.
        InputError: for invalid T or steps, no mechanism, or one without degrees of freedom and no parameter.
    """
    mech = mechanism_of(mech, "check_gradients")
    differentiable = [name for name, m in METHODS.items() if isinstance(m, DIFFERENTIABLE)]
    names = as_list(methods or "all", "methods is a list of names")
    chosen = {m.name: m for m in map(find_method, differentiable if names == ["all"] else names)}
    _, T = checked_span(T if T is not None else mech.order.T, end=True)
    steps = steps if steps is not None else mech.order.steps
    if not is_count(steps, MIN_OUTPUTS):
        raise InputError(f"steps must be a number of at least {MIN_OUTPUTS}, got {steps!r:.60}")
    backend, python_reason = common_backend(mech, [("index2", None)], "auto")
    measure = GradientMeasurement(mech, T, steps, progress or (lambda name: None), backend, parameter, model)
    found, missing = run_until_interrupted(chosen, lambda m: (measure.judge(m), measure.compare_quotients(m)))
    orders = {name: x for name, (x, _) in found.items()}
    differences, uncertainties = ({name: x[i] for name, (_, x) in found.items()} for i in (0, 1))
    variable = parameter or "a velocity of the start"
    units = _derivative_units(mech, parameter, model)
    return GradientStudy(
        mech.title, T, orders, backend, python_reason, missing, variable, differences, uncertainties, units=units
    )


def _derivative_units(mech: Mechanism, parameter: str | None, model: object) -> dict[str, str]:
    """Return the units of dq and dv per unit of a parameter, or per factor of a velocity, see `OrderStudy`."""
    known = parameter_units(factory_of(mech if model is None else model), [parameter]) if parameter else {}
    found, of = quantity_units(mech), known.get(parameter or "", "")
    quotients = {x: [substituted("y/x", {"y": unit, "x": of or "1"}) for unit in found[x].split(", ")] for x in "qv"}
    return {f"d{x}": common_unit(units) for x, units in quotients.items()}


class GradientMeasurement(Measurement):
    """Runs with fixed steps and their derivatives with respect to one parameter."""

    max_solves = 24_000  # largest number of solves of a run with tangent

    def __init__(
        self,
        mech: Mechanism,
        T: float,
        steps: int,
        progress: Progress,
        backend: str,
        parameter: str | None,
        model: object,
    ) -> None:
        self.given_start = mech.assemble(mech.order.q, mech.order.v) if mech.order.q or mech.order.v else mech.start
        super().__init__(mech, T, steps, self.given_start if parameter is None else None, progress, backend)
        self.mech, self.parameter, self.model = mech, parameter, model
        self.names = ("dq", "dv")
        self.direction, self.value = np.zeros(mech.nv), 0.0
        if parameter is None:
            q, v = self.given_start
            dv = mech.assemble(q, v + np.random.default_rng(1).standard_normal(mech.nv))[1] - v
            if np.abs(dv).max(initial=0.0) < MIN_VELOCITY:
                raise InputError(
                    f"the closures and drivers of {mech.title!r} leave no degree of freedom: name a parameter"
                )
            self.direction = dv / np.abs(dv).max()

    def derivative(self, sol: Solution) -> Array:
        """Return the derivatives of (q, v), (n, 2 nv), at the nodes."""
        nv = self.mech.nv
        if self.parameter is None:
            return sensitivity(sol, start=True).dy[:, : 2 * nv, nv : 2 * nv] @ self.direction
        return sensitivity(sol, [self.parameter], model=self.model).dy[:, : 2 * nv, 0]

    def run(self, method: Method, n: int, value: float | None = None) -> Solution | None:
        """Return a run of a method with n steps; None if it does not finish, see `ended`."""
        self.progress(f"{method.name}, {n} steps")
        mech, (q, v) = self.mech, self.start
        if self.parameter is None:
            v = self.given_start[1] + (value or 0.0) * self.direction
        elif value is not None:
            mech = factory_of(mech if self.model is None else self.model).make({self.parameter: value})
        sol = solve(mech, (0.0, self.T), q, v, method=method, step=self.T / n, backend=self.backend)
        return self.completed(method, sol)

    def compare_quotients(self, method: Method) -> tuple[float, float]:
        """Return `GradientStudy.differences` and `GradientStudy.uncertainties` of a method; nan without a run."""
        n = self.steps
        while (sol := self.run(method, n)) is None:
            if (n := 2 * n) > MAX_REFINEMENT * self.steps:
                return np.nan, np.nan
        if self.parameter is not None:
            self.value = next(iter(sensitivity(sol, [self.parameter], model=self.model).parameters.values()))
        found = self.derivative(sol)
        sizes = np.abs(np.hstack([sol.q, sol.v])).max() / (abs(self.value) or 1.0)
        size = max(THREE_DIGITS * sizes, np.abs(found).max())
        quotients = [x for width in WIDTHS if (x := self._quotient(method, n, width, sol)) is not None]
        errors = sorted((float(np.abs(found - q).max() / size), i) for i, q in enumerate(quotients))
        if len(errors) < 2:
            return np.nan, np.nan
        (smallest, a), (_, b) = errors[:2]
        return smallest, float(np.abs(quotients[a] - quotients[b]).max() / size)

    def _quotient(self, method: Method, n: int, width: float, sol: Solution) -> Array | None:
        """Return the derivative by differences of order six, (n, 2 nv); None if a run takes other steps."""
        h, nq = width * (abs(self.value) or 1.0), self.mech.nq
        stencil: tuple[int, ...] = STENCIL
        if (name := self.parameter) is not None:
            make = factory_of(self.mech if self.model is None else self.model).make
            h, stencil = feasible_stencil(lambda by: make({name: self.value + by}), h)
        differences: dict[int, Array] = {}
        for k in stencil:
            perturbed = self.run(method, n, self.value + k * h)
            if perturbed is None or perturbed.in_use != sol.in_use or len(perturbed.t) != len(sol.t):
                return None
            dq = [self.mech.manifold.difference(a, b) for a, b in zip(sol.q, perturbed.q, strict=True)]
            differences[k] = np.hstack([np.array(dq), perturbed.y[:, nq : nq + self.mech.nv] - sol.v])
        return np.asarray(central_difference(differences, h))

    def claims(self, tableau: Method) -> tuple[list[int], int]:
        """Return the claimed orders, and the number of judged quantities."""
        return [self.system.order_of(tableau)] * 2, 2

    def sample(self, sol: Solution, stride: int = 1) -> tuple[Array, ...]:
        """Return the derivatives of q and of v at the common times, or at every ``stride``-th, one row each."""
        found, nv = self.derivative(sol)[self.common_nodes(sol, stride)], self.mech.nv
        return found[:, :nv], found[:, nv:]

    def difference(self, a: tuple[Array, ...], b: tuple[Array, ...]) -> Array:
        """Return the largest difference of each quantity over the common times."""
        return np.array([float(np.abs(x - y).max(initial=0.0)) for x, y in zip(a, b, strict=True)])

    def error_reference(self, best: tuple[Array, ...]) -> tuple[Array, ...]:
        """Return the quantities to which errors refer: the derivatives themselves."""
        return best

    def rounding(self, tableau: Method, h: float, sizes: Array) -> Array:
        """Return the rounding error of each quantity."""
        return EPS * (1 + sizes)
