"""Parameters of a mechanism from measured signals: least squares with exact derivatives, over increasing time spans.

    minimize  sum_k r_k^2,   r_k = (signal(t_k; p) - data_k) / sigma,   low <= p <= high

by a trust region with bounds (Branch, Coleman, Li, SIAM J. Sci. Comput. 21 (1999)), with the Jacobian of
`mbdae.sensitivity`. Over long spans the sum has local minima at motions that are shifted by whole periods. Therefore
the first samples are fitted first, then increasing fractions of them.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.special import chdtrc

from ...errors import InputError, MbdaeError, as_list, is_count, require
from ...mechanism.formats.mechanism_file.loaded_model import parameter_value
from ...mechanism.formats.mechanism_file.parameter_units import parameter_units
from ...mechanism.formats.mechanism_file.template import Template
from ...solution.signals import signals as computed_signals
from ...solution.signals import units
from ...system import Array
from ...tolerances import COARSE, INPUT_DIGITS, SEARCH_TOLERANCE, VISIBLE
from ..factories import MechanismFactory, Model, factory_of
from ..sensitivity.run_parameters import checked_scales, named_values, progress_reporter, reals
from ..sweep.sweep_run import check_settings
from .data import read_recordings
from .fit_residuals import FitResiduals
from .identifiability import members, precision
from .result import Attempt, Fit

__all__ = ["fit"]

SPANS = (0.16, 0.4, 1.0)  # fractions of the samples
Parameters = Mapping[str, Any]


class Unknown(NamedTuple):
    """A parameter to be identified: initial value and bounds of the search."""

    start: float
    low: float
    high: float


def fit(
    model: Model,
    parameters: Parameters,
    data: Any,
    *,
    signals: Sequence[str] = (),
    sigma: float | Mapping[str, float] | None = None,
    scales: Mapping[str, float] | None = None,
    t_span: float | Sequence[float] | None = None,
    spans: Sequence[float] = SPANS,
    known: Sequence[Mapping[str, float]] | Mapping[str, float] = (),
    starts: int = 1,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
    **settings: Any,
) -> Fit:
    """Identify parameters p of a mechanism from measurements of its motion.

        minimize sum_k ((signal(t_k; p) - data_k) / sigma)^2,   low <= p <= high

    by a trust region with exact derivatives (Branch, Coleman, Li, SIAM J. Sci. Comput. 21 (1999)).

    Args:
        model: argument of `mbdae.load`, a mechanism that was loaded, or a function that returns one.
        parameters: dotted names, as in sweeps, with (low, high) or (start, low, high); without a start the search
            begins at the model's value if it lies between the bounds, else in the middle.
        data: a table ``{"t": ..., "q.slider": ...}`` with columns named as the signals of `mbdae.Solution.signals`, a
            CSV or Parquet file, or a list of them: several runs with the same parameters.
        signals: columns to use; all when left out.
        sigma: noise level of all signals, or by name, in their units. Without it, all signals have the weight 1,
            standard deviations follow from the residuals of each signal, and the fit cannot be refuted. Then 1 rad
            counts as much as 1 rad/s or 1 m: signals of several units need noise levels, or the noisiest dominate.
        scales: typical changes of the parameters; a tenth of the range when left out.
        t_span: start of the runs, by default 0, and latest time of data that are used, by default the last.
        spans: fractions of the samples that are fitted successively; ``(1,)`` for all at once.
        known: other parameters of each run, for instance start values: a table for each, or one for all.
        starts: number of searches. The first begins at the given start, the next at random points within the bounds,
            on a logarithmic scale if the bounds are positive. The best is returned, with all in its ``searches``.
        seed: seed of the random starts.
        progress: called with a description of the current task.
        settings: arguments of `mbdae.solve`: method, rtol, step, ...

    Returns:
        The parameters with their standard deviations, chi-squared, and unidentifiable parameters.

    Raises:
        InputError: for data outside the span, signals without a gradient, invalid bounds.
        UnknownNameError: for invalid names.
    """
    _check_names(parameters, settings)
    report_progress = progress_reporter(progress)
    recordings = read_recordings(data, as_list(signals, "signals are names of columns"))
    factory = factory_of(model)
    tables = _known_parameters(known, len(recordings), parameters)
    named_values(factory, dict.fromkeys(parameters, 0.0))
    unknown = {name: _unknown(factory, name, given) for name, given in parameters.items()}
    problem = FitResiduals(factory, list(unknown), recordings, tables, sigma, t_span, settings)
    low, high = (np.array([getattr(u, key) for u in unknown.values()]) for key in ("low", "high"))
    scale = checked_scales(scales, {name: (u.high - u.low) / 10 for name, u in unknown.items()})
    first = np.clip([u.start for u in unknown.values()], low, high)
    _check_starts(starts, seed)
    search = _Search(problem, low, high, scale, spans, report_progress)
    attempts = []
    for i, x in enumerate(_starting_points(first, low, high, starts, seed)):
        try:
            attempts.append(search.attempt(x, f"start {i + 1}, " if starts > 1 else ""))
        except MbdaeError as e:
            if not i:
                raise
            attempts.append(Attempt(dict(zip(unknown, x.tolist(), strict=True)), {}, np.inf, False, str(e)))
    return _result(search, attempts)


def _check_names(parameters: object, settings: Mapping[str, object]) -> None:
    if not isinstance(parameters, Mapping) or not parameters:
        raise InputError("a fit needs parameters: name = (low, high) or (start, low, high)")
    for name in ("t_eval", "events"):
        if name in settings:
            raise InputError(f"a fit takes no {name}: the times of the data are those of its runs")
    check_settings(settings, excluded=("problem", "t_span", "t_eval", "events", "progress"))


def _check_starts(starts: object, seed: object) -> None:
    if not is_count(starts):
        raise InputError(f"starts is a number of searches, at least 1, got {starts!r}")
    if not is_count(seed, 0):
        raise InputError(f"seed is a whole number, at least 0, got {seed!r:.60}")


def _known_parameters(given: Any, n: int, parameters: Parameters) -> list[dict[str, float]]:
    """Return the known parameters of each of n runs.

    Raises:
        InputError: for another number of tables, or a parameter that is to be identified.
    """
    tables = [given] * n if isinstance(given, Mapping) else given if isinstance(given, Sequence) else [given]
    for table in tables:
        require(table, Mapping, "known parameters are tables, name = value")
        if nameless := [name for name in table if not isinstance(name, str)]:
            raise InputError(f"known parameters have dotted names, got {nameless[0]!r:.60}")
        if both := [name for name in table if name in parameters]:
            raise InputError(f"{both[0]!r} is both known and to be identified")
    if tables and len(tables) != n:
        raise InputError(f"known has {len(tables)} tables for {n} runs")
    return [dict(table) for table in tables] or [{}] * n


def _starting_points(first: Array, low: Array, high: Array, n: int, seed: int) -> Iterator[Array]:
    """Yield n starting points of searches, beginning with the given one."""
    yield first
    random = np.random.default_rng(seed)
    with np.errstate(divide="ignore", invalid="ignore"):
        limits = np.where(low > 0, np.log(low), low), np.where(low > 0, np.log(high), high)
    for _ in range(n - 1):
        x = random.uniform(*limits)
        yield np.clip(np.where(low > 0, np.exp(np.where(low > 0, x, 0.0)), x), low, high)


@dataclass(frozen=True)
class _Search:
    """Least squares over increasing fractions of the samples, with bounds (k,) and scales (k,) of the parameters."""

    problem: FitResiduals
    low: Array
    high: Array
    scale: Array
    spans: Sequence[float]
    report_progress: Callable[[str], None]

    @np.errstate(over="ignore", invalid="ignore")  # overflow of diverging runs, which fail with a message
    def attempt(self, start: Array, label: str) -> Attempt:
        """Run one search from a start.

        Raises:
            MbdaeError: if a run fails at a starting point.
        """
        problem = self.problem
        x, message, converged, r = start, "", False, np.empty(0)
        for fraction in problem.span_fractions(self.spans, len(start)):
            problem.fraction, tolerance = fraction, SEARCH_TOLERANCE if fraction == 1 else COARSE
            self.report_progress(f"{label}{fraction:.0%} of the samples")
            x = self._differentiable_start(x, start)
            result = least_squares(
                problem.residuals, x, problem.jacobian, (self.low, self.high), x_scale=self.scale,
                ftol=tolerance, xtol=tolerance, gtol=tolerance,
            )  # fmt: skip
            x, message, converged, r = result.x, result.message, result.status > 0, result.fun
            if problem.rejected and _is_reducible(result.fun, result.jac[:, result.active_mask == 0]):
                converged, message = False, f"steps became short by rejected trials: {problem.rejected[-1]}"
        initial, final = (dict(zip(problem.names, y.tolist(), strict=True)) for y in (start, x))
        return Attempt(initial, final, float(r @ r), converged, message)

    def _differentiable_start(self, x: Array, start: Array) -> Array:
        """Return the result x of the search over fewer samples, or the start if longer runs have no derivative at x.

        Raises:
            MbdaeError: if the runs have no derivative at the start either.
        """
        self.problem.rejected = []
        try:
            self.problem.jacobian(x)
        except MbdaeError:
            self.problem.jacobian(start)
            return start
        return x


def _is_reducible(r: Array, J: Array) -> bool:
    """Return whether a Gauss-Newton step would visibly reduce |r|^2 of r (n,) with derivatives J (n, m)."""
    reduction = J @ np.linalg.lstsq(J, r, rcond=None)[0]
    return bool(reduction @ reduction > VISIBLE * (r @ r))


def _unknown(factory: MechanismFactory, name: str, given: object) -> Unknown:
    """Return a parameter with its bounds.

    Raises:
        InputError: for invalid bounds.
    """
    numbers = reals(given)
    if len(numbers) not in (2, 3) or not np.isfinite(numbers).all() or not numbers[-2] < numbers[-1]:
        raise InputError(
            f"parameter {name!r} takes (low, high) or (start, low, high) with low < high, got {given!r:.60}"
        )
    *start, low, high = numbers
    first = start[0] if start else _default_start(factory, name, low, high)
    if not low <= first <= high:
        raise InputError(f"parameter {name!r} starts at {first:g}, outside its bounds {low:g} to {high:g}")
    return Unknown(first, low, high)


def _default_start(factory: MechanismFactory, name: str, low: float, high: float) -> float:
    """Return the model's value if it lies between the bounds, else their mean."""
    middle = (low + high) / 2
    if not isinstance(factory, Template):
        return middle
    try:
        given = parameter_value(factory, name)
    except InputError as e:
        if "is not a number" not in str(e):
            raise
        return middle
    return given if low < given < high else middle


