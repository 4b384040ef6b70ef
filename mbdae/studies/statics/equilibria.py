"""All equilibria of a mechanism with one degree of freedom, along the curves of poses of all circuits.

On intervals of a curve with open contacts, 0 <= gap, equilibria are the zeros of Z^T f; at the ends of the intervals
they are poses with a compressive normal force, N >= 0.
"""

import warnings
from collections.abc import Iterable, Iterator
from itertools import chain, compress, pairwise

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from ...errors import AssemblyError, InputError, StepError, as_list
from ...mechanism import Mechanism, ModelSource
from ...mechanism.assembly.assembly import start_configuration
from ...mechanism.equilibrium.equilibrium_equations import Statics
from ...mechanism.tree.joints import angle_components
from ...mechanism.tree.tree_terms import mode_joints
from ...solution.problem import mechanism_of
from ...system import Array
from ...tolerances import RANK, SAME_STATE, TINY
from ..kinematics.assembly_modes import assembly_modes
from ..kinematics.driven_mechanism import driven_mechanism, omitted_elements, require_one_dof
from ..kinematics.kinematics import kinematics
from ..kinematics.result import Kinematics
from .contacts import Contacts
from .equilibrium import Equilibrium, velocity_indices, velocity_labels
from .stability import verdict
from .trust_region import TrustRegion

__all__ = ["equilibria"]

POINTS = 361
INPUTS = 3  # number of values of the input at which circuits are searched
ContactBalance = tuple[TrustRegion, dict[str, float]]  # a balance of forces, and the normal forces of its contacts
ON_CURVE = 0.25  # largest distance of a pose from a curve that contains it, over the distance of two poses


def equilibria(
    mech: Mechanism | ModelSource,
    drive: str,
    *,
    span: tuple[float, float] | None = None,
    hold: str | Iterable[str] = (),
) -> list[Equilibrium]:
    """Find all equilibria of a mechanism with one degree of freedom: the zeros of Z^T f along its curves of poses.

    Equilibria that violate a stop, a rope or a plane are omitted; equilibria that are supported by one are added.

    Besides the curve of the start, the curves of all further circuits are traced, from assembly modes at three values
    of the input that do not lie on earlier curves (see `mbdae.assembly_modes`).

    Args:
        mech: the mechanism, or an argument of `mbdae.load`.
        drive: the joint over which the poses are traced. See `mbdae.kinematics`.
        span: range of the joint in rad or m; one turn to both sides of the start when left out.
        hold: joints to lock.

    Returns:
        Stable and unstable equilibria in the order of the curves, that of the start first; each once.

    Raises:
        InputError: if drivers or integrators leave no degree of freedom, and as `mbdae.kinematics`.
        UnknownNameError, AssemblyError, StepError: as `mbdae.kinematics`.
    """
    mech = mechanism_of(mech, "equilibria")
    locked = as_list(hold, "hold is a list of joints")
    if bending := [name for name in mode_joints(mech.model) if name not in locked]:
        text = f"flexible bodies leave more than one degree of freedom: hold {', '.join(bending)}"
        raise InputError(f"{text}, or find an equilibrium in which they deform by mbdae.equilibrium")
    fixed = np.array([i for name in locked for i in velocity_indices(mech, name)], int)
    contacts, v, names = Contacts(mech, 0.0), np.zeros(mech.nv), velocity_labels(mech, fixed)
    statics = Statics(mech, 0.0, v, fixed, mode=contacts.mode(set()))
    s0 = np.array(list(mech.states.values()))
    _require_branch(statics, drive, tuple(locked), s0)
    first = kinematics(mech, drive, span=span, hold=tuple(locked), points=POINTS)
    if statics.point(first.q[0], s0).free.Z.shape[1] != 1:
        raise InputError(f"{_reason_prescribed(mech, drive)}: there is no branch of equilibria over it")

    out: list[Equilibrium] = []
    for curve in _circuits(first, span, tuple(locked)):
        free: Iterator[ContactBalance] = (
            (s, {}) for s in _free_equilibria(statics, curve, s0) if not contacts.violated(set(), s.best)
        )
        for search, loads in chain(free, _supported_equilibria(contacts, fixed, curve, s0)):
            balance, n = search.best, search.iterations
            if all(np.abs(_offsets(mech, e.q[None], balance.q)).max() > SAME_STATE for e in out):
                holding = dict(zip(names, balance.holding.tolist(), strict=True))
                stability, indeterminate = verdict(search.statics, balance), compress(names, balance.indeterminate)
                results = balance.s, balance.lam, holding, search.residual, n, stability, loads
                out.append(Equilibrium(mech, 0.0, balance.q, v, *results, tuple(indeterminate)))
    return out


