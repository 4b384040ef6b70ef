"""Selection of the independent rows of a step."""

from math import inf
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ....errors import StepError
from ....linear_solve import lapack
from ....system import Array, State, System
from ....tolerances import CLOSED, EPS, NEGLIGIBLE, THREE_DIGITS
from ...closures import independent_rows

if TYPE_CHECKING:
    from ..index2 import Index2System

NEARBY = THREE_DIGITS  # rad or characteristic lengths: distance to the configuration for comparison
GROWTH = 100.0  # growth of rows over this distance that shows a singular configuration


class SmallestPivot(NamedTuple):
    """The smallest pivot of the independent rows of G M^-1/2; (inf, 1) without rows, 0 if they are dependent.

    Attributes:
        size: the pivot, in units of these rows.
        ratio: ratio to the largest pivot.
    """

    size: float = inf
    ratio: float = 1.0


def select_independent_rows(system: "Index2System", t: float, U: Array, G: Array) -> Array:
    """Return independent rows (r,) for a step or a point; the first call determines the rank of the run.

    The rows in use remain while they are well-conditioned, and while they are frozen.
    """
    if not system.ng:
        return np.empty(0, int)
    if system.rows is not None and (system.rows_frozen or not system.selection_trigger.is_due()):
        return system.rows
    B = independent_rows.mass_scaled(U, G)
    pivoting = _, diagonal = independent_rows.pivots(B)
    try:
        if system.rank is None:
            initial = independent_rows.initial_rank(B, G, diagonal, t, system.ambiguous_pivot)
            system.rank, system.rank_threshold = initial
        independent_rows.require_rank(diagonal, system.rank, system.rank_threshold, t)
    except StepError as e:
        rank = system.rank or independent_rows.rank(diagonal)
        raise StepError(e.status, f"{e} ({_weakest(system, B, rank)})") from None
    if system.rank:
        system.least_pivot_ratio = min(system.least_pivot_ratio, (diagonal[system.rank - 1] / diagonal[0]) ** 2)
    system.rows = independent_rows.select_rows(B, system.rows, system.rank, system.elimination_order, pivoting)
    return system.rows


def start(system: "Index2System", t: float, y: Array, project: bool) -> tuple[Array, Array, Array]:
    """Return y, y' and z at the start of a run, see `mbdae.system.System`.

    Pivot ratios do not detect configurations where all rows vanish. Rows that also vanish nearby are redundant in any
    configuration, such as the out-of-plane rows of a planar mechanism.

    Raises:
        StepError: close to a configuration where all rows vanish: every v satisfies them, without constraint forces.
    """
    q = system.split(y)[0]
    if system.ng and (size := largest_entry(system, t, q)) < system.ambiguous_pivot:
        displacement = NEARBY * system.mechanism.coordinate_scales * independent_rows.random_probe(system.nv)
        if max(GROWTH * size, CLOSED) < largest_entry(system, t, system.manifold.integrate(q, displacement)):
            active = np.delete(system.mechanism.row_names, system.constraints.inactive)
            names = " and ".join(repr(str(name)) for name in dict.fromkeys(active))
            text = f"the run would begin next to a singular configuration, at t = {t:.17g}, where G v = 0 for every v"
            raise StepError("rank", f"{text} (rows of {names}): begin at a distance from it")
    return System.start(system, t, y, project)


def largest_entry(system: "Index2System", t: float, q: Array) -> float:
    """Return the largest entry of G at q, in units of rows and coordinates."""
    mech, G = system.mechanism, system.closures_dense_or_sparse(q, t)[1]
    return float(abs(G * mech.coordinate_scales / mech.row_scales[:, None]).max())


def rows_of_step(system: "Index2System", t: float, y: Array) -> Array:
    """Return the rows in use of a step from (t, y), (r,)."""
    if system.rows_frozen and system.rows is not None:
        return system.rows
    return system.select_independent_rows(t, *system.point(t, system.split(y)[0])) if system.ng else np.empty(0, int)


def _weakest(system: "Index2System", B: Array, rank: int) -> str:
    """Return the names of the closures whose rows form the combination with the smallest singular value."""
    if not np.isfinite(B).all():
        return "the state is not finite"
    combination = np.linalg.svd(B, full_matrices=False)[2][max(rank, 1) - 1] ** 2
    names = [system.mechanism.row_names[int(i)] for i in np.flatnonzero(combination > NEGLIGIBLE * combination.max())]
    return ", ".join(dict.fromkeys(repr(name) for name in names))


def update_independent_rows(system: "Index2System", t: float, state: State) -> State:
    """Select the rows of the next step, see `mbdae.system.System`, and project v onto new rows.

    If loops are violated by |g|, redundant rows contradict each other by the same amount: a v that satisfies the old
    rows violates new ones, and a step would interpret this as a local error.
    """
    if not system.ng:
        return state
    q, v = system.split(state.y)
    U, G = system.point(t, q)
    before, system.rows_frozen = system.rows, False
    rows = system.select_independent_rows(t, U, G)
    system.rows_frozen = True
    rate = G @ v + system.g_t(t)
    if before is not None and not np.array_equal(rows, before):
        B = independent_rows.mass_scaled(U, G[rows])
        v = v - lapack().dgesv(U, B @ lapack().dgesv(B.T @ B, rate[rows])[2])[2]
        state = State(np.concatenate([q, v, state.y[system.nq + system.nv :]]), state.carry, state.compensation)
        if state.carry is not None:
            state = state._replace(carry=system.carry(*system.derivative(t, state.y)))
            G = system.jacobian(q)
        rate = G @ v + system.g_t(t)
    mech = system.mechanism
    system.largest_g = max(system.largest_g, float(np.abs(system.constraints.residual(t) / mech.row_scales).max()))
    system.largest_rate = max(system.largest_rate, float(np.abs(rate / mech.row_scales).max()))
    system.largest_speed = max(system.largest_speed, float(np.abs(v / mech.coordinate_scales).max()))
    return state


def multiplier_gain(system: "Index2System", t: float, y: Array, z: Array) -> float:
    """Return the largest eigenvalue of (G M^-1 G^T)^+: the change of lam per unit residual of G v', in kg."""
    q, _ = system.split(y)
    U, G = system.inertia(t, q), system.jacobian()
    rows = system.select_independent_rows(t, U, G)
    if not len(rows):
        return 0.0
    B = independent_rows.mass_scaled(U, G[rows])
    return float(np.linalg.svd(B, compute_uv=False)[-1] ** -2)


def smallest_pivot(system: "Index2System", t: float, y: Array) -> SmallestPivot:
    """Return the smallest pivot of the independent rows of G M^-1/2."""
    U, G, r = system.inertia(t, system.split(y)[0]), system.jacobian(), system.rank or 1
    B = independent_rows.mass_scaled(U, G)
    if system.ng > independent_rows.MANY_ROWS:
        diagonal = independent_rows.windowed_pivots(B, system.elimination_order, EPS**0.5)[1]
    else:
        diagonal = independent_rows.pivots(B)[1]
    if r > len(diagonal):
        return SmallestPivot(0.0, 0.0)
    return SmallestPivot(float(diagonal[r - 1]), float(diagonal[r - 1] / diagonal[0]))


def pivot_ratio(system: "Index2System", t: float, y: Array) -> float:
    """Return the ratio of the smallest pivot of the independent rows of G M^-1/2 to the largest; 0 if singular."""
    return system.smallest_pivot(t, y).ratio


def remaining_rows_dependent(system: "Index2System", t: float, y: Array) -> bool:
    """Return whether rows not in use certainly depend on the rows in use at y; False where QR must decide."""
    return False
