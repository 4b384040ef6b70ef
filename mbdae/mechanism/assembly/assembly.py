"""Consistent states: g(t, q) = 0 near an initial estimate, then G v + g_t = 0 in the mass metric.

All thresholds are in rad and in characteristic lengths of the mechanism.
"""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...errors import AssemblyError, InputError, require
from ...system import Array
from ...tolerances import INPUT_DIGITS
from ..closures.closure_error import largest_error
from ..closures.preconditions import require_preconditions
from ..hybrid.switches import mode_by_position
from ..model_settings import normalized_or_none, tangent_indices
from ..run_parameters import RunParameters
from ..tree.tree_terms import mode_joints
from .position_search import close_position
from .velocity_projection import VelocityProjection

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism

ARRAYS = np.ndarray | list | tuple
VALUES = ARRAYS | Mapping | None


class InitialEstimate(NamedTuple):
    """A state q (nq,), v (nv,), or several velocities (k, nv), from which assembly starts.

    ``fixed`` are tangent indices of fixed coordinates, (n,); ``locked`` of modes of flexible bodies that are locked if
    loops close without them, (n,); ``parameters`` are inertia parameters for each of several velocities.
    """

    q: Array
    fixed_q: Array
    locked_q: Array
    v: Array
    fixed_v: Array
    locked_v: Array
    parameters: RunParameters = RunParameters()


class Assembled(NamedTuple):
    """A consistent state q (nq,), v (nv,), and the tangent indices of its fixed coordinates, (n,) each."""

    q: Array
    v: Array
    fixed_q: Array
    fixed_v: Array


def assemble(
    mech: "Mechanism", q: Any, v: Any, guess: Any, guess_v: Mapping[str, Any] | None = None, t: float = 0.0
) -> Assembled:
    """See `mbdae.Mechanism.assemble`; ``guess_v`` are initial estimates of velocities that are not fixed."""
    require(q, VALUES, "q must be a table of values by joint, or all of them as an array")
    require(v, VALUES, "v must be a table of values by joint, or all of them as an array")
    require(guess, Mapping | None, "guess must be a table of values by joint")
    return assemble_from(mech, _initial_estimate(mech, q, v, guess or {}, guess_v or {}), t)


def _initial_estimate(
    mech: "Mechanism", q: Any, v: Any, guess: Mapping[str, Any], guess_v: Mapping[str, Any]
) -> InitialEstimate:
    fixed_q, fixed_v = (np.array([], int),) * 2
    locked_q, locked_v = fixed_q, fixed_v
    if isinstance(q, ARRAYS):
        q0 = normalized_or_none(mech.model, mech.vector("q", q, mech.nq))
        if q0 is None:
            raise InputError("q is not on the manifold: a quaternion, or cosine and sine of an angle, vanish")
    else:
        table = {**mech.start_values.guess, **mech.start_values.q, **guess, **(q or {})}
        q0 = mech.coordinates(table)[0]
        fixed_q = tangent_indices(mech.model, q or {})
        locked_q = _locked_modes(mech, {**mech.start_values.guess, **guess, **(q or {})})
    if isinstance(v, ARRAYS):
        v0 = mech.vector("v", v, mech.nv)
    else:
        v0 = mech.coordinates({**guess_v, **(v or {})}, of_v=True)[0]
        fixed_v = tangent_indices(mech.model, v or {})
        locked_v = _locked_modes(mech, {**guess_v, **(v or {})})
    return InitialEstimate(q0, fixed_q, locked_q, v0, fixed_v, locked_v)


def assemble_from(mech: "Mechanism", estimate: InitialEstimate, t: float) -> Assembled:
    """Return the consistent state near an initial estimate; several velocities (k, nv) yield several velocities.

    Raises:
        AssemblyError: see `assemble`; if any velocity cannot be made consistent.
    """
    for driver in mech.drivers:
        driver.check(t)
    with mech.workspaces.borrowed() as system:
        position = _closed_position(system, estimate.q, estimate.fixed_q, estimate.locked_q, t)

        def close(fixed: Array) -> Array:
            return position.velocity_projection(system, fixed, t).project(system, estimate.v, estimate.parameters)

        v, fixed_v = _with_locked_modes(close, estimate.fixed_v, estimate.locked_v)
        return Assembled(position.q.copy(), v, position.fixed, fixed_v)


class _ClosedPosition(NamedTuple):
    """Configuration q (nq,) with closed loops, its fixed coordinates, and its velocity projections.

    Projections are cached by their fixed velocities.
    """

    q: Array
    fixed: Array
    by_fixed: dict[bytes, VelocityProjection]

    def velocity_projection(self, system: "Index2System", fixed: Array, t: float) -> VelocityProjection:
        """Return the projection of velocities onto G v + g_t = 0."""
        key = fixed.tobytes()
        if key not in self.by_fixed:
            self.by_fixed[key] = VelocityProjection(system, self.q, fixed, t)
        return self.by_fixed[key]


