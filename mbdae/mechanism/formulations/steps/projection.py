"""Projection of a state onto the closures, optional at the ends of steps."""

from typing import TYPE_CHECKING

import numpy as np

from ....errors import StepError
from ....linear_solve import lapack, least_squares
from ....system import Array
from ....tolerances import CLOSED, NEGLIGIBLE, SUM_ROUNDING, TRUNCATION, VISIBLE
from ...closures.closure_error import largest_error
from ...closures.independent_rows import mass_scaled

if TYPE_CHECKING:
    from ...mechanism import Mechanism
    from ..index2 import Index2System

ITERATIONS = 10
MAX_REMAINING = 0.5  # largest fraction of |g| after a correction; otherwise the correction is rejected
CONTRADICTION = 0.1  # fraction of |g| after first-order corrections, above which rows contradict each other
VIOLATED, STALLED = CLOSED, CLOSED  # projection fails if both the residual and the last correction are larger


def project_state(system: "Index2System", t: float, y: Array, tight: bool = False) -> Array:
    """Return the nearest point with g(t, q) = 0 and G(q) v + g_t = 0, first in q and then in v, over all rows.

    Velocity rows do not affect q. Gauss-Newton steps of smallest norm in the mass metric, x = -M^-1/2 (G M^-1/2)^+ g
    with a truncated pseudoinverse and constant M, are followed by v - M^-1/2 (G M^-1/2)^+ (G v + g_t). A step that does
    not halve |g| is rejected: near singular configurations rounding in g causes large corrections. Lengths are compared
    in characteristic lengths of the mechanism.

    The core uses x = -M^-1 G_R^T (G_R M^-1 G_R^T)^-1 g_R of the rows in use R, in linear time, as long as this halves
    |g| over all rows: if the other rows depend on R, x is the same.

    Args:
        system: a workspace.
        t: time.
        y: the point.
        tight: iterate below `SUM_ROUNDING` until |g| no longer decreases: near singular configurations v changes by
            |g| / sigma^2.

    Raises:
        StepError: if the closures cannot be satisfied, or require velocities that contradict each other.

    Source: Hairer, Wanner II, (VII.2.14), (VII.2.15).
    """
    if not system.ng:
        return y
    q, v = system.split(y)
    U = system.inertia(t, q)
    (*_, q), g, G, size = project_positions(system, t, q, U, tight)
    system.counts.state_projections += 1
    mech = system.mechanism
    satisfied = np.linalg.norm(g / mech.row_scales) <= VIOLATED
    if not satisfied and not size <= STALLED * (1 + np.abs(q / mech.q_scales).max()):
        violation = largest_error(mech, g)
        text = f"{violation.message()} at t = {t:.17g} and cannot be satisfied"
        if names := contradicting_positions(system, t, q):
            text += f": {names} contradict each other"
        raise StepError("newton", text)
    rate = G @ v + system.g_t(t)
    if tight or exceeds_rounding(system, rate, v):
        v = project_velocity(system, t, U, G, v)
        require_compatible_velocities(system, t, G, v)
    return np.concatenate([q, v, y[system.nq + system.nv :]])


def project_positions(
    system: "Index2System", t: float, q: Array, U: Array, tight: bool = False
) -> tuple[list[Array], Array, Array, float]:
    """Take Gauss-Newton steps from q, where kinematics must be current.

    Returns:
        Configurations from q to the last one, with its g and G; largest component of the last attempted step, in rad
            or characteristic lengths.
    """
    g, G = system.closures(None, t)
    path, size, positional, mech = [q], 0.0, system.constraints.positional, system.mechanism
    scales = mech.row_scales
    residual_norm = np.linalg.norm(g / scales)
    for _ in range(ITERATIONS):
        if not tight and not residual_norm > SUM_ROUNDING * (1 + np.abs(path[-1] / mech.q_scales).max()):
            break
        x = _minimum_norm_solution(U, G[positional], g[positional], scales[positional])
        size = float(np.abs(x / mech.coordinate_scales).max())
        new_q = system.manifold.integrate(path[-1], -x)
        new = system.closures(new_q, t)
        new_norm = np.linalg.norm(new[0] / scales)
        if not new_norm < MAX_REMAINING * residual_norm:
            break
        path.append(new_q)
        (g, G), residual_norm = new, new_norm
    return path, g, G, size


def project_velocity(system: "Index2System", t: float, U: Array, G: Array, v: Array) -> Array:
    """Return v - M^-1/2 (G M^-1/2)^+ (G v + g_t), (nv,), over all rows."""
    return v - _minimum_norm_solution(U, G, G @ v + system.g_t(t), system.mechanism.row_scales)


def contradicting_positions(system: "Index2System", t: float, q: Array) -> str:
    """Return the names of the rows of a driven mechanism that no q nearby satisfies together; empty if there are none.

    At the end of Gauss-Newton steps, g has a component outside the range of G.
    """
    if not system.driven:
        return ""
    U, scales = system.inertia(t, q), system.mechanism.row_scales
    _, g, G, _ = project_positions(system, t, q, U)
    residual = (g - G @ _minimum_norm_solution(U, G, g, scales)) / scales
    if not np.linalg.norm(residual) > max(VIOLATED, CONTRADICTION * float(np.linalg.norm(g / scales))):
        return ""
    return _names(system.mechanism, residual, system.g_t(t))


