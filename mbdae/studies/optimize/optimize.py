"""Optimization of mechanism parameters for a cost of the motion: an interface to `scipy.optimize`.

    minimize c(p),   low <= p <= high,   low_j <= c_j(p) <= high_j

by sequential least-squares programming (Kraft, DFVLR-FB 88-28 (1988)) or another search of scipy with exact gradients:
by the adjoint of a run (`mbdae.gradient`), or along a curve of poses (`mbdae.kinematics`) by the implicit function
theorem.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.optimize import Bounds, NonlinearConstraint, minimize

from ...errors import InputError, MbdaeError, UnknownNameError, is_count, is_number
from ...integrate.trajectory.differentiable_runs import has_jumps
from ...solution.solution import Solution
from ...system import Array
from ...tolerances import VISIBLE
from ..factories import Model, factory_of
from ..sensitivity.cost import Cost
from ..sensitivity.run_parameters import Names, named_values, progress_reporter
from .objective import ComputeMotion, CostEvaluation, Motion, curve_function, run_function
from .result import Evaluation, Optimum
from .search_range import (
    constraint_limits,
    effective_bounds,
    parameter_scales,
    ranges,
    require_within_bounds,
    table_by_name,
)

__all__ = ["optimize"]

SEARCHES = ("SLSQP", "L-BFGS-B")  # methods of scipy
NO_DESCENT = 8  # status of SLSQP: no step along its direction reduces the cost
Pair = tuple[float | None, float | None]


def optimize(
    model: Model,
    cost: Cost,
    parameters: Names,
    bounds: Mapping[str, Pair] | None = None,
    constraints: Mapping[str, tuple[Cost, float | None, float | None]] | None = None,
    *,
    t_span: tuple[float, float] | None = None,
    drive: str | None = None,
    scales: Mapping[str, float] | None = None,
    search: str = "SLSQP",
    tolerance: float = 1e-10,
    iterations: int = 200,
    progress: Callable[[str], None] | None = None,
    **settings: Any,
) -> Optimum:
    """Find the parameters p of a mechanism that minimize a cost of its motion.

        minimize c(p),   low <= p <= high,   low_j <= c_j(p) <= high_j

    by sequential least-squares programming (Kraft, DFVLR-FB 88-28 (1988)), or another search of scipy, with exact
    gradients.

    The motion is a run from the mechanism's start; or, with ``drive``, the curve of its poses over an input, for which
    only positions, their rates and holding efforts are available. Parameters for which the motion cannot be computed
    (loops that cannot be closed, failed runs) have infinite cost; the start must be computable.

    Args:
        model: an argument of `mbdae.load`, a mechanism that was loaded, or a function that returns one.
        cost: signals -> (value, {signal: derivative (n,)}), see `mbdae.gradient`; or `mbdae.Squares`. The parameters
            are among the signals, with one number as derivative. Signals of runs are those of `mbdae.Solution.signals`;
            of curves ``u``, ``q.<joint>``, ``v.<joint>`` (per unit speed of the input), ``position.<frame>.x``, .y, .z,
            and ``holding``, the holding torque or force of the driver in each pose, in N m or N.
        parameters: dotted names, as in sweeps; or name = initial value.
        bounds: (low, high) of parameters, None for no bound; 0 replaces None if mechanisms exist on one side of 0 only.
        constraints: by any name, (function like a cost, low, high), None for no limit; equal limits are allowed.
        t_span: start and end of the run; 0 and the model's duration when left out.
        drive: a joint or driver, the input of a curve of poses.
        scales: typical changes of the parameters; a tenth of the range, or of the value, when left out.
        search: ``"SLSQP"`` or, without constraints, ``"L-BFGS-B"``.
        tolerance: termination tolerance, relative to the cost at the start.
        iterations: largest number of iterations.
        progress: called with a description of the current task.
        settings: arguments of `mbdae.solve`; or, with ``drive``, of `mbdae.kinematics`: span, turns, hold, points, q.

    Raises:
        InputError: for a start that cannot be computed, invalid bounds, signals or parameters without a gradient.
        UnknownNameError: for invalid names.
    """
    if not callable(cost):
        raise InputError(f"a cost is a function of signals that returns (value, derivatives), got {cost!r:.60}")
    _check_termination(iterations, tolerance)
    if drive is not None and t_span is not None:
        raise InputError("a curve over a drive has no t_span: give span, the range of the drive, or leave drive out")
    _check_search(search, bool(constraints))
    factory = factory_of(model)
    start = _start(factory, parameters)
    box = ranges("parameter", start, table_by_name("bounds", bounds))
    limits = {name: constraint_limits(name, given) for name, given in table_by_name("constraints", constraints).items()}
    require_within_bounds(start, box)
    box = effective_bounds(factory, start, box)
    compute_motion = (
        curve_function(factory, drive, factory.make(start), settings)
        if drive is not None
        else run_function(factory, t_span, settings)
    )
    functions = {name: x[0] for name, x in (constraints or {}).items()}
    problem = Problem(compute_motion, cost, functions, start, limits, progress_reporter(progress))
    return problem.solve(box, parameter_scales(start, box, scales), search, tolerance, iterations)


class Problem:
    """Scaled problem: cost and constraints, divided by typical magnitudes, over z, p = p_0 + scale z."""

    def __init__(
        self,
        compute_motion: ComputeMotion,
        cost: object,
        functions: Mapping[str, object],
        start: dict[str, float],
        limits: dict[str, tuple[float, float]],
        progress: Callable[[str], None],
    ) -> None:
        self.compute_motion, self.functions, self.limits = compute_motion, {"": cost, **functions}, limits
        self.start, self.report_progress, self.scale = start, progress, np.ones(len(start))
        self.history: list[Evaluation] = []
        self.last: tuple[Array, dict[str, CostEvaluation]] | None = None
        self.best: tuple[Evaluation, Motion, dict[str, CostEvaluation]] | None = None
        self.z = np.zeros(len(start))
        first = self.evaluate(self.z)
        for m in first.values():
            m.derivatives()  # rejects parameters without a derivative
        self.magnitudes = {name: abs(m.value) or 1.0 for name, m in first.items()}
        for name, pair in limits.items():
            self.magnitudes[name] = max([abs(x) for x in pair if np.isfinite(x)], default=0.0) or self.magnitudes[name]

    def values(self, z: Array) -> dict[str, float]:
        """Return the parameters."""
        return {name: x + float(s * y) for (name, x), s, y in zip(self.start.items(), self.scale, z, strict=True)}

    def evaluate(self, z: Array) -> dict[str, CostEvaluation]:
        """Return cost and constraints at a point; an infinite cost where they cannot be computed."""
        if self.last is not None and (self.last[0] == z).all():
            return self.last[1]
        values = self.values(z)
        try:
            motion, found = self._motion(values)
        except MbdaeError as e:
            if not self.history:
                raise
            self.history.append(Evaluation(values, np.nan, {}, str(e)))
            assert self.best is not None  # the start was computed
            found = {**self.best[2], "": CostEvaluation(np.inf, lambda: np.zeros(len(z)))}
        else:
            evaluation = Evaluation(values, found[""].value, {name: m.value for name, m in found.items() if name})
            self.history.append(evaluation)
            if self.best is None or self.rank(evaluation) < self.rank(self.best[0]):
                self.best = evaluation, motion, found
        self.report_progress(f"{len(self.history)} motions, cost {self.best[0].cost:.6g}" if self.best else "")
        self.last = z.copy(), found
        return found

    def _motion(self, values: dict[str, float]) -> tuple[Motion, dict[str, CostEvaluation]]:
        """Return a motion with its cost and constraints; one with jumps must have derivatives.

        Raises:
            MbdaeError: if they cannot be computed.
        """
        motion = self.compute_motion(values)
        found = {
            name: motion.evaluate(function, f"constraint {name!r}" if name else "")
            for name, function in self.functions.items()
        }
        if isinstance(motion.result, Solution) and has_jumps(motion.result):
            found[""].derivatives()
        return motion, found

    def violation(self, evaluation: Evaluation) -> float:
        """Return the largest ratio of a constraint's violation to its magnitude; 0 if satisfied."""
        found = [(x, self.magnitudes[name], *self.limits[name]) for name, x in evaluation.constraints.items()]
        violations = [max(low - x, x - high) / size for x, size, low, high in found]
        return max((x for x in violations if x > VISIBLE), default=0.0)

    def rank(self, evaluation: Evaluation) -> tuple[float, float]:
        """Return a sort key: feasible points first, by cost; infeasible points by violation."""
        return (self.violation(evaluation) if len(self.history) > 1 else 0.0), evaluation.cost

    def value(self, z: Array, name: str = "") -> float:
        """Return the cost or a constraint, divided by its magnitude."""
        return self.evaluate(z)[name].value / self.magnitudes[name]

    def derivatives(self, z: Array, name: str = "") -> Array:
        """Return the derivatives of the cost or a constraint with respect to z, (k,)."""
        return self.evaluate(z)[name].derivatives() * self.scale / self.magnitudes[name]

    def solve(
        self, box: dict[str, tuple[float, float]], scale: Array, search: str, tolerance: float, iterations: int
    ) -> Optimum:
        """Search, and return the best point; the best so far if the user or an error stops the search."""
        start = np.array(list(self.start.values()))
        low, high = (np.array([pair[i] for pair in box.values()]) for i in (0, 1))
        self.scale, interrupted, differentiated = scale, False, True
        rows = [
            NonlinearConstraint(
                lambda z, n=name: self.value(z, n), pair[0] / self.magnitudes[name], pair[1] / self.magnitudes[name],
                jac=lambda z, n=name: self.derivatives(z, n)[None],
            )
            for name, pair in self.limits.items()
        ]  # fmt: skip
        try:
            result = minimize(
                self.value, self.z, jac=self.derivatives, method=search, constraints=rows,
                bounds=Bounds((low - start) / scale, (high - start) / scale),
                options={"ftol": tolerance, "maxiter": iterations},
            )  # fmt: skip
            converged, message = bool(result.success), str(result.message)
            if search == "SLSQP" and result.get("status") == NO_DESCENT:  # none if all parameters are fixed
                converged = not rows and self.is_stationary(result.x, (low - start) / scale, (high - start) / scale)
        except KeyboardInterrupt:
            converged, interrupted, message = False, True, "stopped by the user"
        except MbdaeError as e:  # a point without derivatives, or an error of the progress function
            converged, message, differentiated = False, str(e), False
        assert self.best is not None  # the start was computed
        best, motion, found = self.best
        violated = [n for n in self.limits if self.violation(best._replace(constraints={n: best.constraints[n]}))]
        if violated and not interrupted:
            converged, message = False, f"constraint {violated[0]!r} is violated; {message}"
        values = found[""].derivatives() if differentiated else self.z * np.nan
        gradient = dict(zip(self.start, values.tolist(), strict=True))
        return Optimum(
            best.values, best.cost, gradient, best.constraints, self.limits, box, motion.result.mechanism,
            motion.result, tuple(self.history), converged, interrupted, message,
            motion.bound,
        )  # fmt: skip

    def is_stationary(self, z: Array, low: Array, high: Array) -> bool:
        """Return whether the gradient of the cost, projected onto the bounds, is zero."""
        step = np.clip(z - self.derivatives(z), low, high) - z
        return bool(np.abs(step).max(initial=0.0) < VISIBLE)


def _check_termination(iterations: object, tolerance: object) -> None:
    if not (is_count(iterations) and is_number(tolerance) and tolerance > 0):
        raise InputError(f"iterations and tolerance are positive, got {iterations!r:.30} and {tolerance!r:.30}")


def _check_search(search: str, constrained: bool) -> None:
    if search not in SEARCHES:
        raise UnknownNameError("search", search, SEARCHES)
    if search == "L-BFGS-B" and constrained:
        raise InputError("search 'L-BFGS-B' takes no constraints, only bounds")


def _start(factory: Any, names: Names) -> dict[str, float]:
    if not names:
        raise InputError("a search needs parameters: a list of names, or name = value")
    return named_values(factory, names)