def _result(search: _Search, attempts: list[Attempt]) -> Fit:
    problem, low, high, scale = search.problem, search.low, search.high, search.scale
    best = min(attempts, key=lambda s: s.chi2)
    x, problem.fraction = np.array(list(best.values.values())), 1.0
    r, J, names = problem.residuals(x), problem.jacobian(x) * scale, problem.names
    chi2, dof = float(r @ r), len(r) - len(x)
    found = precision(J, names, scale, high - low, r, None if problem.noise_known else problem.signal_indices())
    tolerance = SEARCH_TOLERANCE * (high - low) + INPUT_DIGITS * scale
    at_bounds = list(members(names, (x - low < tolerance) | (high - x < tolerance)))
    sols = problem.simulate(x)
    runs = list(zip(sols, problem.recordings, strict=True))
    computed = [{name: computed_signals(sol, [name])[name] for name in recording.columns} for sol, recording in runs]
    residuals = [{name: (c[name] - recording.columns[name]) / problem.sigma[name] for name in c}
                 for c, recording in zip(computed, problem.recordings, strict=True)]  # fmt: skip
    probability = float(chdtrc(dof, chi2)) if problem.noise_known and dof > 0 else np.nan
    mech = sols[0].mechanism
    all_units = units(mech)
    return Fit(
        mech.title,
        dict(zip(names, x.tolist(), strict=True)),
        dict(zip(names, found.deviations.tolist(), strict=True)),
        found.covariance, found.correlations, chi2, dof, probability, found.unidentifiable, at_bounds, residuals,
        computed, [x.columns for x in problem.recordings], [x.t for x in problem.recordings],
        [x.name for x in problem.recordings], problem.runs, problem.gradients, best.converged, best.message,
        attempts, {name: all_units[name] for x in problem.recordings for name in x.columns},
        tuple(problem.all_rejected), parameter_units(problem.factory, names), problem.noise_known,
    )  # fmt: skip
