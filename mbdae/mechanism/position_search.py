"""The configuration near an initial estimate that closes every loop: g(t, q) = 0 by damped Gauss-Newton.

All thresholds are of rad and of characteristic lengths of the mechanism.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import AssemblyError, InputError, StepError
from ..system import Array
from ..tolerances import AGREEMENT, SOLUTION_ROUNDING, THREE_DIGITS, TRUNCATION
from .closures.closure_error import ClosureError, largest_error
from .closures.independent_rows import MANY_ROWS
from .flipped_frames import Residuals, closures, flipped_closures, with_directions

if TYPE_CHECKING:
    from .formulations.index2 import Index2System
    from .mechanism import Mechanism

ITERATIONS = 100
WIDTHS = (0.1, 0.4, 1.5, 3.0)  # displacements of the guess when it leads nowhere, or far
STARTS = 6  # of each width
NEAR = 0.05  # of a coordinate from the guess: counts as near in any case
SLIDES = 10
DAMPING = 0.1  # of |g|, at the start
SLOW = 0.5  # of |g|: a step shorter than NEAR that leaves more of it is damped too much
LESS = 0.1  # of the damping, after such a step
LEAST_DAMPING = SOLUTION_ROUNDING  # of the largest diagonal entry of G G^T: dependent rows make it singular without


def close_position(system: "Index2System", q: Array, held: Array, t: float) -> Array:
    """Find the configuration near q that closes every loop, coordinates ``held`` (their tangent indices) kept.

    Gauss-Newton from q itself; where that fails, or ends far from q, from the same small and larger displacements of
    q every time. Of the configurations found, the nearest is taken, and moved nearer where the mechanism is free to.

    Raises:
        AssemblyError: if |g| falls below 1e-10 from nowhere; says what stays open from the start that came nearest.
        InputError: if a frame or axis is turned over in all that is found, or numbers are not finite.
    """
    mech, free = system.mechanism, np.delete(np.arange(system.nv), held)
    if not mech.ng:
        return q
    _require_finite(system, q, t)
    g, G = closures(system, q, t)
    if not len(g):
        return q
    search = _PositionSearch(system, q, free, t, [], [])
    search.start_from((q,))
    if search.closed and search.largest_move(search.closed[0]) < NEAR:
        return search.closed[0]
    each = float(np.abs(g).max() / (np.linalg.norm(g) or 1.0))  # the damping does not grow with the number of loops
    search.widen(reach=1.2 * float(np.abs(_newton(G, g, free, DAMPING * each)).max()) + NEAR)
    if not search.closed:
        search.turn_back()
    if search.closed:
        return search.slide(min(search.closed, key=search.distance))
    raise search.failure(held)


def _require_finite(system: "Index2System", q: Array, t: float) -> None:
    try:
        g, G = system.closures(q, t)
    except StepError as e:
        raise InputError(f"the guess cannot be assembled: {e}") from e
    if not (np.isfinite(g).all() and np.isfinite(G).all()):
        worst = system.mechanism.row_names[int(np.argmin(np.isfinite(g) & np.isfinite(G).all(axis=1)))]
        raise InputError(f"closure {worst!r} is not finite: numbers in the model are too large")


@dataclass
class _PositionSearch:
    """Configurations found from several starts: all that Gauss-Newton ended in, and those in which loops are closed."""

    system: "Index2System"
    guess: Array
    free: Array
    t: float
    found: list[Array]
    closed: list[Array]

    def distance(self, q: Array) -> float:
        """Return how far a configuration is from the initial estimate."""
        mech = self.system.mechanism
        return float(np.linalg.norm(mech.manifold.difference(self.guess, q) / mech.coordinate_scales))

    def largest_move(self, q: Array) -> float:
        """Return the largest distance of a coordinate: unlike the norm, it does not grow with the number of loops."""
        mech = self.system.mechanism
        return float(np.abs(mech.manifold.difference(self.guess, q) / mech.coordinate_scales).max())

    def start_from(self, starts: Iterable[Array]) -> None:
        """Search from some configurations."""
        more = [gauss_newton(self.system, start, self.free, self.t) for start in starts]
        self.found += more
        self.closed += [x for x in more if is_closed(self.system, x, self.t)]

    def widen(self, reach: float) -> None:
        """Search from larger and larger displacements until a closed configuration is within reach.

        Large ones are tried only where none is closed.
        """
        for width in WIDTHS:
            if any(self.largest_move(x) <= reach for x in self.closed) or (self.closed and width > WIDTHS[1]):
                return
            self.start_from(self.displaced(width))

    def displaced(self, *widths: float) -> Iterator[Array]:
        """Yield displacements of the initial estimate, by at most a width; they are the same every time."""
        mech = self.system.mechanism
        for width in widths:
            rng = np.random.default_rng(0)
            for _ in range(STARTS):
                x = np.zeros(mech.nv)
                x[self.free] = width * rng.uniform(-1, 1, len(self.free))
                yield mech.manifold.integrate(self.guess, mech.coordinate_scales * x)

    def turn_back(self) -> None:
        """Search where loops close with a frame turned over: turn it back first."""
        if not any(_open(self.system, x, self.t) <= AGREEMENT for x in self.found):
            return
        for start in (self.guess, *self.displaced(*WIDTHS[1:3])):
            turned = gauss_newton(self.system, start, self.free, self.t, with_directions)
            q = gauss_newton(self.system, turned, self.free, self.t)
            if is_closed(self.system, q, self.t):
                self.closed = [q]
                return

    def slide(self, q: Array) -> Array:
        """Move a closed configuration far from the initial estimate towards it, along the free motions."""
        system, mech, free = self.system, self.system.mechanism, self.free
        for _ in range(SLIDES):
            d = (mech.manifold.difference(q, self.guess) / mech.coordinate_scales)[free]
            G = closures(system, q, self.t)[1][:, free]
            along = d - _newton(G, -G @ d, np.arange(len(free)), 0.0)
            if np.linalg.norm(d) < NEAR or np.linalg.norm(along) < 0.1 * np.linalg.norm(d):
                break
            x = np.zeros(mech.nv)
            x[free] = along / max(1.0, 2 * np.abs(along).max())
            new = gauss_newton(system, mech.manifold.integrate(q, mech.coordinate_scales * x), free, self.t)
            if not is_closed(system, new, self.t) or self.distance(new) >= self.distance(q):
                break
            q = new
        return q

    def failure(self, held: Array) -> InputError | AssemblyError:
        """Return the error that says why nothing is closed, by what came nearest."""
        best = min(self.found, key=lambda x: _open(self.system, x, self.t))
        if _open(self.system, best, self.t) <= AGREEMENT:
            name = flipped_closures(self.system)
            return InputError(f"closure {name!r} closes with its second frame turned over: change the guess")
        gap = largest_error(self.system.mechanism, self.system.closures(best, self.t)[0])
        return open_closure(self.system.mechanism, gap, held, "configuration")


def gauss_newton(system: "Index2System", q: Array, free: Array, t: float, rows: Residuals = closures) -> Array:
    """Damped steps with line search, at most one radian or characteristic length at a time: stay on the branch.

    The damping mu of `_newton` is |g|/10 at first. With many rows it is a tenth of the previous share of |g| after each
    short step that did not halve |g|: in long chains the smallest singular value of G is far below sqrt(mu). With few
    rows this means a singular configuration, where steps stay short.
    """
    m, scales = system.manifold, system.mechanism.coordinate_scales
    g, G = rows(system, q, t)
    closed, share = False, DAMPING
    for _ in range(ITERATIONS):
        if closed or not np.isfinite(G).all():
            break
        closed = bool(np.linalg.norm(g) <= SOLUTION_ROUNDING)  # one more step leaves rounding
        x = _newton(G, g, free, share)
        x /= max(1.0, np.abs(x).max())
        for part in 0.5 ** np.arange(12):
            q_new = m.integrate(q, scales * part * x)
            g_new, G_new = rows(system, q_new, t)
            if np.linalg.norm(g_new) < np.linalg.norm(g):
                break
        else:
            break
        slow = np.abs(part * x).max() < NEAR and np.linalg.norm(g_new) > SLOW * np.linalg.norm(g)
        if slow and len(g) > MANY_ROWS:
            share *= LESS
        q, g, G = q_new, g_new, G_new
    return q


def _newton(G: Array, g: Array, free: Array, share: float = DAMPING) -> Array:
    """The step x that minimises |G x + g|^2 + mu |x|^2 with mu = share |g|: short where G is nearly singular."""
    x, mu = np.zeros(G.shape[1]), share * float(np.linalg.norm(g))
    if len(g) > MANY_ROWS:
        x[free] = -_sparse_least_squares(G[:, free], g, mu)
        return x
    n = len(free)
    damped = np.vstack([G[:, free], np.sqrt(mu) * np.eye(n)])
    x[free] = -np.linalg.lstsq(damped, np.concatenate([g, np.zeros(n)]), rcond=TRUNCATION)[0]
    return x


def _sparse_least_squares(G: Array, g: Array, mu: float) -> Array:
    """The x that minimises |G x - g|^2 + mu |x|^2 by sparse factors of G G^T + mu 1: each row has few columns."""
    from scipy.sparse import csc_array, eye_array
    from scipy.sparse.linalg import splu

    rows = csc_array(G)
    S = rows @ rows.T
    mu = max(mu, LEAST_DAMPING * float(S.diagonal().max()))
    return rows.T @ splu((S + mu * eye_array(len(g))).tocsc()).solve(g)


def _open(system: "Index2System", q: Array, t: float) -> float:
    residual = float(np.linalg.norm(closures(system, q, t)[0]))
    return residual if np.isfinite(residual) else np.inf


def is_closed(system: "Index2System", q: Array, t: float) -> bool:
    """Whether all loops are closed, with no frame turned over."""
    return _open(system, q, t) <= AGREEMENT and not flipped_closures(system)


def open_closure(mech: "Mechanism", gap: ClosureError, held: Array, what: str) -> AssemblyError:
    """The error that says which closure stays open the most, by how much, and what was held."""
    joints = ", ".join(dict.fromkeys(mech.coordinate_joint(int(i)) for i in held)) or "nothing"
    text = f"no consistent {what}: {gap.says('stays open')} (held: {joints})"
    if gap.relative < THREE_DIGITS:
        text += "; a gap as small as that: axes that are not quite parallel? give all digits, or keep fewer rows"
    return AssemblyError(text, gap.name, gap.size)
