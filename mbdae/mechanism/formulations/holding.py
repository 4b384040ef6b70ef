"""Which rows hold: Gauss's principle of least constraint over a box, and how near to their limits those are that do.

Candidates for holding are joints at rest, whose friction or whose teeth may keep them there, and bodies that touch. Row
i has a multiplier between two limits, lower_i <= lam_i <= upper_i (friction -F, F; what only presses 0, inf), and
accelerates by a = a_free + W lam, W = B^T B, where B (nv, m) has the columns M^-1/2 S_i^T, projected on the tangent of
the rows that hold in any case.

Source: C. F. Gauss, J. reine angew. Math. 4 (1829); C. Lanczos, The Variational Principles of Mechanics, IV.8; P.
Loetstedt, SIAM J. Appl. Math. 42 (1982).
"""

import numpy as np
from scipy.optimize import linprog, lsq_linear

from ...errors import StepError
from ...system import Array

EXACT = 1e-14  # of optimality, in units of the free acceleration
DEPENDENT = 1e-8  # of the largest singular value of B: below, rows depend on each other
NOTHING = 1e-300  # keeps what is zero from being divided by


def least_constraint(B: Array, a_free: Array, lower: Array, upper: Array) -> Array:
    """Return lam (m,) that minimises lam W lam/2 + lam a_free over the box.

    At the lower limit a >= 0, at the upper one a <= 0, in between a = 0. So what accelerates slips, or separates, with
    the sign of a; W lam is unique, lam need not be.

    Args:
        B: see above, (nv, m).
        a_free: accelerations of the rows with lam = 0, (m,).
        lower: limits in N or N m, (m,), -inf where there is none.
        upper: limits, (m,).
    """
    size = np.linalg.norm(B, axis=0) + NOTHING  # rows in m and in rad stand beside each other
    columns = B / size
    r = np.linalg.lstsq(columns.T, a_free / size, rcond=DEPENDENT)[0]
    scale = np.abs(r).max(initial=0.0) + NOTHING
    limits = lower * size / scale, upper * size / scale
    fixed = limits[0] >= limits[1]  # a limit of zero from both sides holds nothing
    out = np.where(fixed, lower, 0.0)
    if not fixed.all():
        free = ~fixed
        inside = tuple(x[free] for x in limits)
        rest = -(r / scale + columns[:, fixed] @ limits[0][fixed])
        found = lsq_linear(columns[:, free], rest, inside, method="bvls", tol=EXACT, max_iter=10 * len(size))
        out[free] = np.clip(found.x * scale / size[free], lower[free], upper[free])
    return out


def load(B: Array, a_free: Array, lower: Array, upper: Array) -> tuple[float, Array]:
    """Return the smallest kappa for which multipliers in kappa times the box hold all rows, and these multipliers (m,).

    Rows that hold let go where kappa passes 1. Where rows depend on each other (crank and slider of one loop) lam is
    not unique, and that of least norm says nothing: the smallest kappa is a linear programme, min kappa subject to
    W lam = -a_free, kappa lower <= lam <= kappa upper.

    Args:
        B: see above, (nv, m).
        a_free: accelerations of the rows with lam = 0, (m,).
        lower: limits, (m,), at most 0.
        upper: limits, (m,), at least 0.

    Returns:
        kappa, inf where no multipliers of the right signs do, and lam.
    """
    m = len(a_free)
    size = np.linalg.norm(B, axis=0) + NOTHING
    _, sizes, right = np.linalg.svd(B / size, full_matrices=False)
    rank = int(np.count_nonzero(sizes > DEPENDENT * sizes[:1]))
    inverse = (right[:rank].T / sizes[:rank] ** 2) @ right[:rank]
    lam = -(inverse @ (a_free / size)) / size
    if rank == m:
        return _share(lam, lower, upper), lam
    force = (np.abs(lam) * size).max(initial=0.0)
    if force == 0.0:
        return 0.0, lam
    rows = right[:rank] * size  # of B lam = given, without what depends on others
    given = rows @ lam / force
    unit = np.eye(m)
    inside = np.vstack([np.column_stack([-unit, lower]), np.column_stack([unit, -upper])])
    inside = inside[np.isfinite(inside).all(axis=1)]
    equal = np.column_stack([rows, np.zeros(rank)])
    bounds = [(None, None)] * m + [(0.0, None)]
    cost = np.append(np.zeros(m), 1.0)
    found = linprog(cost, inside, np.zeros(len(inside)), equal, given, bounds, method="highs")
    if found.status != 0:
        return np.inf, lam
    return float(found.x[-1] * force), found.x[:-1] * force


def _share(lam: Array, lower: Array, upper: Array) -> float:
    """Return the smallest kappa with kappa lower <= lam <= kappa upper."""
    limit = np.where(lam > 0, upper, np.abs(lower))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(lam == 0, 0.0, np.abs(lam) / limit)
    return float(share.max(initial=0.0))


def refuse_wedged(gain: Array, names: list[str], t: float) -> None:
    """See that sliding friction leaves the normal forces well-defined: G_n M^-1 (G_n^T - mu G_t^T d) > 0.

    Otherwise a growing normal force brings the bodies nearer: there is no motion, or more than one (P. Painleve, C. R.
    Acad. Sci. Paris 121 (1895); F. Genot, B. Brogliato, Eur. J. Mech. A/Solids 18 (1999)).

    Args:
        gain: that matrix over the rows that slide and press, (m, m).
        names: of these rows.
        t: time.

    Raises:
        StepError: names the row that wedges.
    """
    for i, name in enumerate(names):
        if not np.linalg.det(gain[: i + 1, : i + 1]) > 0 or not gain[i, i] > 0:
            wedged = f"friction wedges {name!r} at t = {t:.17g}: with so much of it there is no motion, or several"
            raise StepError("friction", wedged)
