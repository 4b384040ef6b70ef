"""Parameters of a mechanism from measured signals: least squares with exact derivatives, over growing spans.

    minimise  sum_k r_k^2,   r_k = (signal(t_k; p) - data_k) / sigma,   low <= p <= high

by a trust region with bounds (Branch, Coleman, Li, SIAM J. Sci. Comput. 21 (1999)), with the Jacobian of
`mbdae.sensitivity`. Over long spans the sum has false minima: motions that fell out of step by whole periods. So the
first samples are fitted first, then more of them.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2 as chi2_distribution

from ...errors import InputError, MbdaeError, as_list, require
from ...mechanism import Mechanism
from ...mechanism.formats.loaded_model import number
from ...mechanism.formats.template import Template
from ...solution.signals import signals as computed_signals
from ...solution.signals import units
from ...system import Array
from ..sensitivity.run_parameters import MechanismFactory, mechanism_factory, named_values, reals, scaled, teller
from ..sweep.sweep_run import check_settings
from .data import records
from .fit_residuals import FitResiduals
from .result import TIED, Attempt, Fit

__all__ = ["fit"]

SPANS = (0.16, 0.4, 1.0)  # of the samples
TOLERANCE = 1e-10  # of the search, relative
ROUGH = 1e-4  # alike, of the shorter spans
LOST = 1e-9  # of the largest singular value of the Jacobian, in scales of the parameters: no information
SHARE = 0.1  # of a null vector: parameters with as much are in the combination that is not told
Parameters = Mapping[str, Any]


class Unknown(NamedTuple):
    """A parameter to be found: where the search starts, and its bounds."""

    start: float
    low: float
    high: float


def fit(
    model: str | Path | Mechanism | Callable[..., Mechanism],
    parameters: Parameters,
    data: Any,
    *,
    signals: Sequence[str] = (),
    sigma: float | Mapping[str, float] | None = None,
    scales: Mapping[str, float] | None = None,
    t_span: Sequence[float] | None = None,
    spans: Sequence[float] = SPANS,
    known: Sequence[Mapping[str, float]] | Mapping[str, float] = (),
    starts: int = 1,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
    **settings: Any,
) -> Fit:
    """Find numbers p of a mechanism from measurements of its motion.

        minimise sum_k ((signal(t_k; p) - data_k) / sigma)^2,   low <= p <= high

    by a trust region with exact derivatives (Branch, Coleman, Li, SIAM J. Sci. Comput. 21 (1999)).

    Args:
        model: what `mbdae.load` takes, a mechanism that was loaded, or a function that makes one.
        parameters: dotted names, as of sweeps, with (low, high) or (start, low, high); the search starts from the
            model's own number where no start is given and it lies between the bounds, else half way.
        data: a table ``{"t": ..., "q.slider": ...}`` with columns named as the signals of `mbdae.Solution.signals`, a
            CSV or Parquet file, or a list of them: several runs with the same parameters.
        signals: columns that count; all when left out.
        sigma: noise level of all signals, or by name, in their units. Without, standard deviations follow from what
            remains of the data, and nothing can be said against the minimum.
        scales: by which size a parameter typically changes; a tenth of its range when left out.
        t_span: where runs start, and the latest time of data; 0 and the last of them when left out.
        spans: shares of the samples that are fitted one after another; ``(1,)`` for all at once.
        known: other numbers of each run, for instance start values: a table for each, or one for all.
        starts: how many searches: the first from the start that is given, others from places within the bounds, by
            their logarithms where these are positive. The best is returned, the others are in its ``searches``.
        seed: of these places.
        progress: told what is done, in words.
        settings: arguments of `mbdae.solve`: method, rtol, step, ...

    Returns:
        The numbers with their standard deviations, chi-squared, and what cannot be told from the data.

    Raises:
        InputError: for data outside the span, signals without a gradient, bounds that are none.
        UnknownNameError: for names that lead nowhere.
    """
    if not isinstance(parameters, Mapping) or not parameters:
        raise InputError("a fit needs parameters: name = (low, high) or (start, low, high)")
    for name in ("t_eval", "events"):
        if name in settings:
            raise InputError(f"a fit takes no {name}: the times of the data are those of its runs")
    check_settings(settings, others=("problem", "t_span", "t_eval", "events", "progress"))
    told = teller(progress)
    found = records(data, as_list(signals, "signals are names of columns"))
    loaded = model if isinstance(model, Mechanism) else None
    make = mechanism_factory(loaded, None if loaded else model)
    tables = _known(known, len(found), parameters)
    named_values(make, dict.fromkeys(parameters, 0.0))
    unknown = {name: _unknown(make, name, given) for name, given in parameters.items()}
    problem = FitResiduals(make, list(unknown), found, tables, sigma, t_span, settings)
    low, high = (np.array([getattr(u, key) for u in unknown.values()]) for key in ("low", "high"))
    scale = scaled(scales, {name: (u.high - u.low) / 10 for name, u in unknown.items()})
    first = np.clip([u.start for u in unknown.values()], low, high)
    if not (isinstance(starts, int) and not isinstance(starts, bool) and starts >= 1):
        raise InputError(f"starts is a number of searches, at least 1, got {starts!r}")
    if not (isinstance(seed, int) and seed >= 0):
        raise InputError(f"seed is a whole number, at least 0, got {seed!r:.60}")
    found_all = []
    for i, x in enumerate(_places(first, low, high, starts, seed)):
        where = f"start {i + 1}, " if starts > 1 else ""
        try:
            shares = problem.shares(spans, len(x))
            found_all.append(_search(problem, x, low, high, scale, shares, told, where))
        except MbdaeError as e:
            if not i:
                raise
            found_all.append(Attempt(dict(zip(unknown, x.tolist(), strict=True)), {}, np.inf, False, str(e)))
    return _result(problem, found_all, low, high, scale)


def _known(given: Any, n: int, parameters: Parameters) -> list[dict[str, float]]:
    """The numbers that are known of each of n runs.

    Raises:
        InputError: for another number of tables, and a number that is to be found.
    """
    tables = [given] * n if isinstance(given, Mapping) else given if isinstance(given, Sequence) else [given]
    for table in tables:
        require(table, Mapping, "what is known of runs are tables, name = value")
        if nameless := [name for name in table if not isinstance(name, str)]:
            raise InputError(f"what is known of runs has dotted names, got {nameless[0]!r:.60}")
        if both := [name for name in table if name in parameters]:
            raise InputError(f"{both[0]!r} is known, and a parameter to be found")
    if tables and len(tables) != n:
        raise InputError(f"known has {len(tables)} tables for {n} runs")
    return [dict(table) for table in tables] or [{}] * n


def _places(first: Array, low: Array, high: Array, n: int, seed: int) -> Iterator[Array]:
    """Where searches start: n places, the first one given."""
    yield first
    random = np.random.default_rng(seed)
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.where(low > 0, np.log(low), low), np.where(low > 0, np.log(high), high)
    for _ in range(n - 1):
        x = random.uniform(*ends)
        yield np.clip(np.where(low > 0, np.exp(np.where(low > 0, x, 0.0)), x), low, high)


@np.errstate(over="ignore", invalid="ignore")  # of runs that explode, which say so
def _search(
    problem: FitResiduals, start: Array, low: Array, high: Array, scale: Array, shares: Sequence[float],
    tell: Callable[[str], None], where: str,
) -> Attempt:  # fmt: skip
    """Attempt from a start over growing shares of the samples.

    Raises:
        MbdaeError: of a run that fails where a search begins.
    """
    x, message, converged, r = start, "", False, np.empty(0)
    for share in shares:
        problem.share, tolerance = share, TOLERANCE if share == 1 else ROUGH
        tell(f"{where}{share:.0%} of the samples")
        problem.solved(x)
        result = least_squares(
            problem.residuals, x, problem.jacobian, (low, high), x_scale=scale,
            ftol=tolerance, xtol=tolerance, gtol=tolerance,
        )  # fmt: skip
        x, message, converged, r = result.x, result.message, result.status > 0, result.fun
    begun, ended = (dict(zip(problem.names, y.tolist(), strict=True)) for y in (start, x))
    return Attempt(begun, ended, float(r @ r), converged, message)


def _unknown(make: MechanismFactory, name: str, given: Any) -> Unknown:
    """A parameter with its bounds.

    Raises:
        InputError: for what are no bounds.
    """
    numbers = reals(given)
    if len(numbers) not in (2, 3) or not np.isfinite(numbers).all() or not numbers[-2] < numbers[-1]:
        raise InputError(
            f"parameter {name!r} takes (low, high) or (start, low, high) with low < high, got {given!r:.60}"
        )
    *start, low, high = numbers
    if not start:
        own = (low + high) / 2
        if isinstance(make, Template):
            try:
                own = number(make, name)
            except InputError as e:
                if "is no number" not in str(e):
                    raise
        start = [own if low < own < high else (low + high) / 2]
    if not low <= start[0] <= high:
        raise InputError(f"parameter {name!r} starts at {start[0]:g}, outside its bounds {low:g} to {high:g}")
    return Unknown(start[0], low, high)


def _result(problem: FitResiduals, searches: list[Attempt], low: Array, high: Array, scale: Array) -> Fit:
    best = min(searches, key=lambda s: s.chi2)
    x, problem.share = np.array(list(best.values.values())), 1.0
    r, J, names = problem.residuals(x), problem.jacobian(x) * scale, problem.names
    _, sizes, V = np.linalg.svd(J, full_matrices=False)
    kept = sizes > LOST * sizes.max(initial=0.0)
    lost = V[~kept] if len(V) == len(x) else np.eye(len(x))
    chi2, dof = float(r @ r), len(r) - len(x)
    covariance = (V[kept].T / sizes[kept] ** 2) @ V[kept] * np.outer(scale, scale)
    if not problem.given and dof > 0:
        covariance *= chi2 / dof
    deviation = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlations = covariance / np.outer(deviation, deviation)
    untold = [tuple(n for n, share in zip(names, row, strict=True) if abs(share) > SHARE) for row in lost]
    for group in untold:
        deviation[[names.index(n) for n in group]] = np.inf
    untold += [(n,) for n, d, width in zip(names, deviation, high - low, strict=True) if width < d < np.inf]
    for i in range(len(names)):
        untold += [(names[j], names[i]) for j in range(i) if abs(correlations[i, j]) > TIED
                   and min(deviation[i] / (high - low)[i], deviation[j] / (high - low)[j]) > 1e-2]  # fmt: skip
    near = TOLERANCE * (high - low) + 1e-6 * scale
    at_bounds = [n for n, at in zip(names, (x - low < near) | (high - x < near), strict=True) if at]
    computed = [{name: computed_signals(sol, [name])[name] for name in record.columns}
                for record, sol in zip(problem.found, problem.solved(x), strict=True)]  # fmt: skip
    residuals = [{name: (c[name] - record.columns[name]) / problem.sigma[name] for name in c}
                 for c, record in zip(computed, problem.found, strict=True)]  # fmt: skip
    probability = float(chi2_distribution.sf(chi2, dof)) if problem.given and dof > 0 else np.nan
    mech = problem.solved(x)[0].mechanism
    every = units(mech)
    return Fit(
        mech.title,
        dict(zip(names, x.tolist(), strict=True)),
        dict(zip(names, deviation.tolist(), strict=True)),
        covariance, correlations, chi2, dof, probability, list(dict.fromkeys(untold)), at_bounds, residuals, computed,
        [record.columns for record in problem.found], [record.t for record in problem.found],
        [record.name for record in problem.found], problem.runs, problem.gradients, best.converged, best.message,
        searches, {name: every[name] for record in problem.found for name in record.columns},
    )  # fmt: skip