def _require_branch(statics: Statics, drive: str, hold: tuple[str, ...], s0: Array) -> None:
    """Reject a mechanism whose degree of freedom is prescribed by drivers or integrators, before any search.

    Raises:
        InputError: with the reason; and as `mbdae.kinematics` does for the start pose.
    """
    mech, start = statics.mech, start_configuration(statics.mech)
    driven = driven_mechanism(mech, drive, hold, start)
    if statics.point(start, s0).free.Z.shape[1]:  # the same in all regular poses
        return
    locked = [d.joint or d.name for d in driven.drivers[:-1]]
    require_one_dof(driven, driven.system(), start, drive, locked, omitted_elements(mech))
    raise InputError(f"{_reason_prescribed(mech, drive)}: there is no branch of equilibria over it")


def _reason_prescribed(mech: Mechanism, drive: str) -> str:
    """Return the reason why the degree of freedom is prescribed, in words."""
    if any(d.speed is not None for d in mech.drivers):
        return f"a driver prescribes the speed of {drive!r}"
    return f"{'a driver' if mech.drivers else 'an integrator'} prescribes {drive!r}"


def _circuits(first: Kinematics, span: tuple[float, float] | None, hold: tuple[str, ...]) -> list[Kinematics]:
    """Return the curve of the start, and the curves of assembly modes that are not on earlier curves."""
    mech, drive, curves = first.mechanism, first.drive, [first]
    if not mech.closures:
        return curves
    start = assembly_modes(mech, drive, hold=hold)
    if span is not None:
        inputs = np.linspace(*span, INPUTS + 2)[1:-1]
    else:
        inputs = start.u + 2 * np.pi * np.arange(1, INPUTS) / INPUTS
    for u in (start.u, *inputs.tolist()):
        try:
            found = start if u == start.u else assembly_modes(mech, drive, u, hold=hold)
        except InputError:  # the mechanism does not assemble at this input
            continue
        for warning in found.warnings:
            warnings.warn(f"equilibria over {drive!r}: {warning}", stacklevel=3)
        for mode in found.modes:
            if mode.margin < RANK or any(_contains(mech, curve, mode.q) for curve in curves):
                continue
            try:
                curves.append(kinematics(mech, drive, span=span, hold=hold, points=POINTS, q=mode.q))
            except (AssemblyError, StepError, InputError) as e:
                text = f"equilibria on the circuit of assembly mode {mode.label} at {drive} = {u:.6g} are missing: {e}"
                warnings.warn(text, stacklevel=3)
    return curves


def _contains(mech: Mechanism, curve: Kinematics, q: Array) -> bool:
    """Return whether a curve contains a pose."""
    for segment in curve.segments:
        poses = curve.q[segment.first : segment.last]
        offsets = _offsets(mech, poses, q)
        steps = np.diff(offsets, axis=0)
        size = np.maximum((steps**2).sum(1), TINY)
        fraction = np.clip(-(offsets[:-1] * steps).sum(1) / size, 0, 1)
        nearest = np.linalg.norm(offsets[:-1] + fraction[:, None] * steps, axis=1)
        if (nearest <= ON_CURVE * np.sqrt(size)).any():
            return True
    return False


