"""Singular configurations, where closures lose rank and a motion may continue along several branches."""

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..data_types import JsonObject
from ..linear_solve import lapack, least_squares
from ..system import Array
from ..tolerances import AMBIGUOUS_PIVOT, NEGLIGIBLE
from ..units import quantity
from .closures import independent_rows
from .signals.reactions import mass_scaled_jacobian

if TYPE_CHECKING:
    from .formulations.index2 import Index2System

SINGULAR = AMBIGUOUS_PIVOT  # pivot ratio relative to its regular value, with projection
MAX_WITH_VIOLATION = 1e-2  # largest pivot ratio for a run that violates closures; above, its results are not reliable
BYPASS = 5.0  # distance from a singularity at which such a run may pass, divided by the square root of the violation
ROTATION_WIDTH = 1e-4  # fraction of a step: large enough to measure the rotation of the tangent space


@dataclass(frozen=True)
class Singular:
    """A singular configuration of a motion, where the closures lose rank.

    Attributes:
        t: time in s.
        q: configuration, (nq,).
        v: velocity, (nv,).
        rank: rank of G before and after.
        rank_there: rank of G in this configuration.
        closures: names of the closures whose rows become dependent there.
    """

    t: float
    q: tuple[float, ...]
    v: tuple[float, ...]
    rank: int
    rank_there: int
    closures: tuple[str, ...]

    def to_dict(self) -> JsonObject:
        """Return a dictionary for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        n, names = len(self.closures), self.closures
        where = ", ".join(names) if n <= 4 else f"{n} closures from {names[0]} to {names[-1]}"
        return f"rank {self.rank} falls to {self.rank_there} at t = {quantity(self.t, 's', '.9g')} ({where})"


def singular(system: "Index2System", t: float, y: Array, before: tuple[float, Array], limit: float) -> Singular | None:
    """Return the singular configuration at (t, y) if pivots are smaller there than ``limit`` times the largest.

    Args:
        system: a workspace; its rank is that of the run.
        t: time where the pivots are smallest.
        y: the point there.
        before: time and point slightly earlier, where the rank is regular.
        limit: pivot ratio that counts as zero.
    """
    q, v = system.split(y)
    G_before = mass_scaled_jacobian(system, before[0], system.split(before[1])[0])
    G = mass_scaled_jacobian(system, t, q)
    pivots = independent_rows.pivots(G.T)[1]
    small = pivots <= limit * pivots[0]
    rank, rank_there = system.rank or 0, int((~small).sum())
    if not rank or not small[rank - 1]:
        return None
    dependence = _row_contributions(G, rank_there) - _row_contributions(G_before, rank)
    names = [system.mechanism.row_names[int(i)] for i in np.flatnonzero(dependence > NEGLIGIBLE)]
    return Singular(t, tuple(q.tolist()), tuple(v.tolist()), rank, rank_there, tuple(dict.fromkeys(names)))


def pivot_limit_with_violation(system: "Index2System", t: float, y: Array, regular: float, violation: float) -> float:
    """Return the pivot ratio that a singular configuration may have in a run with |g| up to ``violation``.

    A violated loop separates its rows by the square root of the violation: a smallest pivot below that may be a
    singular configuration, or a path around one onto either branch.

    Args:
        system: a workspace.
        t: time.
        y: a point nearby.
        regular: pivot ratio away from singularities.
        violation: largest |g| nearby, in rad or characteristic lengths.
    """
    mech, G = system.mechanism, system.closures(system.split(y)[0])[1]
    size = float(np.abs(G * mech.coordinate_scales / mech.row_scales[:, None]).max())
    return regular * min(MAX_WITH_VIOLATION, SINGULAR + BYPASS * np.sqrt(violation / size))


def singular_crossing(system: "Index2System", t: float, y: Array, limit: float, allowed: float) -> bool:
    """Return whether the motion with closed loops passes through a singular configuration near (t, y).

    Collinear bars with a gap pass the singularity at a distance of about sqrt(gap): a residual of the vanishing
    combination of rows remains when the other rows are satisfied.

    Args:
        system: a workspace.
        t: time.
        y: a point with nearly dependent rows.
        limit: ratio of singular values that counts as zero.
        allowed: residual, relative to the size of G.
    """
    q, _ = system.split(y)
    for _ in range(2):
        U = system.inertia(t, q)
        g, G = system.closures(None, t)
        B = independent_rows.mass_scaled(U, G)
        q = system.manifold.integrate(q, -lapack().dgesv(U, least_squares(B.T, g, limit))[2])
    g, G = system.closures(q, t)
    return bool(np.abs(g).max() <= allowed * np.abs(G).max())


def tangent(system: "Index2System", t: float, y: Array) -> Array:
    """Return an orthonormal basis (nv, k) of the tangent space in the mass metric; the velocity if there is none.

    It is the null space of G M^-1/2. Along a motion it rotates smoothly; on another branch it differs. A mechanism
    whose drivers determine the motion has no null space.
    """
    q, v = system.split(y)
    G = mass_scaled_jacobian(system, t, q)
    rank = system.rank or 0
    if rank == system.nv:
        u = system.inertia(t, q) @ v
        return u[:, None] / max(float(np.linalg.norm(u)), np.finfo(float).tiny)
    return np.linalg.svd(G)[2][rank:].T


def tangent_space_angle(before: Array, after: Array) -> float:
    """Return the largest angle between two tangent spaces, in rad."""
    return float(np.arccos(np.clip(np.linalg.svd(before.T @ after, compute_uv=False).min(initial=1.0), 0.0, 1.0)))


def tangent_space_rate(system: "Index2System", t: float, y: Array, dt: float) -> float:
    """Return the rate of rotation of the tangent space along the motion, in rad/s."""
    q, v = system.split(y)
    d = dt * ROTATION_WIDTH
    moved = np.concatenate([system.manifold.integrate(q, d * v), y[system.nq :]])
    return tangent_space_angle(tangent(system, t, y), tangent(system, t + d, moved)) / abs(d)


def _row_contributions(G: Array, rank: int) -> Array:
    """Return the contribution of each row to the vanishing combinations of rows, (ng,), for the given rank."""
    left = np.linalg.svd(G)[0]
    return (left[:, rank:] ** 2).sum(axis=1)
