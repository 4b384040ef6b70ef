"""Dependent constraint rows: rank, and selection of well-conditioned independent rows."""

from functools import cache

import numpy as np
from scipy.linalg.lapack import dgeqp3, dgesdd, dgesv

from ...discovery import lazy_import
from ...errors import StepError
from ...tolerances import BELOW_ROUNDING, PIVOT_RANK, SUM_ROUNDING, TRUNCATION

csr_array = lazy_import("scipy.sparse", "csr_array")
reverse_cuthill_mckee = lazy_import("scipy.sparse.csgraph", "reverse_cuthill_mckee")
WORST_CONDITIONING = 0.1
GROWTH_TOLERANCE = 1e-2
SMALLEST_PIVOT = SUM_ROUNDING  # of the largest, in the system of the rows in use: below, it is singular
UNDERWAY = TRUNCATION  # like AMBIGUOUS_PIVOT, for a run that follows its branch with loops closed to its square
MANY_ROWS = 32  # rows: above, sparse and band factors serve, and all are inspected only when triggered
RESELECTION_RATIO = 0.01  # of the best ratio of pivots since the last selection: smaller triggers one
# of the largest row: a dependent row with this much of a probe triggers a selection, too
PROBE_TOLERANCE = 0.1 * GROWTH_TOLERANCE
CONVERGED = BELOW_ROUNDING**2  # of a squared residual
EXTRA_CG_ITERATIONS = 20  # the core also needs more than exact arithmetic
FALLEN = 100.0  # of the ratio of pivots at the start: still small below this multiple


@cache
def random_probe(nv: int) -> np.ndarray:
    """Return a vector in general position, (nv,), of unit variance."""
    return np.random.default_rng(0).standard_normal(nv)


def elimination_order(columns: np.ndarray) -> np.ndarray:
    """Return the position of each row in the elimination order, (ng,): as given, or in a narrower band.

    Many rows are ordered by reverse Cuthill-McKee: the compiled core uses a band solver.

    Args:
        columns: whether a row depends on a velocity, (ng, nv).
    """
    given = np.arange(len(columns))
    if len(columns) <= MANY_ROWS:
        return given
    linked = csr_array(columns.astype(int)) @ csr_array(columns.T.astype(int))
    i, j = linked.nonzero()
    other = reverse_cuthill_mckee(linked.tocsr(), symmetric_mode=True).argsort()
    return min(given, other, key=lambda place: np.abs(place[i] - place[j]).max())


