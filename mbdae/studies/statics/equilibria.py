"""All equilibria of a mechanism with one degree of freedom, along the curves of poses of all circuits."""

import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from ...errors import AssemblyError, InputError, StepError, as_list
from ...mechanism import Mechanism
from ...mechanism.equilibrium.equilibrium_equations import ForceBalance, Statics
from ...mechanism.tree.joints import angle_components
from ...solution.problem import mechanism_of
from ...system import Array
from ...tolerances import RANK, SAME_STATE, TINY
from ..kinematics.assembly_modes import assembly_modes
from ..kinematics.driven_mechanism import driven_mechanism, omitted_elements, require_one_dof, start_pose
from ..kinematics.kinematics import kinematics
from ..kinematics.result import Kinematics
from .equilibrium import Equilibrium, velocities, velocity_labels
from .stability import verdict
from .trust_region import TrustRegion

__all__ = ["equilibria"]

POINTS = 361
INPUTS = 3  # values of the input, over its range, at which circuits are searched
ON_CURVE = 0.25  # of the distance between two poses: tolerance for a pose on the curve


def equilibria(
    mech: Mechanism | str | Path,
    drive: str,
    *,
    span: tuple[float, float] | None = None,
    hold: str | Iterable[str] = (),
) -> list[Equilibrium]:
    """Find all equilibria of a mechanism with one degree of freedom: the zeros of Z^T f along its curves of poses.

    Besides the curve of the start, those of the other circuits are traced, from assembly modes at three values of the
    input over its range that do not lie on earlier curves (see `mbdae.assembly_modes`).

    Args:
        mech: the mechanism, or an argument of `mbdae.load`.
        drive: the joint over which the poses are traced. See `mbdae.kinematics`.
        span: its range in rad or m; one turn to both sides of the start when left out.
        hold: locked joints.

    Returns:
        Stable and unstable equilibria in the order of the curves, that of the start first; each once.

    Raises:
        InputError: if drivers or integrators leave no degree of freedom, and as `mbdae.kinematics`.
        UnknownNameError, AssemblyError, StepError: as `mbdae.kinematics`.
    """
    mech = mechanism_of(mech, "equilibria")
    held = as_list(hold, "hold is a list of joints")
    fixed = np.array([i for name in held for i in velocities(mech, name)], int)
    statics, names = Statics(mech, 0.0, np.zeros(mech.nv), fixed), velocity_labels(mech, fixed)
    s0 = np.array(list(mech.states.values()))
    _require_branch(statics, drive, tuple(held), s0)
    first = kinematics(mech, drive, span=span, hold=tuple(held), points=POINTS)
    if statics.point(first.q[0], s0).free.Z.shape[1] != 1:
        raise InputError(f"{_given(mech, drive)}: there is no branch of equilibria over it")

    out: list[Equilibrium] = []
    for curve in _circuits(first, span, tuple(held)):
        for here, search in _balanced(statics, curve, s0):
            if all(np.abs(_offsets(mech, e.q[None], here.q)).max() > SAME_STATE for e in out):
                v, holding = np.zeros(mech.nv), dict(zip(names, here.holding.tolist(), strict=True))
                judged, residual = verdict(statics, here), search.residual
                out.append(
                    Equilibrium(mech, 0.0, here.q, v, here.s, here.lam, holding, residual, search.iterations, judged)
                )
    return out


def _require_branch(statics: Statics, drive: str, hold: tuple[str, ...], s0: Array) -> None:
    """Reject a mechanism whose degree of freedom is prescribed by drivers or integrators, before any search.

    Raises:
        InputError: with the reason; and as `mbdae.kinematics` does for the start pose.
    """
    mech, begin = statics.mech, start_pose(statics.mech)
    driven = driven_mechanism(mech, drive, hold, begin)
    if statics.point(begin, s0).free.Z.shape[1]:  # the same in all regular poses
        return
    held = [d.joint or d.name for d in driven.drivers[:-1]]
    require_one_dof(driven, driven.system(), begin, drive, held, omitted_elements(mech))
    raise InputError(f"{_given(mech, drive)}: there is no branch of equilibria over it")


def _given(mech: Mechanism, drive: str) -> str:
    """Return the reason why the degree of freedom is prescribed, in words."""
    if any(d.speed is not None for d in mech.drivers):
        return f"a driver prescribes the speed of {drive!r}"
    return f"{'a driver' if mech.drivers else 'an integrator'} prescribes {drive!r}"


def _circuits(first: Kinematics, span: tuple[float, float] | None, hold: tuple[str, ...]) -> list[Kinematics]:
    """Return the curve of the start, and those of assembly modes that are not on earlier ones."""
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
        except InputError:  # it cannot reach this input
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
    for stretch in curve.stretches:
        poses = curve.q[stretch.first : stretch.last]
        offsets = _offsets(mech, poses, q)
        steps = np.diff(offsets, axis=0)
        size = np.maximum((steps**2).sum(1), TINY)
        fraction = np.clip(-(offsets[:-1] * steps).sum(1) / size, 0, 1)
        nearest = np.linalg.norm(offsets[:-1] + fraction[:, None] * steps, axis=1)
        if (nearest <= ON_CURVE * np.sqrt(size)).any():
            return True
    return False


def _balanced(statics: Statics, curve: Kinematics, s0: Array) -> Iterator[tuple[ForceBalance, TrustRegion]]:
    """Yield the equilibria along a curve, at sign changes of the force along it."""
    manifold = statics.system.manifold

    def along(q: Array, tangent: Array) -> float:
        rho, free = statics.residual_forces(statics.close(q, s0), s0)
        return float(np.sign((free.U @ tangent) @ (free.U @ free.Z[:, 0])) * rho[0])

    for stretch in curve.stretches:
        at = range(stretch.first, stretch.last - 1)
        poses = range(stretch.first, stretch.last)
        values = [along(curve.q[i], curve.tangent[i]) for i in poses]
        for i, a, b in zip(at, values, values[1:], strict=False):
            if a * b > 0 or b == 0:
                continue
            x, tau = manifold.difference(curve.q[i], curve.q[i + 1]), curve.tangent[i]
            try:
                c = brentq(lambda c, i=i, x=x, tau=tau: along(manifold.integrate(curve.q[i], c * x), tau), 0, 1)
                near = statics.close(manifold.integrate(curve.q[i], c * x), s0)
                search = TrustRegion(statics, statics.point(near, s0))
                found = search.run("any")
            except (StepError, ValueError):
                continue
            if found:
                yield search.here, search


def _offsets(mech: Mechanism, poses: Array, q: Array) -> Array:
    """Return q (-) poses (n, nq), in rad and characteristic lengths, (n, nv), up to full turns."""
    x = np.array([mech.manifold.difference(pose, q) for pose in poses]) / mech.coordinate_scales
    return np.where(angle_components(mech.model), x - 2 * np.pi * np.round(x / (2 * np.pi)), x)