def contradicting_rows(system: "Index2System", t: float, y: Array) -> str:
    """Return the names of the rows that no q or v close to a point satisfy together; empty if there are none."""
    if not system.driven:
        return ""
    q, v = system.split(y)
    U = system.inertia(t, q)
    if names := contradicting_positions(system, t, q):
        return names
    (*_, q), _, G, _ = project_positions(system, t, q, U)
    return _violated(system, t, G, project_velocity(system, t, U, G, v), system.g_t(t))[0]


def require_compatible_velocities(system: "Index2System", t: float, G: Array, v: Array) -> None:
    """Check that v, (nv,), satisfies all rows of G v + g_t = 0, including redundant rows.

    Without g_t, v = 0 satisfies all rows; drivers may require velocities that closures and other drivers exclude.

    Raises:
        StepError: names the rows, drivers first.
    """
    g_t = system.g_t(t)
    if g_t.any():
        _require_satisfied(system, t, G, v, g_t, "velocities")


def require_compatible_accelerations(system: "Index2System", t: float, y: Array) -> None:
    """Check that some v' satisfies all rows of G v' + gamma = 0 at y, including redundant rows.

    Drivers that diverge smoothly contradict each other first in their accelerations.

    Raises:
        StepError: see `require_compatible_velocities`.
    """
    if system.driven:
        q, v = system.split(y)
        U, G = system.inertia(t, q), system.jacobian()
        gamma = system.gamma(q, v, t)
        vdot = -_minimum_norm_solution(U, G, gamma, system.mechanism.row_scales)
        _require_satisfied(system, t, G, vdot, gamma, "accelerations")


def _require_satisfied(system: "Index2System", t: float, G: Array, x: Array, r: Array, what: str) -> None:
    """Raise if G x + r, (ng,), is more than `VISIBLE` of its largest terms."""
    names, size = _violated(system, t, G, x, r)
    if names:
        text = f"no {what} satisfy all of them; the residual is {size:.1g} of the largest term"
        closed = [repr(s.name) for s in system.mechanism.switches if repr(s.name) in names]
        if len(closed) > 1:  # multipliers of dependent contacts are not unique, so none of the contacts separates
            text += f"; {' and '.join(closed)} are closed without clearance between them: give one of them a gap"
        raise StepError("driver", f"{names} contradict each other at t = {t:.17g}: {text}")


def _violated(system: "Index2System", t: float, G: Array, x: Array, r: Array) -> tuple[str, float]:
    """Return the names of the rows where G x + r is not 0 within `VISIBLE`, and its size relative to its terms."""
    scales = system.mechanism.row_scales
    residual, terms = np.abs(G @ x + r) / scales, (np.abs(G) @ np.abs(x) + np.abs(r)) / scales
    if residual.max() <= VISIBLE * terms.max():
        return "", 0.0
    return _names(system.mechanism, residual, system.g_t(t)), residual.max() / terms.max()


def _names(mech: "Mechanism", residual: Array, first: Array) -> str:
    """Return the names of the rows with a scaled residual, (ng,); rows where ``first`` is not 0 come first."""
    rows = np.flatnonzero(np.abs(residual) > NEGLIGIBLE * np.abs(residual).max())
    rows = rows[np.argsort(first[rows] == 0, kind="stable")]
    return " and ".join(dict.fromkeys(repr(mech.row_names[int(i)]) for i in rows))


def characteristic_magnitudes(system: "Index2System", y: Array) -> Array:
    """See `mbdae.system.System`, (ny,): adds 1 rad or characteristic length, and the largest speed in these units."""
    out, scales, nv = system.component_magnitudes(y), system.mechanism.coordinate_scales, system.nv
    out[:nv] += scales
    out[nv : 2 * nv] += scales * _speed(system, system.split(y)[1])
    return out


def _speed(system: "Index2System", v: Array) -> float:
    """Return the largest of v (nv,) in rad/s or characteristic lengths per s."""
    return float(np.abs(v / system.mechanism.coordinate_scales).max(initial=0.0))


def exceeds_rounding(system: "Index2System", rate: Array, v: Array) -> bool:
    """Return whether G v + g_t, (ng,), exceeds rounding; always true if joints stick."""
    size = np.linalg.norm(rate / system.mechanism.row_scales)
    return system.has_sticking_joints or bool(size > SUM_ROUNDING * _speed(system, v))


def _minimum_norm_solution(U: Array, G: Array, r: Array, scales: Array) -> Array:
    """Return the x (nv,) of smallest |U x| with G x = r (ng,), by truncated least squares with row scales."""
    B = mass_scaled(U, G / scales[:, None])
    return lapack().dgesv(U, least_squares(B.T, r / scales, TRUNCATION))[2]
