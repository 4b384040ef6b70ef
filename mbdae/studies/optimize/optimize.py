"""Numbers of a mechanism by which a cost of its motion is least: a bridge to `scipy.optimize`.

    minimise c(p),   low <= p <= high,   low_j <= c_j(p) <= high_j

by sequential least squares (Kraft, DFVLR-FB 88-28 (1988)) or another search of scipy with exact gradients: those of the
adjoint of a run (`mbdae.gradient`), or along a curve of poses (`mbdae.kinematics`) by the implicit function theorem.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import Bounds, NonlinearConstraint, minimize

from ...errors import InputError, MbdaeError, UnknownNameError, is_number, require
from ...mechanism import Mechanism
from ...system import Array
from ..sensitivity.cost import Cost
from ..sensitivity.run_parameters import Names, mechanism_factory, named_values, reals, scaled, teller
from .objective import Measured, Motion, Moves, curves, runs
from .result import Evaluation, Optimum

__all__ = ["optimize"]

SEARCHES = ("SLSQP", "L-BFGS-B")  # of scipy
ROUNDED = 8  # of SLSQP: no step along its direction makes the cost less
FLAT = 1e-6  # of the cost at the start over a scale of a parameter: its slope where a search ends by rounding
HOLDS = 1e-6  # of its size: by how much a constraint may be missed
Pair = tuple[float | None, float | None]


def optimize(
    model: str | Path | Mechanism | Callable[..., Mechanism],
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
    """Find the numbers p of a mechanism by which a cost of its motion is least.

        minimise c(p),   low <= p <= high,   low_j <= c_j(p) <= high_j

    by sequential least squares (Kraft, DFVLR-FB 88-28 (1988)), or another search of scipy, with exact gradients.

    The motion is a run from the mechanism's start; or, with ``drive``, the curve of its poses over an input, where
    nothing but positions, their rates and holding efforts matter. What cannot be computed with some numbers (loops that
    do not close, runs that fail) counts as infinitely costly; the start must be computable.

    Args:
        model: what `mbdae.load` takes, a mechanism that was loaded, or a function that makes one.
        cost: signals -> (value, {signal: derivative (n,)}), see `mbdae.gradient`; or `mbdae.Squares`. The parameters
            are among the signals, with one number as derivative. Signals of runs are those of `mbdae.Solution.signals`;
            of curves ``u``, ``q.<joint>``, ``v.<joint>`` (per unit speed of the drive), ``position.<frame>.x``, .y, .z,
            and ``holding``, what the drive must give to hold each pose at rest, in N m or N.
        parameters: dotted names, as of sweeps; or name = value, where the search starts.
        bounds: (low, high) of parameters, None for none.
        constraints: by a name of one's own, (function like a cost, low, high), None for none; equal ends are allowed.
        t_span: start and end of the run; 0 and the model's duration when left out.
        drive: a joint or driver, the input of a curve of poses.
        scales: by which size a parameter typically changes; a tenth of its range, or of its value, when left out.
        search: ``"SLSQP"`` or, without constraints, ``"L-BFGS-B"``.
        tolerance: where the search ends, relative to the cost at the start.
        iterations: at most.
        progress: told what is done, in words.
        settings: arguments of `mbdae.solve`; or, with ``drive``, of `mbdae.kinematics`: span, turns, hold, points, q.

    Raises:
        InputError: for a start that cannot be computed, bounds that are none, signals or parameters without a gradient.
        UnknownNameError: for names that lead nowhere.
    """
    if not callable(cost):
        raise InputError(f"a cost is a function of signals that returns (value, slopes), got {cost!r:.60}")
    counted = isinstance(iterations, int) and not isinstance(iterations, bool) and iterations >= 1
    if not (counted and is_number(tolerance) and tolerance > 0):
        raise InputError(f"iterations and tolerance are positive, got {iterations!r:.30} and {tolerance!r:.30}")
    if drive is not None and t_span is not None:
        raise InputError("a curve over a drive has no t_span: give span, the range of the drive, or leave drive out")
    if search not in SEARCHES:
        raise UnknownNameError("search", search, SEARCHES)
    if search == "L-BFGS-B" and constraints:
        raise InputError("search 'L-BFGS-B' takes no constraints, only bounds")
    loaded = model if isinstance(model, Mechanism) else None
    make = mechanism_factory(loaded, None if loaded else model)
    start = _start(make, parameters)
    box = _pairs("parameter", start, _table("bounds", bounds))
    limits = {name: _limits(name, given) for name, given in _table("constraints", constraints).items()}
    for name, x in start.items():
        low, high = box[name]
        if not low <= x <= high:
            raise InputError(f"parameter {name!r} starts at {x:g}, outside its bounds {low:g} to {high:g}")
    moves = curves(make, drive, make.make(start), settings) if drive is not None else runs(make, t_span, settings)
    functions = {name: x[0] for name, x in (constraints or {}).items()}
    problem = Problem(moves, cost, functions, start, limits, teller(progress))
    return problem.solve(box, _scales(start, box, scales), search, tolerance, iterations)


class Problem:
    """The cost and the constraints as functions of coordinates z, p = p_0 + scale z, in units of their sizes."""

    def __init__(
        self,
        moves: Moves,
        cost: Cost,
        functions: Mapping[str, Cost],
        start: dict[str, float],
        limits: dict[str, tuple[float, float]],
        progress: Callable[[str], None],
    ) -> None:
        self.moves, self.functions, self.limits = moves, {"": cost, **functions}, limits
        self.start, self.tell, self.scale = start, progress, np.ones(len(start))
        self.history: list[Evaluation] = []
        self.last: tuple[Array, dict[str, Measured]] | None = None
        self.best: tuple[Evaluation, Motion, dict[str, Measured]] | None = None
        self.z = np.zeros(len(start))
        first = self.measure(self.z)
        for m in first.values():
            m.slopes()  # parameters without a derivative are refused here
        self.sizes = {name: abs(m.value) or 1.0 for name, m in first.items()}
        for name, pair in limits.items():
            self.sizes[name] = max([abs(x) for x in pair if np.isfinite(x)], default=0.0) or self.sizes[name]

    def values(self, z: Array) -> dict[str, float]:
        """The parameters."""
        return {name: x + float(s * y) for (name, x), s, y in zip(self.start.items(), self.scale, z, strict=True)}

    def measure(self, z: Array) -> dict[str, Measured]:
        """The cost and the constraints at a point; an infinite cost where they cannot be computed."""
        if self.last is not None and (self.last[0] == z).all():
            return self.last[1]
        values = self.values(z)
        try:
            motion = self.moves(values)
            found = {
                name: motion.measure(function, f"constraint {name!r}" if name else "")
                for name, function in self.functions.items()
            }
        except MbdaeError as e:
            if not self.history:
                raise
            self.history.append(Evaluation(values, np.nan, {}, str(e)))
            assert self.best is not None  # the start was computed
            found = {**self.best[2], "": Measured(np.inf, lambda: np.zeros(len(z)))}
        else:
            tried = Evaluation(values, found[""].value, {name: m.value for name, m in found.items() if name})
            self.history.append(tried)
            if self.best is None or self.rank(tried) < self.rank(self.best[0]):
                self.best = tried, motion, found
        self.tell(f"{len(self.history)} motions, cost {self.best[0].cost:.6g}" if self.best else "")
        self.last = z.copy(), found
        return found

    def missed(self, tried: Evaluation) -> float:
        """By how much the constraints are missed, in their sizes; 0 where they hold."""
        found = [(x, self.sizes[name], *self.limits[name]) for name, x in tried.constraints.items()]
        parts = [max(low - x, x - high) / size for x, size, low, high in found]
        return max((x for x in parts if x > HOLDS), default=0.0)

    def rank(self, tried: Evaluation) -> tuple[float, float]:
        """Points that keep the constraints come first, by their cost; others by what they miss."""
        return (self.missed(tried) if len(self.history) > 1 else 0.0), tried.cost

    def value(self, z: Array, name: str = "") -> float:
        """The cost or a constraint, in its size."""
        return self.measure(z)[name].value / self.sizes[name]

    def slopes(self, z: Array, name: str = "") -> Array:
        """Their derivatives by z, (k,)."""
        return self.measure(z)[name].slopes() * self.scale / self.sizes[name]

    def solve(
        self, box: dict[str, tuple[float, float]], scale: Array, search: str, tolerance: float, iterations: int
    ) -> Optimum:
        """Search, and return the best point; what was found so far where the user or an error stops it."""
        start = np.array(list(self.start.values()))
        low, high = (np.array([pair[i] for pair in box.values()]) for i in (0, 1))
        self.scale, interrupted, sloped = scale, False, True
        rows = [
            NonlinearConstraint(
                lambda z, n=name: self.value(z, n), pair[0] / self.sizes[name], pair[1] / self.sizes[name],
                jac=lambda z, n=name: self.slopes(z, n)[None],
            )
            for name, pair in self.limits.items()
        ]  # fmt: skip
        try:
            result = minimize(
                self.value, self.z, jac=self.slopes, method=search, constraints=rows,
                bounds=Bounds((low - start) / scale, (high - start) / scale),
                options={"ftol": tolerance, "maxiter": iterations},
            )  # fmt: skip
            converged, message = bool(result.success), str(result.message)
            if search == "SLSQP" and result.get("status") == ROUNDED:  # none where all parameters are fixed
                converged = not rows and self.flat(result.x, (low - start) / scale, (high - start) / scale)
        except KeyboardInterrupt:
            converged, interrupted, message = False, True, "stopped by the user"
        except MbdaeError as e:  # a point without slopes, or what is told of progress
            converged, message, sloped = False, str(e), False
        assert self.best is not None  # the start was computed
        best, motion, found = self.best
        missing = [n for n in self.limits if self.missed(best._replace(constraints={n: best.constraints[n]}))]
        if missing and not interrupted:
            converged, message = False, f"constraint {missing[0]!r} does not hold; {message}"
        gradient = dict(zip(self.start, (found[""].slopes() if sloped else self.z * np.nan).tolist(), strict=True))
        return Optimum(
            best.values, best.cost, gradient, best.constraints, self.limits, box, motion.result.mechanism,
            motion.result, tuple(self.history), converged, interrupted, message,
        )  # fmt: skip

    def flat(self, z: Array, low: Array, high: Array) -> bool:
        """Whether the cost has no slope within the bounds."""
        inside = np.clip(z - self.slopes(z), low, high) - z
        return bool(np.abs(inside).max(initial=0.0) < FLAT)


def _start(make: Any, names: Names) -> dict[str, float]:
    if not names:
        raise InputError("a search needs parameters: a list of names, or name = value")
    return named_values(make, names)


def _pairs(
    what: str, names: Mapping[str, Any], given: Mapping[str, Sequence[float | None]]
) -> dict[str, tuple[float, float]]:
    for name in given:
        if name not in names:
            raise UnknownNameError(what, name, names)
    return {name: _pair(f"{what} {name!r}", given.get(name, (None, None))) for name in names}


def _table(what: str, given: Any) -> Mapping[str, Any]:
    require(given if given is not None else {}, Mapping, f"{what} are a table by name")
    return given or {}


def _limits(name: str, given: Any) -> tuple[float, float]:
    if not (isinstance(name, str) and name):
        raise InputError(f"constraints have names of one's own, texts that are not empty, got {name!r:.60}")
    if not (isinstance(given, Sequence) and len(given) == 3 and callable(given[0])):
        raise InputError(f"constraint {name!r} takes (function, low, high), got {given!r:.60}")
    found = _pair(f"constraint {name!r}", given[1:])
    if not np.isfinite(found).any():
        raise InputError(f"constraint {name!r} has no limit: low, high or both are numbers")
    return found


def _pair(what: str, given: Any) -> tuple[float, float]:
    """The lower and the upper end of a range.

    Raises:
        InputError: for what is none.
    """
    pair = list(given) if isinstance(given, list | tuple | np.ndarray) else []
    ends = reals([open_end if x is None else x for x, open_end in zip(pair, (-np.inf, np.inf), strict=False)])
    if not (len(pair) == len(ends) == 2 and ends[0] <= ends[1] and ends[0] < np.inf and ends[1] > -np.inf):
        raise InputError(f"{what} takes (low, high) with low <= high, None for no end, got {given!r:.60}")
    return ends[0], ends[1]


def _scales(start: Mapping[str, float], box: Mapping[str, tuple[float, float]], given: Any) -> Array:
    usual = {}
    for name, x in start.items():
        width = box[name][1] - box[name][0]
        usual[name] = (width if np.isfinite(width) else abs(x) or 10.0) / 10 or 1.0
    return scaled(given, usual)
