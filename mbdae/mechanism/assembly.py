"""Consistent states: g(t, q) = 0 by damped Gauss-Newton on the manifold, then G v + g_t = 0 in the mass metric.

All thresholds are of rad and of characteristic lengths of the mechanism.
"""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dpotrf

from ..errors import AssemblyError, InputError, StepError
from ..system import Array
from .closures.closure_error import ClosureError, largest_error
from .closures.preconditions import refuse_unfit
from .flipped_frames import Residuals, closures, flipped_closures, with_directions
from .model_settings import normalized
from .pinocchio_data import make_data

if TYPE_CHECKING:
    from .formulations.index2 import Index2System
    from .mechanism import Mechanism

TOLERANCE = 1e-12
NEARLY = 1e-3  # a gap that numbers with few digits leave
ACCEPT = 1e-10
START = 1e-6  # what a start given by the user may leave open; more would show in the result
TRUNCATION = 1e-7
ITERATIONS = 100
WIDTHS = (0.1, 0.4, 1.5, 3.0)  # displacements of the guess when it leads nowhere, or far
STARTS = 6  # of each width
NEAR = 0.05  # what counts as near the guess in any case
SLIDES = 10
DAMPING = 0.1


def assemble(
    mech: "Mechanism", q: Any, v: Any, guess: Any, guess_v: Mapping[str, Any] | None = None, t: float = 0.0
) -> tuple[Array, Array]:
    """See `mbdae.Mechanism.assemble`; ``guess_v`` are joint velocities to start from that are not held."""
    held_q, held_v = (np.array([], int),) * 2
    for driver in mech.drivers:
        driver.check(t)
    if isinstance(q, np.ndarray | list | tuple):
        q0 = normalized(mech.model, mech.vector("q", q, mech.nq))
        if q0 is None:
            raise InputError("q is not on the manifold: a quaternion, or cosine and sine of an angle, vanish")
    else:
        table = {**mech.start_values.guess, **mech.start_values.q, **(guess or {}), **(q or {})}
        q0 = mech.coordinates(table)[0]
        held_q = mech.coordinates(q or {})[1]
    system = mech.system()
    q1 = close_position(system, q0, held_q, t)
    if isinstance(v, np.ndarray | list | tuple):
        v0 = mech.vector("v", v, mech.nv)
    else:
        v0 = mech.coordinates({**(guess_v or {}), **(v or {})}, of_v=True)[0]
        held_v = mech.coordinates(v or {}, of_v=True)[1]
    refuse_unfit(mech, q1)
    return q1, close_velocity(system, q1, v0, held_v, t)


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
    try:
        g, G = system.closures(q, t)
    except StepError as e:
        raise InputError(f"the guess cannot be assembled: {e}") from e
    if not (np.isfinite(g).all() and np.isfinite(G).all()):
        worst = mech.row_names[int(np.argmin(np.isfinite(g) & np.isfinite(G).all(axis=1)))]
        raise InputError(f"closure {worst!r} is not finite: numbers in the model are too large")
    g, G = closures(system, q, t)
    if not len(g):
        return q
    tries = [gauss_newton(system, q, free, t)]
    closed = [x for x in tries if is_closed(system, x, t)]
    if closed and _distance(mech, q, closed[0]) < NEAR:
        return closed[0]
    reach = 1.2 * float(np.linalg.norm(_newton(G, g, free))) + NEAR
    widths = iter(WIDTHS)
    while not any(_distance(mech, q, x) <= reach for x in closed):
        width = next(widths, None)
        if width is None or (width > WIDTHS[1] and closed):
            break
        more = [gauss_newton(system, start, free, t) for start in _displaced(mech, q, free, width)]
        tries, closed = tries + more, closed + [x for x in more if is_closed(system, x, t)]
    if not closed and any(_open(system, x, t) <= ACCEPT for x in tries):  # a frame is turned over: turn it back first
        starts = (q, *(x for width in WIDTHS[1:3] for x in _displaced(mech, q, free, width)))
        turned = (gauss_newton(system, gauss_newton(system, x, free, t, with_directions), free, t) for x in starts)
        closed = [x for x in turned if is_closed(system, x, t)][:1]
    if closed:
        return _slide(system, q, min(closed, key=lambda x: _distance(mech, q, x)), free, t)
    best = min(tries, key=lambda x: _open(system, x, t))
    if _open(system, best, t) <= ACCEPT:
        name = flipped_closures(system)
        raise InputError(f"closure {name!r} closes with its second frame turned over: change the guess")
    raise open_closure(mech, largest_error(mech, system.closures(best, t)[0]), held, "configuration")


def gauss_newton(system: "Index2System", q: Array, free: Array, t: float, rows: Residuals = closures) -> Array:
    """Damped steps with line search, at most one radian or characteristic length at a time: stay on the branch."""
    m, scales = system.manifold, system.mechanism.coordinate_scales
    g, G = rows(system, q, t)
    closed = False
    for _ in range(ITERATIONS):
        if closed or not np.isfinite(G).all():
            break
        closed = bool(np.linalg.norm(g) <= TOLERANCE)  # one more step leaves rounding
        x = _newton(G, g, free)
        x /= max(1.0, np.abs(x).max())
        for _halving in range(12):
            q_new = m.integrate(q, scales * x)
            g_new, G_new = rows(system, q_new, t)
            if np.linalg.norm(g_new) < np.linalg.norm(g):
                break
            x /= 2
        else:
            break
        q, g, G = q_new, g_new, G_new
    return q


