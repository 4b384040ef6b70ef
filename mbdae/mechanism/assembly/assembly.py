"""Consistent states: g(t, q) = 0 near an initial estimate, then G v + g_t = 0 in the mass metric.

All thresholds are in rad and in characteristic lengths of the mechanism.
"""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.linalg.lapack import dpotrf

from ...errors import AssemblyError, InputError
from ...system import Array
from ...tolerances import AGREEMENT, INPUT_DIGITS, TRUNCATION
from ..closures.closure_error import largest_error
from ..closures.independent_rows import MANY_ROWS
from ..closures.preconditions import require_preconditions
from ..model_settings import normalized
from ..tree.frames import find_joint
from ..tree.tree_terms import missing_inertia, mode_joints, sparse_inertia, update_inertia
from .flipped_frames import divide_rows
from .position_search import assembly_error, close_position, sparse_least_squares

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism


class Assembled(NamedTuple):
    """A consistent state q (nq,), v (nv,), and the tangent indices of its coordinates that were fixed, (n,) each."""

    q: Array
    v: Array
    fixed_q: Array
    fixed_v: Array


def assemble(
    mech: "Mechanism", q: Any, v: Any, guess: Any, guess_v: Mapping[str, Any] | None = None, t: float = 0.0
) -> Assembled:
    """See `mbdae.Mechanism.assemble`; ``guess_v`` are initial estimates of velocities that are not fixed."""
    fixed_q, fixed_v = (np.array([], int),) * 2
    held_q, held_v = fixed_q, fixed_v
    for driver in mech.drivers:
        driver.check(t)
    if isinstance(q, np.ndarray | list | tuple):
        q0 = normalized(mech.model, mech.vector("q", q, mech.nq))
        if q0 is None:
            raise InputError("q is not on the manifold: a quaternion, or cosine and sine of an angle, vanish")
    else:
        table = {**mech.start_values.guess, **mech.start_values.q, **(guess or {}), **(q or {})}
        q0 = mech.coordinates(table)[0]
        fixed_q = mech.coordinates(q or {})[1]
        held_q = _held_modes(mech, {**mech.start_values.guess, **(guess or {}), **(q or {})})
    if isinstance(v, np.ndarray | list | tuple):
        v0 = mech.vector("v", v, mech.nv)
    else:
        v0 = mech.coordinates({**(guess_v or {}), **(v or {})}, of_v=True)[0]
        fixed_v = mech.coordinates(v or {}, of_v=True)[1]
        held_v = _held_modes(mech, {**(guess_v or {}), **(v or {})})
    with mech.workspaces.borrowed() as system:
        q1, fixed_q = _closed_position(system, q0, fixed_q, held_q, t)
        v1, fixed_v = _with_modes_held(lambda fixed: close_velocity(system, q1, v0, fixed, t), fixed_v, held_v)
        return Assembled(q1, v1, fixed_q, fixed_v)


def _closed_position(system: "Index2System", q0: Array, fixed: Array, held: Array, t: float) -> tuple[Array, Array]:
    """Return q (nq,) with closed loops, and the fixed coordinates.

    Variants of a mechanism share the last result, unless inputs may drive it.
    """
    mech = system.mechanism
    key = q0.tobytes(), fixed.tobytes(), held.tobytes()
    found = None if mech.drivers else mech._positions.get(key)
    if found is None:
        found = _with_modes_held(lambda fixed: close_position(system, q0, fixed, t), fixed, held)
        require_preconditions(mech, found[0])
        mech._positions.clear()
        mech._positions[key] = found
    return found[0].copy(), found[1]


def assemble_start(mech: "Mechanism", t: float) -> Assembled:
    """Return the start of a mechanism, see `mbdae.Mechanism.start_at`."""
    values, driven = mech.start_values, {d.joint for d in mech.drivers}
    q, v = ({n: x for n, x in table.items() if n not in driven} for table in (values.q, values.v))
    return assemble(mech, q, v, None, values.guess_v, t)


def start_position(mech: "Mechanism") -> Array:
    """Return the configuration (nq,) of the start at t = 0, without velocities.

    Raises:
        AssemblyError: if its loops cannot be closed.
    """
    values, driven = mech.start_values, {d.joint for d in mech.drivers}
    fixed = mech.coordinates({name: x for name, x in values.q.items() if name not in driven})[1]
    system, held = mech.system(), _held_modes(mech, {**values.guess, **values.q})
    return _with_modes_held(lambda fixed: close_position(system, mech.given[0], fixed, 0.0), fixed, held)[0]


