"""Redundant constraint rows: rank, and selection of well-conditioned independent rows."""

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from ...discovery import lazy_import
from ...errors import StepError
from ...linear_solve import lapack
from ...tolerances import AMBIGUOUS_PIVOT, BELOW_ROUNDING, EPS, PIVOT_RANK, SUM_ROUNDING, TRUNCATION

if TYPE_CHECKING:
    from .constraints import Constraints

reverse_cuthill_mckee = lazy_import("scipy.sparse.csgraph", "reverse_cuthill_mckee")
WORST_CONDITIONING = 0.1  # fraction of the smallest pivot of the best selection: below, rows in use are replaced
GROWTH_TOLERANCE = 1e-2  # fraction of the largest pivot: a dependent row whose pivot exceeds it has become independent
SMALLEST_PIVOT = SUM_ROUNDING  # fraction of the largest, in the system of the rows in use: below, it is singular
AMBIGUOUS_AFTER_START = TRUNCATION  # replaces AMBIGUOUS_PIVOT where a run already follows one branch
MANY_ROWS = 32  # rows: above, sparse and band factorizations are used, and all rows are inspected only when triggered
RESELECTION_RATIO = 0.01  # fraction of the best pivot ratio since the last selection: below, rows are selected again
# fraction of the largest row: a dependent row with a larger component along a probe also triggers a selection
PROBE_TOLERANCE = 0.1 * GROWTH_TOLERANCE
CONVERGED = BELOW_ROUNDING**2  # square of the relative residual
EXTRA_CG_ITERATIONS = 20  # iterations of the core: rounding requires more than exact arithmetic
RANK_LOSS_FACTOR = 100.0  # times `PIVOT_RANK` and the pivot ratio at the start: smaller pivots indicate a rank loss


@cache
def random_probe(nv: int) -> np.ndarray:
    """Return a random vector with entries of unit variance, (nv,), the same in each call."""
    return np.random.default_rng(0).standard_normal(nv)


def elimination_order(constraints: "Constraints") -> np.ndarray:
    """Return the position of each row in the elimination order, (ng,): as given, or with a smaller bandwidth.

    Many rows are ordered by reverse Cuthill-McKee: the compiled core uses a band solver.

    Args:
        constraints: the rows.
    """
    given = np.arange(constraints.ng)
    if constraints.ng <= MANY_ROWS:
        return given
    used = constraints.columns.astype(int)
    pattern = used @ used.T.tocsr()
    i, j = pattern.nonzero()
    reordered = reverse_cuthill_mckee(pattern.tocsr(), symmetric_mode=True).argsort()
    return min(given, reordered, key=lambda position: np.abs(position[i] - position[j]).max())


def mass_scaled(U: np.ndarray, G: np.ndarray) -> np.ndarray:
    """Return M^{-1/2} G^T, (nv, m), for rows G (m, nv) and M = U^T U."""
    if not G.size:  # which LAPACK rejects
        return G.T
    return lapack().dgesv(U.T, G.T)[2]  # not dtrtrs: OpenBLAS threads it, which costs milliseconds on small systems


