"""Selection of the independent rows of a step."""

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dgesv

from ...errors import StepError
from ...system import Array, State
from ...tolerances import NEGLIGIBLE
from ..closures import independent_rows

if TYPE_CHECKING:
    from .index2 import Index2System



def select_independent_rows(system: "Index2System", t: float, U: Array, G: Array) -> Array:
    """Return independent rows (r,) for a step or a point; the rank is fixed when first determined.

    The rows in use are kept while they are well-conditioned, and while they are frozen.
    """
    if not system.ng:
        return np.empty(0, int)
    if system.rows is not None and (system.held or not system.reason.given()):
        return system.rows
    B = dgesv(U.T, G.T)[2]  # not dtrtrs: OpenBLAS threads it, which costs milliseconds on small systems
    found = _, diagonal = independent_rows.pivots(B)
    try:
        if system.rank is None:
            system.rank, system.floor = independent_rows.fixed_rank(B, G, diagonal, t, system.beside)
        independent_rows.confirm(diagonal, system.rank, system.floor, t)
    except StepError as e:
        rank = system.rank or independent_rows.rank(diagonal)
        raise StepError(e.status, f"{e} ({_weakest(system, B, rank)})") from None
    if system.rank:
        system.least_pivot_ratio = min(system.least_pivot_ratio, (diagonal[system.rank - 1] / diagonal[0]) ** 2)
    system.rows = independent_rows.choose(B, system.rows, system.rank, system.place, found)
    return system.rows


def rows_of_step(system: "Index2System", t: float, y: Array) -> Array:
    """Return the rows in use of a step from (t, y), (r,)."""
    if system.held and system.rows is not None:
        return system.rows
    return system.choose_rows(t, *system.point(t, system.split(y)[0])) if system.ng else np.empty(0, int)


def _weakest(system: "Index2System", B: Array, rank: int) -> str:
    """Name the closures whose rows form the weakest of so many independent combinations."""
    combination = np.linalg.svd(B, full_matrices=False)[2][max(rank, 1) - 1] ** 2
    names = [system.mechanism.row_names[int(i)] for i in np.flatnonzero(combination > NEGLIGIBLE * combination.max())]
    return ", ".join(dict.fromkeys(repr(name) for name in names))


def update_independent_rows(system: "Index2System", t: float, state: State) -> State:
    """Choose the rows of the next step, see `mbdae.system.System`, and project v onto new ones.

    Rows of loops with a violation |g| contradict each other by as much: a v that satisfies the old rows violates the
    new ones, which a step would take for a local error.
    """
    if not system.ng:
        return state
    q, v = system.split(state.y)
    U, G = system.point(t, q)
    before, system.held = system.rows, False
    rows = system.choose_rows(t, U, G)
    system.held = True
    rate = G @ v + system.g_t(t)
    if before is not None and not np.array_equal(rows, before):
        B = dgesv(U.T, G[rows].T)[2]
        v = v - dgesv(U, B @ dgesv(B.T @ B, rate[rows])[2])[2]
        state = State(np.concatenate([q, v, state.y[system.nq + system.nv :]]), state.carry, state.compensation)
        if state.carry is not None:
            state = state._replace(carry=system.carry(*system.derivative(t, state.y)))
            G = system.jacobian(q)
        rate = G @ v + system.g_t(t)
    mech = system.mechanism
    system.largest_g = max(system.largest_g, float(np.abs(system.constraints.value(t)[0] / mech.row_scales).max()))
    system.largest_rate = max(system.largest_rate, float(np.abs(rate / mech.row_scales).max()))
    system.largest_speed = max(system.largest_speed, float(np.abs(v / mech.coordinate_scales).max()))
    return state


def multiplier_gain(system: "Index2System", t: float, y: Array, z: Array) -> float:
    """Return the largest eigenvalue of (G M^-1 G^T)^+: the change of lam per unit residual of G v', in kg."""
    q, _ = system.split(y)
    U, G = system.inertia(t, q), system.jacobian()
    rows = system.choose_rows(t, U, G)
    if not len(rows):
        return 0.0
    B = dgesv(U.T, G[rows].T)[2]
    return float(np.linalg.svd(B, compute_uv=False)[-1] ** -2)


def pivot_ratio(system: "Index2System", t: float, y: Array) -> float:
    """Return the ratio of the smallest pivot of the independent rows of G M^-1/2 to the largest; 0 if singular."""
    diagonal = independent_rows.pivots(dgesv(system.inertia(t, system.split(y)[0]).T, system.jacobian().T)[2])[1]
    return float(diagonal[(system.rank or 1) - 1] / diagonal[0])
