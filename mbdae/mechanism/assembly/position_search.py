"""Assembly analysis: the configuration near an initial estimate with g(t, q) = 0, by damped Gauss-Newton steps.

All thresholds are in rad and in characteristic lengths of the mechanism.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...errors import AssemblyError, InputError, StepError
from ...system import Array
from ...tolerances import AGREEMENT, SOLUTION_ROUNDING, THREE_DIGITS, TRUNCATION, VISIBLE
from ..closures.closure_error import ClosureError, largest_error
from ..closures.independent_rows import MANY_ROWS
from .flipped_frames import Jacobian, Residuals, flipped_closure, residuals_with_directions, scaled_residuals

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism

ITERATIONS = 100
WIDTHS = (0.1, 0.4, 1.5, 3.0)  # widths of random displacements of the initial estimate
STARTS = 6  # starts for each width
FRACTIONS = [0.5**k for k in range(12)]  # fractions of a step, in its line search
NEAR = 0.05  # change of a coordinate: a solution this close to the estimate is always accepted
APPROACHES = 10  # steps along the null space towards the estimate
DAMPING = 0.1  # initial damping, as a fraction of |g|
SLOW = 0.5  # remaining fraction of |g|, above which a step shorter than NEAR is overdamped
DAMPING_REDUCTION = 0.1  # factor of the damping after an overdamped step
STATIONARY = VISIBLE  # fraction of |g|: a smaller predicted decrease means that |g| has a minimum
MIN_DAMPING = SOLUTION_ROUNDING  # fraction of the largest diagonal entry of G G^T, which dependent rows make singular


def close_position(system: "Index2System", q: Array, fixed: Array, t: float) -> Array:
    """Return the configuration near q that closes all loops; coordinates with tangent indices ``fixed`` do not change.

    Gauss-Newton steps start from q; if they fail, or end far from q, also from random displacements of q of increasing
    size, which are the same in each call. The nearest solution is moved towards q along its null space.

    Raises:
        AssemblyError: if no start leads to |g| below 1e-10; names the closure with the largest violation for the start
            with the smallest |g|.
        InputError: if a frame or axis is flipped in all solutions, or numbers are not finite.
    """
    mech, free = system.mechanism, np.delete(np.arange(system.nv), fixed)
    if not mech.ng:
        return q
    _require_finite(system, q, t)
    if not np.count_nonzero(system.constraints.positional):
        return q
    search = _PositionSearch(system, q, free, t, [], [])
    search.start_from((q,))
    if search.closed and search.largest_change(search.closed[0]) < NEAR:
        return search.closed[0]
    g, G = scaled_residuals(system, q, t)
    mu = DAMPING * float(np.abs(g).max())  # independent of the number of loops
    if len(g) > MANY_ROWS:
        mu *= DAMPING_REDUCTION**3  # see `gauss_newton`: a damped step in a long chain would be too short
    search.widen(reach=1.2 * float(np.abs(_damped_step(G, g, free, mu)).max()) + NEAR)
    if not search.closed:
        search.flip_back()
    if search.closed:
        return search.approach(min(search.closed, key=search.distance))
    raise search.failure(fixed)


def _require_finite(system: "Index2System", q: Array, t: float) -> None:
    try:
        g, G = system.closures_dense_or_sparse(q, t)
    except StepError as e:
        raise InputError(f"the initial estimate cannot be assembled: {e}") from e
    with np.errstate(over="ignore", invalid="ignore"):
        finite = np.isfinite(g) & np.isfinite(G @ np.ones(system.nv))
    if not finite.all():
        worst = system.mechanism.row_names[int(np.argmin(finite))]
        raise InputError(f"closure {worst!r} is not finite: numbers in the model are too large")


@dataclass
class _PositionSearch:
    """Results of Gauss-Newton steps from several starts: all results, and those with closed loops."""

    system: "Index2System"
    guess: Array
    free: Array
    t: float
    found: list[Array]
    closed: list[Array]

    def distance(self, q: Array) -> float:
        """Return the distance of a configuration from the initial estimate."""
        mech = self.system.mechanism
        return float(np.linalg.norm(mech.manifold.difference(self.guess, q) / mech.coordinate_scales))

    def largest_change(self, q: Array) -> float:
        """Return the largest change of a coordinate: unlike the norm, it does not grow with the number of loops."""
        mech = self.system.mechanism
        return float(np.abs(mech.manifold.difference(self.guess, q) / mech.coordinate_scales).max())

    def start_from(self, starts: Iterable[Array]) -> None:
        """Search from some configurations, and add the results."""
        results = [gauss_newton(self.system, start, self.free, self.t) for start in starts]
        self.found += results
        self.closed += [x for x in results if is_closed(self.system, x, self.t)]

    def widen(self, reach: float) -> None:
        """Search from increasing displacements until a closed configuration is within reach.

        Large displacements are tried only if no closed configuration is known.
        """
        for width in WIDTHS:
            if any(self.largest_change(x) <= reach for x in self.closed) or (self.closed and width > WIDTHS[1]):
                return
            self.start_from(self.displaced(width))

    def displaced(self, *widths: float) -> Iterator[Array]:
        """Yield random displacements of the initial estimate, the same in each call, by at most a width."""
        mech = self.system.mechanism
        for width in widths:
            rng = np.random.default_rng(0)
            for _ in range(STARTS):
                x = np.zeros(mech.nv)
                x[self.free] = width * rng.uniform(-1, 1, len(self.free))
                yield mech.manifold.integrate(self.guess, mech.coordinate_scales * x)

    def flip_back(self) -> None:
        """If loops close with a flipped frame, align directions first, and search from the aligned configuration."""
        if not any(_residual_norm(self.system, x, self.t) <= AGREEMENT for x in self.found):
            return
        for start in (self.guess, *self.displaced(*WIDTHS[1:3])):
            aligned = gauss_newton(self.system, start, self.free, self.t, residuals_with_directions)
            q = gauss_newton(self.system, aligned, self.free, self.t)
            if is_closed(self.system, q, self.t):
                self.closed = [q]
                return

    def approach(self, q: Array) -> Array:
        """Move a closed configuration along its null space towards the initial estimate."""
        system, mech, free = self.system, self.system.mechanism, self.free
        for _ in range(APPROACHES):
            d = (mech.manifold.difference(q, self.guess) / mech.coordinate_scales)[free]
            G = scaled_residuals(system, q, self.t)[1][:, free]
            tangential = d - _damped_step(G, -G @ d, np.arange(len(free)), 0.0)
            if np.linalg.norm(d) < NEAR or np.linalg.norm(tangential) < 0.1 * np.linalg.norm(d):
                break
            x = np.zeros(mech.nv)
            x[free] = tangential / max(1.0, 2 * np.abs(tangential).max())
            new = gauss_newton(system, mech.manifold.integrate(q, mech.coordinate_scales * x), free, self.t)
            if not is_closed(system, new, self.t) or self.distance(new) >= self.distance(q):
                break
            q = new
        return q

    def failure(self, fixed: Array) -> InputError | AssemblyError:
        """Return the error for the result with the smallest residual."""
        best = min(self.found, key=lambda x: _residual_norm(self.system, x, self.t))
        if _residual_norm(self.system, best, self.t) <= AGREEMENT:
            name = flipped_closure(self.system)
            return InputError(f"closure {name!r} closes with its second frame flipped: change the initial estimate")
        violation = largest_error(self.system.mechanism, self.system.closures(best, self.t)[0])
        return assembly_error(self.system.mechanism, violation, fixed, "configuration")


def gauss_newton(system: "Index2System", q: Array, free: Array, t: float, rows: Residuals = scaled_residuals) -> Array:
    """Return the last configuration of damped Gauss-Newton steps with line search.

    Steps are at most one radian or characteristic length long, to stay on the branch. The damping mu of `_damped_step`
    is initially |g|/10. With many rows its ratio to |g| is reduced after each short step that does not halve |g|: in
    long chains the smallest singular value of G is far below sqrt(mu). With few rows such steps indicate a singular
    configuration, and remain short; iteration stops where |G x + g| is almost |g|, at a local minimum with open loops.
    """
    m, scales = system.manifold, system.mechanism.coordinate_scales
    g, G = rows(system, q, t)
    size, closed, damping = float(np.linalg.norm(g)), False, DAMPING
    for _ in range(ITERATIONS):
        if closed or not np.isfinite(G if isinstance(G, np.ndarray) else G.data).all():
            break
        closed = size <= SOLUTION_ROUNDING  # one more step reduces g to rounding
        x = _damped_step(G, g, free, damping * size)
        if not closed and len(g) <= MANY_ROWS and np.linalg.norm(G @ x + g) > (1 - STATIONARY) * size:
            break
        x /= max(1.0, np.abs(x).max())
        for fraction in FRACTIONS[:1] if closed else FRACTIONS:
            q_new = m.integrate(q, scales * fraction * x)
            g_new, G_new = rows(system, q_new, t)
            if (new_size := float(np.linalg.norm(g_new))) < size:
                break
        else:
            break
        slow = np.abs(fraction * x).max() < NEAR and new_size > SLOW * size
        if slow and len(g) > MANY_ROWS:
            damping *= DAMPING_REDUCTION
        q, g, G, size = q_new, g_new, G_new, new_size
    return q


def _damped_step(G: Jacobian, g: Array, free: Array, mu: float) -> Array:
    """Return the x that minimizes |G x + g|^2 + mu |x|^2, which remains bounded where G is nearly singular."""
    x = np.zeros(G.shape[1])
    if len(g) > MANY_ROWS:
        x[free] = -sparse_least_squares(G[:, free], g, mu)
        return x
    n = len(free)
    damped = np.vstack([G[:, free], np.sqrt(mu) * np.eye(n)])
    x[free] = -np.linalg.lstsq(damped, np.concatenate([g, np.zeros(n)]), rcond=TRUNCATION)[0]
    return x


def sparse_least_squares(G: Jacobian, g: Array, mu: float, M: Jacobian | None = None) -> Array:
    """Return the x that minimizes |G x - g|^2 + mu x^T M x for sparse G, M = 1 if omitted.

    With G x - g = mu y this is [M, G^T; G, -mu] [x; y] = [0; g], solved by a sparse LU.
    """
    from scipy.sparse import block_array, csc_array, eye_array
    from scipy.sparse.linalg import splu

    rows, metric = csc_array(G), eye_array(G.shape[1]) if M is None else csc_array(M)
    mu = max(mu, MIN_DAMPING * float((rows.power(2) @ (1 / metric.diagonal())).max()))
    if not mu:  # G vanishes
        return np.zeros(G.shape[1])
    system = splu(block_array([[metric, rows.T], [rows, -mu * eye_array(len(g))]], format="csc"))
    return system.solve(np.concatenate([np.zeros(G.shape[1]), g]))[: G.shape[1]]


def _residual_norm(system: "Index2System", q: Array, t: float) -> float:
    residual = float(np.linalg.norm(scaled_residuals(system, q, t)[0]))
    return residual if np.isfinite(residual) else np.inf


def is_closed(system: "Index2System", q: Array, t: float) -> bool:
    """Return whether all loops are closed and no frame is flipped."""
    return _residual_norm(system, q, t) <= AGREEMENT and not flipped_closure(system)


def assembly_error(mech: "Mechanism", violation: ClosureError, fixed: Array, what: str) -> AssemblyError:
    """Return the error that names the closure with the largest violation, its size, the fixed joints and drivers."""
    joints = ", ".join(dict.fromkeys(mech.coordinate_joint(int(i)) for i in fixed)) or "nothing"
    driven = "; driven by " + ", ".join(repr(d.name) for d in mech.drivers) if mech.drivers else ""
    text = f"no consistent {what}: {violation.message()} (fixed: {joints}{driven})"
    if violation.relative < THREE_DIGITS:
        text += "; so small a violation may come from axes that are not quite parallel: give all digits, or fewer rows"
    return AssemblyError(text, violation.name, violation.size)