def _closed_position(system: "Index2System", q0: Array, fixed: Array, locked: Array, t: float) -> _ClosedPosition:
    """Return a configuration with closed loops; variants of an undriven mechanism share the last configuration."""
    mech = system.mechanism
    key = q0.tobytes(), fixed.tobytes(), locked.tobytes()
    found = None if mech.drivers else mech._positions.get(key)
    if found is None:
        found = _ClosedPosition(*_closed(system, q0, fixed, locked, t), {})
        require_preconditions(mech, found.q)
        mech._positions.clear()
        mech._positions[key] = found
    system.enter(_mode_at(system, found.q, t))
    return found


def _closed(system: "Index2System", q0: Array, fixed: Array, locked: Array, t: float) -> tuple[Array, Array]:
    """Return a configuration with closed loops, and its fixed coordinates.

    Closures with an active range are closed where they are active once drivers have moved the joint of their range.
    """
    closed = _with_locked_modes(lambda fixed: close_position(system, q0, fixed, t), fixed, locked)
    if (mode := _mode_at(system, closed[0], t)) == system.mode:
        return closed
    system.enter(mode)
    return _with_locked_modes(lambda fixed: close_position(system, closed[0], fixed, t), fixed, locked)


def _mode_at(system: "Index2System", q: Array, t: float) -> tuple[int, ...]:
    return mode_by_position(system.mechanism.switches, system.mode, t, q, np.zeros(system.nv))


def assemble_start(mech: "Mechanism", t: float) -> Assembled:
    """Return the start of a mechanism, see `mbdae.Mechanism.start_at`."""
    return assemble_from(mech, start_estimate(mech), t)


def start_estimate(mech: "Mechanism") -> InitialEstimate:
    """Return the initial estimate from the start values of a mechanism."""
    values, driven = mech.start_values, {d.joint for d in mech.drivers}
    v = {name: x for name, x in values.v.items() if name not in driven}
    return _initial_estimate(mech, _undriven(mech, values.q), v, {}, values.guess_v)


def _undriven(mech: "Mechanism", q: Mapping[str, Any]) -> dict[str, Any]:
    """Return the start coordinates of joints whose position is not prescribed by a driver; speed drivers do not."""
    driven = {d.joint for d in mech.drivers if d.speed is None}
    return {name: x for name, x in q.items() if name not in driven}


def start_configuration(mech: "Mechanism") -> Array:
    """Return the configuration (nq,) of the start at t = 0, without assembling velocities.

    Raises:
        AssemblyError: if its loops cannot be closed.
    """
    if not mech.start_values.assemble:
        return mech.unassembled_start[0]
    system, (q, fixed_q, locked_q, *_) = mech.system(), start_estimate(mech)
    return _closed(system, q, fixed_q, locked_q, 0.0)[0]


def _locked_modes(mech: "Mechanism", named: Iterable[str]) -> Array:
    """Return the tangent indices (n,) of modes of flexible bodies that are neither named nor driven.

    Otherwise the smallest change in the mass metric would bend bodies and excite vibrations although rigid bodies can
    close the loop.
    """
    excluded = {*named, *(joint for driver in mech.drivers for joint in driver.between)}
    modes = [name for name in mode_joints(mech.model) if name not in excluded]
    return tangent_indices(mech.model, modes)


def _with_locked_modes(close: Callable[[Array], Array], fixed: Array, locked: Array) -> tuple[Array, Array]:
    """Return the result of assembly and its fixed coordinates; modes are locked if loops can be closed without them."""
    if len(locked):
        both = np.union1d(fixed, locked)
        with suppress(AssemblyError):
            return close(both), both
    return close(fixed), fixed


def require_consistent(
    mech: "Mechanism",
    q: Array,
    v: Array,
    t: float,
    tolerance: float = INPUT_DIGITS,
    residual: Callable[..., tuple[Array, Array]] | None = None,
) -> None:
    """Reject a start at time t that violates a closure or a driver by more than a tolerance, 1e-6 by default.

    The limit for g is in rad and characteristic lengths; for G v + g_t relative to the characteristic rate and the
    largest velocity. ``residual`` replaces `Mechanism.residual`.

    Raises:
        InputError: names the closure with the largest violation, and its size; or a violated precondition.
    """
    if not mech.ng:
        return
    g, Gv = (residual or mech.residual)(q, v, t)
    speed = np.abs(v / mech.coordinate_scales).max()
    for rows, per, size in ((g, "", 1.0), (Gv, "/s", speed)):
        if np.linalg.norm(rows / mech.row_scales) <= tolerance * size:  # the violation of each closure is not larger
            continue
        violation = largest_error(mech, rows, per)
        rate = mech.characteristic_rate if per and violation.relative > tolerance * size else 0.0
        if violation.relative > tolerance * (rate + size):
            raise InputError(
                f"the start is not consistent: {violation.message()}; "
                f"make it so with q, v = mechanism.assemble(q, v{f', t={t:g}' if t else ''})"
            )
    require_preconditions(mech, q)