def _supported_equilibria(contacts: Contacts, fixed: Array, curve: Kinematics, s0: Array) -> Iterator[ContactBalance]:
    """Yield the equilibria along a curve that a contact supports, at zeros of its gap, and the normal force."""
    mech = curve.mechanism
    for k in range(len(contacts.switches)):
        statics = Statics(mech, 0.0, np.zeros(mech.nv), fixed, mode=contacts.mode({k}))
        for pose in _closing_poses(contacts, k, curve):
            try:
                search = TrustRegion(statics, statics.point(statics.project(pose, s0), s0))
            except StepError:
                continue
            if not search.best.free.Z.shape[1] and not contacts.violated({k}, search.best):
                yield search, contacts.contact_forces({k}, search.best.lam)


def _closing_poses(contacts: Contacts, k: int, curve: Kinematics) -> Iterator[Array]:
    """Yield poses close to the zeros of a gap, which is interpolated along a curve by cubics."""
    if contacts.all_rows is None:
        return
    manifold, row, scale = curve.mechanism.manifold, contacts.rows[k], curve.mechanism.row_scales[contacts.rows[k]]
    for s, q, tangent in _segments(curve):
        at = [contacts.all_rows(contacts.t, pose) for pose in q]
        rates = [float(G[row] @ x) / scale for (_, G, _), x in zip(at, tangent, strict=True)]
        roots = CubicHermiteSpline(s, [g[row] / scale for g, _, _ in at], rates).roots(False, False)
        for root in roots[np.isfinite(roots)]:
            i = int(np.clip(np.searchsorted(s, root, side="right") - 1, 0, len(s) - 2))
            fraction = (root - s[i]) / (s[i + 1] - s[i])
            yield manifold.integrate(q[i], fraction * manifold.difference(q[i], q[i + 1]))


def _segments(curve: Kinematics) -> Iterator[tuple[Array, Array, Array]]:
    """Yield arclengths (n,), poses (n, nq) and tangents (n, nv) of the segments of a curve.

    A segment that closes up to full turns is repeated before the start if there are contacts, whose gaps depend on the
    number of turns.
    """
    mech = curve.mechanism
    for segment in curve.segments:
        s, indices = np.unique(curve.s[segment.first : segment.last], return_index=True)
        q, tangent = (x[segment.first : segment.last][indices] for x in (curve.q, curve.tangent))
        if len(s) < 2:
            continue
        yield s, q, tangent
        advance = mech.manifold.difference(q[0], q[-1])
        closes = np.abs(_offsets(mech, q[:1], q[-1])).max() <= SAME_STATE
        if mech.switches and closes and np.abs(advance).max() > SAME_STATE:
            yield s, np.array([mech.manifold.integrate(pose, -advance) for pose in q]), tangent


def _free_equilibria(statics: Statics, curve: Kinematics, s0: Array) -> Iterator[TrustRegion]:
    """Yield the equilibria along a curve, at sign changes of the force along it."""
    manifold = statics.system.manifold

    def tangential_force(q: Array, tangent: Array) -> float:
        rho, free = statics.residual_forces(statics.project(q, s0), s0)
        return float(np.sign((free.U @ tangent) @ (free.U @ free.Z[:, 0])) * rho[0])

    for _, q, tangents in _segments(curve):
        values = [tangential_force(pose, tangent) for pose, tangent in zip(q, tangents, strict=True)]
        for i, (a, b) in enumerate(pairwise(values)):
            if a * b > 0 or b == 0:
                continue
            x, tau = manifold.difference(q[i], q[i + 1]), tangents[i]
            try:
                c = brentq(lambda c, q=q[i], x=x, tau=tau: tangential_force(manifold.integrate(q, c * x), tau), 0, 1)
                pose = statics.project(manifold.integrate(q[i], c * x), s0)
                search = TrustRegion(statics, statics.point(pose, s0))
                found = search.run("any")
            except (StepError, ValueError):
                continue
            if found:
                yield search


def _offsets(mech: Mechanism, poses: Array, q: Array) -> Array:
    """Return q (-) poses (n, nq), in rad and characteristic lengths, (n, nv), up to full turns."""
    x = np.array([mech.manifold.difference(pose, q) for pose in poses]) / mech.coordinate_scales
    return np.where(angle_components(mech.model), x - 2 * np.pi * np.round(x / (2 * np.pi)), x)