def pivots(B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the column order (m,) and |diag R| (min(nv, m),), decreasing, of the pivoted QR of B (nv, m)."""
    qr, order, *_ = lapack().dgeqp3(B)
    return order - 1, np.abs(qr.diagonal())


def rank(diagonal: np.ndarray) -> int:
    """Return the number of pivots above 1e-8 of the largest, which is the first."""
    return int(np.count_nonzero(diagonal > PIVOT_RANK * diagonal[:1]))


def rank_has_grown(diagonal: np.ndarray, r: int) -> bool:
    """Return whether rows beyond the rank r have become independent: their pivot exceeds a hundredth of the largest.

    Smaller pivots come from drift: rows that are dependent where 0 = g are only nearly dependent close to it.
    """
    return len(diagonal) > r and bool(diagonal[r] > GROWTH_TOLERANCE * diagonal[0])


def geometric_rank(G: np.ndarray) -> int:
    """Return the rank of G (ng, nv) for any masses; in G M^-1/2, heavy bodies can mask the rows of light bodies."""
    size = np.linalg.norm(G, axis=1)
    nonzero = size > PIVOT_RANK * size.max(initial=0.0)
    return rank(pivots((G[nonzero] / size[nonzero, None]).T)[1])


def initial_rank(B: np.ndarray, G: np.ndarray, diagonal: np.ndarray, t: float, ambiguous: float) -> tuple[int, float]:
    """Return the rank of the closed mechanism, and the pivot ratio below which the rank has fallen.

    Args:
        B: scaled transposed constraint Jacobian M^{-1/2} G^T, (nv, ng).
        G: the Jacobian, (ng, nv).
        diagonal: pivots of B.
        t: time.
        ambiguous: pivot ratio below which the branch is ambiguous, `AMBIGUOUS_PIVOT` or `AMBIGUOUS_AFTER_START`.

    Raises:
        StepError: near a singular configuration, where rounding would select the branch of the motion.
    """
    r = rank(diagonal)
    if r and (r < min(B.shape) or diagonal[r - 1] < ambiguous * diagonal[0]):
        r = max(r, geometric_rank(G))
        sizes = pivots(G.T)[1]
        if max(sizes[r - 1] / sizes[0], diagonal[r - 1] / diagonal[0]) < ambiguous:
            raise StepError("rank", f"the run would begin next to a singular configuration, at t = {t:.17g}")
    return r, float(min(1.0, RANK_LOSS_FACTOR * diagonal[r - 1] / diagonal[0]) * PIVOT_RANK) if r else 0.0


def require_rank(diagonal: np.ndarray, r: int, threshold: float, t: float) -> None:
    """Check that decreasing pivots have rank r.

    Raises:
        StepError: if the rank has changed, at time t.
    """
    current = int(np.count_nonzero(diagonal > threshold * diagonal[:1]))
    if current < r:
        raise StepError(
            "rank", f"the rank of the closures falls from {r} to {current} at t = {t:.17g}: a singular configuration"
        )
    if rank_has_grown(diagonal, r):
        raise StepError(
            "rank",
            f"the rank of the closures rises above {r} at t = {t:.17g}: "
            "the run began in a singular configuration, or redundant rows have drifted open",
        )


def select_rows(
    B: np.ndarray,
    rows: np.ndarray | None,
    r: int,
    position: np.ndarray,
    pivoting: tuple[np.ndarray, np.ndarray] | None = None,
) -> np.ndarray:
    """Return r independent columns of B = M^{-1/2} G^T, (nv, ng): the rows in use if they are well-conditioned.

    Rows in use are replaced when their smallest pivot falls below a tenth of that of the best selection.

    Args:
        B: scaled transposed constraint Jacobian.
        rows: the rows in use, (r,), or None at the start.
        r: number of rows.
        position: position of each row, see `elimination_order`.
        pivoting: `pivots` of B, if already computed.

    Returns:
        Indices in elimination order, (r,).
    """
    if rows is not None and len(rows) in (0, B.shape[1]):
        return rows
    order, best = pivoting or pivots(B)
    if rows is not None and pivots(B[:, rows])[1][r - 1] >= WORST_CONDITIONING * best[r - 1]:
        return rows
    if B.shape[1] > MANY_ROWS:
        order = windowed_pivots(B, position, AMBIGUOUS_PIVOT if rows is None else EPS**0.5)[0]
    return order[:r][position[order[:r]].argsort()]


def windowed_pivots(B: np.ndarray, position: np.ndarray, tie: float) -> tuple[np.ndarray, np.ndarray]:
    """Return columns of B and their pivots, decreasing, as `pivots` does, by Cholesky factorization of B^T B.

    Pivots are chosen within a window of the first remaining columns in elimination order, as wide as the coupling of
    rows: a choice among all columns would destroy the band structure. Of squared pivots that agree to a relative
    tolerance ``tie``, the first column is chosen: in a symmetric mechanism many are equal, and rounding, which differs
    in the compiled core, must not decide. Pivots up to ``tie`` times the largest are omitted.
    """
    S = B.T.dot(B)
    i, j = S.nonzero()
    window = max(MANY_ROWS, 2 * int(np.abs(position[i] - position[j]).max(initial=0)) + 2)
    diagonal, sequence = S.diagonal().copy(), position.argsort()
    found: list[tuple[float, int, int]] = []
    negligible = tie**2 * diagonal.max()
    while (candidates := sequence[diagonal[sequence] > negligible][:window]).size:
        p = int(candidates[diagonal[candidates] > diagonal[candidates].max() * (1 - tie)].min())
        found.append((-diagonal[p], len(found), p))
        S -= np.outer(S[p] / diagonal[p], S[p])
        diagonal = np.minimum(diagonal, S.diagonal())
        diagonal[p] = -1.0
    found.sort()
    return np.array([p for *_, p in found], int), np.sqrt([-pivot for pivot, *_ in found])


class SelectionTrigger:
    """Decision whether to inspect all rows at the start of a step: always if there are few, rarely if many.

    Triggers are a pivot ratio of the rows in use that is much worse than the best one since the last inspection, and a
    row not in use that is no longer dependent on those in use.
    """

    def __init__(self, ng: int) -> None:
        self.many, self.best_ratio, self.others_may_be_independent = ng > MANY_ROWS, 0.0, False
        self.pivot_ratio = np.nan  # smallest to largest, of the last solved system of rows in use

    def probe(self, U: np.ndarray, G: np.ndarray, rows: np.ndarray) -> None:
        """Check at the end of a step whether a random null vector of the rows in use is a null vector of all rows.

        Args:
            U: the Cholesky factor of M = U^T U, (nv, nv).
            G: all rows, (ng, nv).
            rows: the rows in use, (r,).
        """
        if self.many and 0 < len(rows) < len(G):
            B, w = mass_scaled(U, G), random_probe(len(U))
            used = B[:, rows]
            w = w - used @ lapack().dgesv(used.T @ used, used.T @ w)[2]
            rest = np.delete(B, rows, axis=1).T @ w
            self.others_may_be_independent |= bool((rest**2 > PROBE_TOLERANCE**2 * (used**2).sum(axis=0).max()).any())

    def is_due(self) -> bool:
        """Return whether to inspect all rows; resets the trigger if so."""
        ratio, self.pivot_ratio = self.pivot_ratio, np.nan
        self.best_ratio = max(self.best_ratio, ratio)
        if self.many and not self.others_may_be_independent and ratio >= RESELECTION_RATIO * self.best_ratio:
            return False
        self.best_ratio, self.others_may_be_independent = 0.0, False
        return True


def all_multipliers(U: np.ndarray, G: np.ndarray, rows: np.ndarray, lam: np.ndarray) -> np.ndarray:
    """Return the minimum-norm multipliers of all rows, (ng,), from those of the rows in use.

    The dependent rows, G_D = C G_R, C = G_D M^-1 G_R^T (G_R M^-1 G_R^T)^-1, yield the null vectors (-C^T n, n) of G^T;
    the norm is smallest if (1 + C C^T) n = C lam. Near singular configurations `minimum_norm` computes the multipliers.

    Args:
        U: the Cholesky factor of M = U^T U, (nv, nv).
        G: all rows, (ng, nv).
        rows: the rows in use, (r,).
        lam: their multipliers, (r,) or several, (k, r).
    """
    out = np.zeros((*lam.shape[:-1], len(G)))
    if not len(rows):
        return out
    B, others = mass_scaled(U, G), np.ones(len(G), bool)
    others[rows] = False
    used = B.take(rows, 1).T
    lu, _, C, info = lapack().dgesv(used.dot(used.T), used.dot(B[:, others]))  # its transpose, (r, ng - r)
    pivot = np.abs(lu.diagonal())
    if info or not pivot[pivot.argmin()] > SMALLEST_PIVOT * pivot[pivot.argmax()]:
        return minimum_norm(G, len(rows), lam.dot(G.take(rows, 0)))
    S = C.T.dot(C)
    S.ravel()[:: len(S) + 1] += 1
    n = lapack().dgesv(S, lam.dot(C).T)[2].T
    out[..., rows], out[..., others] = lam - n.dot(C.T), n
    return out


def minimum_norm(G: np.ndarray, rank: int, force: np.ndarray) -> np.ndarray:
    """Return the minimum-norm multipliers, (ng,), with G^T lam = force (nv,) for rows of G (ng, nv) of a given rank.

    Several forces, (k, nv), have multipliers (k, ng).

    The rank is not determined here: rows that are dependent where 0 = g are only nearly dependent close to it. In a
    singular configuration, combinations of rows that vanish up to rounding are omitted.
    """
    left, sizes, right, _ = lapack().dgesdd(G, full_matrices=0)
    rank = min(rank, int(np.count_nonzero(sizes > SUM_ROUNDING * sizes[:1])))
    return (force.dot(right[:rank].T) / sizes[:rank]).dot(left[:, :rank].T)
