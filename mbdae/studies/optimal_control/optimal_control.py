"""Optimal control by direct single shooting: inputs over time that minimize an integral of signals."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ...errors import InputError, UnknownNameError, is_count, is_number
from ...integrate.simulator.simulator import Simulator
from ...mechanism import Mechanism, ModelSource
from ...system import Array
from ..optimize.optimize import Problem
from ..optimize.search_range import ranges, require_within_bounds, table_by_name
from ..sensitivity.run_parameters import progress_reporter, reals
from .controlled_motion import ControlledMotion, Grid, Shooting
from .cost import Integral, SignalAtPoint, integrand
from .result import OptimalControl

__all__ = ["optimal_control"]

Pair = tuple[float | None, float | None]
SETTINGS = ("method", "formulation", "project", "backend")
METHOD = "herk5"  # one-step method without a carry, so that intervals need no restart


def optimal_control(
    model: Mechanism | ModelSource,
    cost: Any,
    inputs: Sequence[str] | Mapping[str, Pair],
    *,
    end: Mapping[str, float | Pair] | None = None,
    path: Mapping[str, Pair] | None = None,
    duration: float | tuple[float, float] | None = None,
    time_weight: float = 0.0,
    guess: Mapping[str, Any] | None = None,
    points: int = 33,
    steps: int = 2,
    q: Array | None = None,
    v: Array | None = None,
    s: Array | None = None,
    tolerance: float = 1e-10,
    iterations: int = 200,
    progress: Callable[[str], None] | None = None,
    **settings: Any,
) -> OptimalControl:
    """Find the inputs u(t) of a mechanism, and the duration T, that minimize an integral along its motion.

        minimize  w T + int_0^T L dt,   q' = v,  M v' = f(q, v, s, u) + G^T lam,  0 = G v + g_t,  (q, v, s)(0) given
        low <= u <= high,   low_j <= x_j(T) <= high_j,   low_i <= x_i(t_k) <= high_i,   T_low <= T <= T_high

    by direct single shooting: unknowns are the values of u at equidistant times, in between constant or linear as
    specified for each input, and T. Closed loops are part of the run, not constraints of the search. Steps scale with
    T; their exact derivatives come from one forward sweep (`mbdae.Simulator.tangent`) for the cost and all constraints,
    and scipy's sequential least-squares programming (Kraft, DFVLR-FB 88-28 (1988)) searches. The accuracy is limited by
    the grid: compare with twice the points.

    Args:
        model: a mechanism with inputs, or the name or path of one.
        cost: L: a signal, ``{signal: weight}`` for weighted sums of squares, or signals -> (L (n,), {signal: dL (n,)})
            at n nodes, pointwise; the first call has n = 1. Signals are those of `mbdae.Solution.signals` with a
            derivative, and the inputs by name.
        inputs: names of the inputs to find, or name = (low, high), None for no limit; further inputs are constant.
        end: signals at the end: a number, or (low, high).
        path: (low, high) of signals at all points of the grid.
        duration: T in s, or (low, high) to find it, beginning in the middle; the model's when left out.
        time_weight: weight w of the duration, in 1/s.
        guess: initial values of inputs, a number or one for each point; by default their start values.
        points: number of times where inputs have values; an input with ``hold = "zero"`` has one for each interval.
        steps: steps of the method in each interval, an even number.
        q: consistent start configuration (nq,); the model's start when left out.
        v: consistent start velocity (nv,); the model's start when left out.
        s: start values (ns,) of the states of forces.
        tolerance: termination tolerance of the search.
        iterations: largest number of iterations.
        progress: called with a description of the current task.
        settings: settings of `mbdae.Simulator`: method (herk5 when left out), formulation, project, backend.

    Raises:
        InputError: for a start that cannot be computed, wrong limits, signals without a derivative, equations that
            depend on time if T is unknown, and without the compiled core.
        UnknownNameError: for unknown names.

    Source: Betts, Practical Methods for Optimal Control Using Nonlinear Programming, SIAM (2010), ch. 3 and 4; Bock,
    Plitt, A multiple shooting algorithm for direct solution of optimal control problems, IFAC World Congress (1984).
    """
    _require_numbers(points, steps, iterations, tolerance, time_weight)
    if wrong := [name for name in settings if name not in SETTINGS]:
        raise UnknownNameError("setting", wrong[0], SETTINGS)
    simulator = Simulator(model, 0.0, q, v, s, step=1.0, restart=True, **{"method": METHOD, **settings})
    box = _input_limits(simulator, inputs)
    span = _duration(simulator.mechanism.duration if duration is None else duration)
    linear = tuple(name for name in box if simulator.inputs.user_inputs[name].hold == "first")
    grid = Grid(tuple(box), linear, points, steps, span[0] if span[0] == span[1] else None)
    function, used, label = integrand(cost)
    ends = {name: _pair(x) for name, x in table_by_name("end", end).items()}
    paths = table_by_name("path", path)
    limits = _limits(ends, paths, points)
    shooting = Shooting(simulator, grid, [*used, *ends, *paths])
    start, bounds, scale = _unknowns(simulator, grid, box, span, table_by_name("guess", guess))
    require_within_bounds(start, bounds)
    problem = Problem(
        shooting, Integral(function, label, float(time_weight)),
        {label: SignalAtPoint(name, k) for label, name, k, _ in limits}, start,
        {label: pair for label, _, _, pair in limits}, progress_reporter(progress),
    )  # fmt: skip
    found = problem.solve(bounds, scale, "SLSQP", float(tolerance), iterations)
    assert problem.best is not None
    motion = problem.best[1]
    assert isinstance(motion, ControlledMotion)
    return OptimalControl.of(found, motion, grid)


def _input_limits(simulator: Simulator, inputs: object) -> dict[str, tuple[float, float]]:
    """Return (low, high) of the inputs to find."""
    user_inputs = simulator.inputs.user_inputs
    if not isinstance(inputs, Mapping):
        if isinstance(inputs, str) or not isinstance(inputs, Sequence) or not all(isinstance(x, str) for x in inputs):
            raise InputError(f"inputs are a list of names, or name = (low, high), got {inputs!r:.60}")
        inputs = dict.fromkeys(inputs, (None, None))
    if not inputs:
        raise InputError(f"name the inputs to find, of: {', '.join(user_inputs) or 'none, the model has no [[input]]'}")
    found = ranges("input", user_inputs, inputs)
    return {name: found[name] for name in inputs}


def _unknowns(
    simulator: Simulator, grid: Grid, box: Mapping[str, tuple[float, float]], span: tuple[float, float],
    guess: Mapping[str, object],
) -> tuple[dict[str, float], dict[str, tuple[float, float]], Array]:  # fmt: skip
    """Return initial values, bounds and scales of the unknowns.

    With these scales an integral of u^2 has the same curvature in all values of u: then the number of iterations of the
    quasi-Newton search does not grow with the number of points.
    """
    start, bounds, scale = list[float](), list[tuple[float, float]](), list[float]()
    for name in guess:
        if name not in grid.names:
            raise UnknownNameError("input", name, grid.names)
    for name, n in grid.value_counts().items():
        values = _guess(name, guess.get(name, simulator.inputs.user_inputs[name].setting.value), n)
        low, high = box[name]
        size = ((high - low) / 10 if np.isfinite(high - low) else float(np.abs(values).max())) or 1.0
        weights = np.full(n, 1.0 / (grid.points - 1))
        if name in grid.linear:
            weights[[0, -1]] /= 2
        start, bounds, scale = [*start, *values], [*bounds, *[box[name]] * n], [*scale, *size / np.sqrt(weights)]
    if grid.duration is None:
        start, bounds, scale = [*start, sum(span) / 2], [*bounds, span], [*scale, (span[1] - span[0]) / 10]
    names = grid.unknowns()
    return dict(zip(names, map(float, start), strict=True)), dict(zip(names, bounds, strict=True)), np.array(scale)


def _limits(
    ends: Mapping[str, Any], paths: Mapping[str, Any], points: int
) -> list[tuple[str, str, int, tuple[float, float]]]:
    """Return a label, the signal, the point and (low, high) of each constraint."""
    out = [(f"{name} at the end", name, points - 1, x) for name, x in ranges("signal", ends, ends).items()]
    for name, pair in ranges("signal", paths, paths).items():
        out += [(f"{name} at point {k}", name, k, pair) for k in range(points)]
    return out


def _require_numbers(points: Any, steps: Any, iterations: Any, tolerance: Any, time_weight: Any) -> None:
    for name, n, least in (("points", points, 2), ("steps", steps, 2), ("iterations", iterations, 1)):
        if not is_count(n, least):
            raise InputError(f"{name} must be a whole number from {least} on, got {n!r:.60}")
    if steps % 2:
        raise InputError(f"steps must be even, for Simpson's rule, got {steps}")
    if not is_number(tolerance) or not tolerance > 0 or not is_number(time_weight):
        raise InputError(f"tolerance is positive and time_weight a number, got {tolerance!r:.30}, {time_weight!r:.30}")


def _duration(given: object) -> tuple[float, float]:
    """Return the lowest and the highest duration."""
    pair = reals([given, given] if is_number(given) else given)
    if len(pair) != 2 or not 0 < pair[0] <= pair[1] < np.inf:
        raise InputError(f"duration is a positive number of seconds, or (low, high), got {given!r:.60}")
    return pair[0], pair[1]


def _pair(given: object) -> Any:
    return (given, given) if is_number(given) else given


def _guess(name: str, given: object, n: int) -> Array:
    """Return the initial values of an input, (n,)."""
    try:
        values = np.broadcast_to(np.asarray(given, float), (n,))
    except (TypeError, ValueError):
        values = np.full(n, np.nan)
    if not np.isfinite(values).all():
        raise InputError(f"guess of input {name!r} is a finite number, or {n} of them, got {given!r:.60}")
    return values