def _held_modes(mech: "Mechanism", named: Iterable[str]) -> Array:
    """Return the tangent indices (n,) of modes of flexible bodies that are neither named nor driven.

    Least changes in the mass metric would bend bodies and start vibrations although rigid bodies close the loop.
    """
    others = {*named, *(joint for driver in mech.drivers for joint in driver.between)}
    modes = [name for name in mode_joints(mech.model) if name not in others]
    return np.array([find_joint(mech.model, name).idx_v for name in modes], int)


def _with_modes_held(close: Callable[[Array], Array], fixed: Array, held: Array) -> tuple[Array, Array]:
    """Return the result of assembly with fixed coordinates, and these: with modes held, if loops can be closed so."""
    if len(held):
        both = np.union1d(fixed, held)
        with suppress(AssemblyError):
            return close(both), both
    return close(fixed), fixed


def close_velocity(system: "Index2System", q: Array, v: Array, fixed: Array, t: float) -> Array:
    """Return the velocity closest to v in the mass metric with G v + g_t = 0; some coordinates are fixed.

    Raises:
        AssemblyError: if the fixed velocities contradict the closures.
        InputError: if a massless body makes the mass metric singular.
    """
    mech, free = system.mechanism, np.delete(np.arange(system.nv), fixed)
    G, g_t = system.closures_by_size(q, t)[1], system.g_t(t)
    if not (G @ v + g_t).any():
        return v
    metric = _Metric(system, q, free)
    if (at := metric.singular()) is not None:
        joint = mech.coordinate_joint(int(free[at]))
        raise InputError(f"the mass matrix is singular at joint {joint!r}: {missing_inertia(mech.model, joint)}")
    rows = mech.row_scales
    speeds = np.linalg.norm(v / mech.coordinate_scales) + np.linalg.norm(g_t / rows)
    for _ in range(2):  # the second pass removes rounding
        v, rate = v.copy(), (G @ v + g_t) / rows
        v[free] -= metric.least_change(G[:, free], rows, rate)
    if not np.linalg.norm((G @ v + g_t) / rows) <= AGREEMENT * speeds:
        raise assembly_error(mech, largest_error(mech, G @ v + g_t, "/s"), fixed, "velocity")
    return v


def require_consistent(mech: "Mechanism", q: Array, v: Array, t: float, tolerance: float = INPUT_DIGITS) -> None:
    """Reject a start at time t that violates a closure or a driver by more than a tolerance, 1e-6 by default.

    The limit for g is in rad and characteristic lengths; for G v + g_t relative to the characteristic rate and the
    largest velocity.

    Raises:
        InputError: names the closure with the largest violation, and its size; or a violated precondition.
    """
    if not mech.ng:
        return
    g, Gv = mech.residual(q, v, t)
    speed = np.abs(v / mech.coordinate_scales).max()
    for residual, per, size in ((g, "", 1.0), (Gv, "/s", speed)):
        gap = largest_error(mech, residual, per)
        rate = mech.characteristic_rate if per and gap.relative > tolerance * size else 0.0
        if gap.relative > tolerance * (rate + size):
            raise InputError(
                f"the start is not consistent: {gap.message()}; "
                f"make it so with q, v = mechanism.assemble(q, v{f', t={t:g}' if t else ''})"
            )
    require_preconditions(mech, q)


class _Metric:
    """The mass matrix of some coordinates at q, sparse for many rows."""

    def __init__(self, system: "Index2System", q: Array, free: Array) -> None:
        self.many = system.ng > MANY_ROWS
        if self.many:
            self.M = sparse_inertia(system.model, system.workspace, q)[:, free][free]
        else:
            M = update_inertia(system.model, system.workspace, q)
            self.M = (np.triu(M) + np.triu(M, 1).T)[np.ix_(free, free)]

    def singular(self) -> int | None:
        """Return the index of a coordinate where M is not positive definite; None if it is."""
        if self.many and self._has_positive_pivots():
            return None
        self.U, info = dpotrf(self.M.toarray() if self.many else self.M, lower=0)
        return abs(info) - 1 if info else None

    def _has_positive_pivots(self) -> bool:
        """Whether elimination from the leaves of the tree, without fill-in, has positive pivots."""
        from scipy.sparse.linalg import splu

        with suppress(RuntimeError):  # exactly singular
            inward = self.M[::-1][:, ::-1].tocsc()
            factors = splu(inward, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
            return bool((factors.U.diagonal() > 0).all())
        return False

    def least_change(self, G: Any, rows: Array, rate: Array) -> Array:
        """Return the least x in this metric with G x = rows * rate, in the least-squares sense; rows (ng,) scale G."""
        if self.many:
            scaled = G.copy()
            divide_rows(scaled, rows)
            return sparse_least_squares(scaled, rate, 0.0, self.M)
        root = np.linalg.solve(self.U.T, (G / rows[:, None]).T).T  # G M^{-1/2}
        return np.linalg.solve(self.U, np.linalg.lstsq(root, rate, rcond=TRUNCATION)[0])