def pivots(B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pivoted QR of B (nv, m): column order (m,) and |diag R| (min(nv, m),), decreasing."""
    qr, order, *_ = dgeqp3(B)
    return order - 1, np.abs(qr.diagonal())


def rank(diagonal: np.ndarray) -> int:
    """Return the number of pivots above 1e-8 of the largest, which is the first."""
    return int(np.count_nonzero(diagonal > PIVOT_RANK * diagonal[:1]))


def rank_has_grown(diagonal: np.ndarray, r: int) -> bool:
    """Return whether rows beyond the rank r became independent: their pivot exceeds a hundredth of the largest.

    Smaller ones come from drift: rows that are dependent on 0 = g are only nearly so next to it.
    """
    return len(diagonal) > r and bool(diagonal[r] > GROWTH_TOLERANCE * diagonal[0])


def geometric_rank(G: np.ndarray) -> int:
    """Rank of the rows of G (ng, nv) for bodies of any mass: in G M^-1/2 light bodies next to heavy ones hide rows."""
    size = np.linalg.norm(G, axis=1)
    kept = size > PIVOT_RANK * size.max(initial=0.0)
    return rank(pivots((G[kept] / size[kept, None]).T)[1])


def fixed_rank(B: np.ndarray, G: np.ndarray, diagonal: np.ndarray, t: float, beside: float) -> tuple[int, float]:
    """Return the rank where loops are closed, and the ratio of pivots below which it will have fallen.

    Args:
        B: scaled transposed constraint Jacobian M^{-1/2} G^T, (nv, ng).
        G: the Jacobian, (ng, nv).
        diagonal: pivots of B.
        t: time.
        beside: pivot ratio below which the configuration is ambiguous, `AMBIGUOUS_PIVOT` or `UNDERWAY`.

    Raises:
        StepError: next to a singular configuration, where rounding would select the branch of the motion.
    """
    r = rank(diagonal)
    if r and (r < min(B.shape) or diagonal[r - 1] < beside * diagonal[0]):
        r = max(r, geometric_rank(G))
        sizes = pivots(G.T)[1]
        if max(sizes[r - 1] / sizes[0], diagonal[r - 1] / diagonal[0]) < beside:
            raise StepError("rank", f"the run would begin next to a singular configuration, at t = {t:.17g}")
    return r, float(min(1.0, FALLEN * diagonal[r - 1] / diagonal[0]) * PIVOT_RANK) if r else 0.0


def confirm(diagonal: np.ndarray, r: int, floor: float, t: float) -> None:
    """Check that decreasing pivots still show the rank r.

    Raises:
        StepError: if the rank has changed, at time t.
    """
    now = int(np.count_nonzero(diagonal > floor * diagonal[:1]))
    if now < r:
        raise StepError(
            "rank", f"the rank of the closures falls from {r} to {now} at t = {t:.17g}: a singular configuration"
        )
    if rank_has_grown(diagonal, r):
        raise StepError(
            "rank",
            f"the rank of the closures rises above {r} at t = {t:.17g}: "
            "the run began in a singular configuration, or rows that depended on others have drifted open",
        )


def choose(
    B: np.ndarray,
    rows: np.ndarray | None,
    r: int,
    place: np.ndarray,
    found: tuple[np.ndarray, np.ndarray] | None = None,
) -> np.ndarray:
    """Choose r independent columns of B = M^{-1/2} G^T, (nv, ng): the rows in use while well-conditioned.

    They are replaced when their smallest pivot falls below a tenth of that of the best choice.

    Args:
        B: scaled transposed constraint Jacobian.
        rows: the rows in use, (r,), or None at the start.
        r: number of rows.
        place: see `elimination_order`.
        found: `pivots` of B, if already computed.

    Returns:
        Indices in the order of elimination, (r,).
    """
    if rows is not None and len(rows) in (0, B.shape[1]):
        return rows
    order, best = found or pivots(B)
    if rows is not None and pivots(B[:, rows])[1][r - 1] >= WORST_CONDITIONING * best[r - 1]:
        return rows
    return order[:r][place[order[:r]].argsort()]


class SelectionTrigger:
    """Decides whether to inspect all rows at the start of a step: always for few rows, rarely for many.

    The trigger is a pivot ratio of the rows in use that is much worse than since the last inspection, or a row not in
    use that is no longer dependent on them.
    """

    def __init__(self, ng: int) -> None:
        self.many, self.best, self.estranged = ng > MANY_ROWS, 0.0, False
        self.now = np.nan  # pivot ratio, smallest to largest, of the last solved system of rows in use

    def probe(self, U: np.ndarray, G: np.ndarray, rows: np.ndarray) -> None:
        """Check at the end of a step whether a null vector of the rows in use is one of all rows.

        Args:
            U: the Cholesky factor of M = U^T U, (nv, nv).
            G: all rows, (ng, nv).
            rows: those in use, (r,).
        """
        if self.many and 0 < len(rows) < len(G):
            B, w = dgesv(U.T, G.T)[2], random_probe(len(U))
            used = B[:, rows]
            w = w - used @ dgesv(used.T @ used, used.T @ w)[2]
            rest = np.delete(B, rows, axis=1).T @ w
            self.estranged |= bool((rest**2 > PROBE_TOLERANCE**2 * (used**2).sum(axis=0).max()).any())

    def given(self) -> bool:
        """Return whether to inspect the rows."""
        now, self.now = self.now, np.nan
        self.best = max(self.best, now)
        if self.many and not self.estranged and now >= RESELECTION_RATIO * self.best:
            return False
        self.best, self.estranged = 0.0, False
        return True


def all_multipliers(U: np.ndarray, G: np.ndarray, rows: np.ndarray, lam: np.ndarray) -> np.ndarray:
    """Return the multipliers of all rows, (ng,), of smallest norm, from those of the rows in use.

    The others, G_D = C G_R, C = G_D M^-1 G_R^T (G_R M^-1 G_R^T)^-1, give the null vectors (-C^T n, n) of G^T; the norm
    is smallest where (1 + C C^T) n = C lam. Next to singular configurations `minimum_norm` computes it.

    Args:
        U: the Cholesky factor of M = U^T U, (nv, nv).
        G: all rows, (ng, nv).
        rows: those in use, (r,).
        lam: their multipliers, (r,).
    """
    out = np.zeros(len(G))
    if not len(rows):
        return out
    B, others = dgesv(U.T, G.T)[2], np.ones(len(G), bool)
    others[rows] = False
    used = B.take(rows, 1).T
    lu, _, C, info = dgesv(used.dot(used.T), used.dot(B[:, others]))  # its transpose, (r, ng - r)
    pivot = np.abs(lu.diagonal())
    if info or not pivot[pivot.argmin()] > SMALLEST_PIVOT * pivot[pivot.argmax()]:
        return minimum_norm(G, len(rows), lam.dot(G.take(rows, 0)))
    S = C.T.dot(C)
    S.ravel()[:: len(S) + 1] += 1
    n = dgesv(S, lam.dot(C))[2]
    out[rows], out[others] = lam - C.dot(n), n
    return out


def minimum_norm(G: np.ndarray, rank: int, force: np.ndarray) -> np.ndarray:
    """Return multipliers of smallest norm, (ng,), with G^T lam = force (nv,) for rows of G (ng, nv) of a given rank.

    The rank is not determined here: rows that are dependent on 0 = g are only nearly so next to it. In a singular
    configuration, directions that vanish to rounding carry no force and are omitted.
    """
    left, sizes, right, _ = dgesdd(G, full_matrices=0)
    rank = min(rank, int(np.count_nonzero(sizes > SUM_ROUNDING * sizes[:1])))
    return left[:, :rank].dot(right[:rank].dot(force) / sizes[:rank])
