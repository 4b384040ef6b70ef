"""Singular configurations, where closures lose rank and a motion may continue along several branches."""

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..data_types import JsonObject
from ..system import Array
from ..tolerances import AMBIGUOUS_PIVOT, NEGLIGIBLE, ZERO_SPEED
from ..units import quantity
from .closures.independent_rows import MANY_ROWS, random_probe
from .formulations.steps.row_selection import largest_entry

if TYPE_CHECKING:
    from .formulations.index2 import Index2System

SINGULAR = AMBIGUOUS_PIVOT  # pivot ratio relative to its regular value, with projection
MAX_WITH_VIOLATION = 1e-2  # largest pivot ratio for a run that violates closures; above, its results are not reliable
BYPASS = 5.0  # distance from a singularity at which such a run may pass, divided by the square root of the violation
GAUSS_NEWTON_STEPS = 2  # after them, a gap remains if the loops do not close
PROBES = 8  # random vectors, which name the closures if there are many rows
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
    (q, v), rank = system.split(y), system.rank or 0
    if not rank or system.pivot_ratio(t, y) > limit:
        return None
    many = system.ng > MANY_ROWS
    probes = random_probe(system.ng * PROBES).reshape(-1, PROBES) / np.sqrt(PROBES) if many else np.eye(system.ng)
    rank_there, there = system.vanishing_combinations(t, q, rank, limit, probes)
    _, regular = system.vanishing_combinations(before[0], system.split(before[1])[0], rank, 0.0, probes)
    vanishing, lost = there - regular, rank - rank_there
    if lost < vanishing.shape[1]:  # an orthonormal basis; otherwise projections of unit variance estimate its rows
        vanishing = np.linalg.svd(vanishing, full_matrices=False)[0][:, :lost]
    dependence = (vanishing**2).sum(axis=1)  # squares of the rows of the projection
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
    size = largest_entry(system, t, system.split(y)[0])
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
    return system.residual_of_dependent_rows(t, system.split(y)[0], limit, GAUSS_NEWTON_STEPS) <= allowed


def tangent_space_angle(system: "Index2System", before: tuple[float, Array], after: tuple[float, Array]) -> float:
    """Return the largest angle between the tangent spaces at two points (t, y), in rad, in coordinates of equal scale.

    The tangent space is the null space of G. Along a motion it rotates smoothly; on another branch it differs. If the
    rows determine the motion, the null space is empty: the angle is that between the velocities, 0 if one is zero.
    """
    points = [system.split(y) for _, y in (before, after)]
    if system.rank != system.nv:
        bases = system.null_spaces([q for q, _ in points])
    else:
        velocities = [v / system.mechanism.coordinate_scales for _, v in points]
        speeds = [np.linalg.norm(v) for v in velocities]
        if min(speeds) <= ZERO_SPEED * max(speeds):
            return 0.0
        bases = [v[:, None] / speed for v, speed in zip(velocities, speeds, strict=True)]
    cosines = np.linalg.svd(bases[0].T @ bases[1], compute_uv=False)
    return float(np.arccos(np.clip(cosines.min(initial=1.0), 0.0, 1.0)))


def tangent_space_rate(system: "Index2System", t: float, y: Array, dt: float) -> float:
    """Return the rate of rotation of the tangent space along the motion, in rad/s."""
    q, v = system.split(y)
    d = dt * ROTATION_WIDTH
    moved = np.concatenate([system.manifold.integrate(q, d * v), y[system.nq :]])
    return tangent_space_angle(system, (t, y), (t + d, moved)) / abs(d)