def _slide(system: "Index2System", guess: Array, q: Array, free: Array, t: float) -> Array:
    """Move a closed configuration that lies far from the guess along what is left of freedom, towards the guess."""
    mech = system.mechanism
    for _ in range(SLIDES):
        d = (mech.manifold.difference(q, guess) / mech.coordinate_scales)[free]
        G = closures(system, q, t)[1][:, free]
        along = d - np.linalg.lstsq(G, G @ d, rcond=TRUNCATION)[0]
        if np.linalg.norm(d) < NEAR or np.linalg.norm(along) < 0.1 * np.linalg.norm(d):
            break
        x = np.zeros(mech.nv)
        x[free] = along / max(1.0, 2 * np.abs(along).max())
        new = gauss_newton(system, mech.manifold.integrate(q, mech.coordinate_scales * x), free, t)
        if not is_closed(system, new, t) or _distance(mech, guess, new) >= _distance(mech, guess, q):
            break
        q = new
    return q


def _newton(G: Array, g: Array, free: Array) -> Array:
    """The step x that minimises |G x + g|^2 + mu |x|^2 with mu = |g|/10: short where G is nearly singular."""
    n = len(free)
    damped = np.vstack([G[:, free], np.sqrt(DAMPING * np.linalg.norm(g)) * np.eye(n)])
    x = np.zeros(G.shape[1])
    x[free] = -np.linalg.lstsq(damped, np.concatenate([g, np.zeros(n)]), rcond=TRUNCATION)[0]
    return x


def _displaced(mech: "Mechanism", q: Array, free: Array, width: float) -> Iterator[Array]:
    """The same displacements every time: at most ``width`` radians or characteristic lengths."""
    rng = np.random.default_rng(0)
    for _ in range(STARTS):
        x = np.zeros(mech.nv)
        x[free] = width * rng.uniform(-1, 1, len(free))
        yield mech.manifold.integrate(q, mech.coordinate_scales * x)


def _distance(mech: "Mechanism", q0: Array, q1: Array) -> float:
    return float(np.linalg.norm(mech.manifold.difference(q0, q1) / mech.coordinate_scales))


def _open(system: "Index2System", q: Array, t: float) -> float:
    residual = float(np.linalg.norm(closures(system, q, t)[0]))
    return residual if np.isfinite(residual) else np.inf


def is_closed(system: "Index2System", q: Array, t: float) -> bool:
    """Whether all loops are closed, with no frame turned over."""
    return _open(system, q, t) <= ACCEPT and not flipped_closures(system)


def close_velocity(system: "Index2System", q: Array, v: Array, held: Array, t: float) -> Array:
    """Change v as little as possible in the mass metric so that G v + g_t = 0, held coordinates kept.

    Raises:
        AssemblyError: if the held velocities contradict the closures.
        InputError: if a body without inertia makes the mass metric singular.
    """
    mech, free = system.mechanism, np.delete(np.arange(system.nv), held)
    G, g_t = system.closures(q)[1], system.g_t(t)
    if not (G @ v + g_t).any():
        return v
    U, info = dpotrf(_mass(mech, q)[np.ix_(free, free)], lower=0)
    if info:
        joint = mech.coordinate_joint(int(free[abs(info) - 1]))
        raise InputError(f"the mass matrix is singular at joint {joint!r}: a body without inertia")
    rows = mech.row_scales
    speeds = np.linalg.norm(v / mech.coordinate_scales) + np.linalg.norm(g_t / rows)
    scaled = np.linalg.solve(U.T, (G[:, free] / rows[:, None]).T).T  # G M^{-1/2}
    for _ in range(2):  # the second pass removes rounding
        v = v.copy()
        v[free] -= np.linalg.solve(U, np.linalg.lstsq(scaled, (G @ v + g_t) / rows, rcond=TRUNCATION)[0])
    if not np.linalg.norm((G @ v + g_t) / rows) <= ACCEPT * speeds:
        raise open_closure(mech, largest_error(mech, G @ v + g_t, "/s"), held, "velocity")
    return v


def require_consistent(mech: "Mechanism", q: Array, v: Array, t: float, most: float = START) -> None:
    """Refuse a start at time t that leaves a closure or a driver open by more than ``most``, 1e-6 when left out.

    Of g this is in rad and characteristic lengths; of G v + g_t relative to 1/s and the largest velocity.

    Raises:
        InputError: names the closure that is open the most, and by how much; or one that assumes what is not so.
    """
    if not mech.ng:
        return
    g, Gv = mech.residual(q, v, t)
    speed = np.abs(v / mech.coordinate_scales).max()
    for residual, per, allowed in ((g, "", most), (Gv, "/s", most * (1 + speed))):
        gap = largest_error(mech, residual, per)
        if gap.relative > allowed:
            raise InputError(
                f"the start is not consistent: {gap.says()}; "
                f"make it so with q, v = mechanism.assemble(q, v{f', t={t:g}' if t else ''})"
            )
    refuse_unfit(mech, q)


def _mass(mech: "Mechanism", q: Array) -> Array:
    M = pin.crba(mech.model, make_data(mech.model), q, pin.Convention.WORLD)
    return np.triu(M) + np.triu(M, 1).T


def open_closure(mech: "Mechanism", gap: ClosureError, held: Array, what: str) -> AssemblyError:
    """The error that says which closure stays open the most, by how much, and what was held."""
    joints = ", ".join(dict.fromkeys(mech.coordinate_joint(int(i)) for i in held)) or "nothing"
    text = f"no consistent {what}: {gap.says('stays open')} (held: {joints})"
    if gap.relative < NEARLY:
        text += "; a gap as small as that: axes that are not quite parallel? give all digits, or keep fewer rows"
    return AssemblyError(text, gap.name, gap.size)
