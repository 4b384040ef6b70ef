"""The periodic motion of solved equations, and its Floquet multipliers."""

from collections.abc import Sequence

import numpy as np

from ...system import Array
from ...tolerances import HALF_DIGITS, SAME_STATE
from .result import PeriodicMotion, UnitMultiplier
from .shooting.multipliers import on_quotient, periodic_eigenvalues
from .shooting.shooting_equations import ShootingEquations


def motion_of(found: ShootingEquations) -> PeriodicMotion:
    """Return the periodic motion of solved equations, with its multipliers."""
    cycle, guess, mech = found.cycle, found.guess, found.flow.mechanism
    q, v, s, _ = np.split(guess.nodes[0], np.cumsum([mech.nq, mech.nv, len(mech.states)]))
    multipliers, neutral = floquet(found)
    T, runs = float(found.runs[-1].t[-1]) - cycle.t, tuple(found.runs)
    advances = {x.name: float(-sigma) for x, sigma in zip(cycle.symmetries, guess.sigma, strict=True)}
    shifted = [(name, mech.model.joints[mech.model.getJointId(name)]) for name in mech.joint_names]
    shifts = {name: float(guess.shifts[j.idx_v]) for name, j in shifted if j.nv == 1 and guess.shifts[j.idx_v]}
    return PeriodicMotion(mech, T, cycle.t, q, v, s, multipliers, neutral, advances, shifts, found.size, runs, found)


def floquet(found: ShootingEquations) -> tuple[Array, tuple[UnitMultiplier, ...]]:
    """Return the multipliers that are not neutral, and the neutral multipliers with their errors."""
    factors, nodes = found.factors, range(found.cycle.segments)
    names, known = _known_directions(found)
    neutral = [UnitMultiplier(name, _right_error(factors, known, j)) for j, name in enumerate(names)]
    energies = [found.energy_gradient(i) for i in nodes]
    error = _left_error(factors, energies)
    if error <= SAME_STATE:
        neutral.append(UnitMultiplier("energy", error))
        known = [np.column_stack([w, e]) for w, e in zip(known, energies, strict=True)]
    return periodic_eigenvalues(on_quotient(factors, known)), tuple(neutral)


def _known_directions(found: ShootingEquations) -> tuple[list[str], list[Array]]:
    """Return the names of the free phase and of symmetries, and their directions at each node, (n, m) each."""
    nodes, names = range(found.cycle.segments), [x.name for x in found.cycle.symmetries]
    known, flows = [found.symmetry_directions(i) for i in nodes], [found.flow_direction(i) for i in nodes]
    if not found.cycle.autonomous or min(np.linalg.norm(x) for x in flows) <= HALF_DIGITS:
        return names, known
    return ["time", *names], [np.column_stack([f, w]) for f, w in zip(flows, known, strict=True)]


def _right_error(factors: Sequence[Array], known: Sequence[Array], j: int) -> float:
    """Return the largest relative distance of M_i w_i from the span of the known directions at the next node."""
    errors = [0.0]
    for M, start, end in zip(factors, known, [*known[1:], known[0]], strict=True):
        image = M @ start[:, j]
        residual = image - end @ np.linalg.lstsq(end, image, rcond=None)[0]
        errors.append(float(np.linalg.norm(residual) / np.linalg.norm(start[:, j])))
    return max(errors)


def _left_error(factors: Sequence[Array], rows: Sequence[Array]) -> float:
    """Return the largest relative distance of e_(i+1) M_i from e_i; 1 for rows that vanish."""
    if not all(row.any() for row in rows):
        return 1.0
    triples = zip(factors, rows, [*rows[1:], rows[0]], strict=True)
    return max(float(np.linalg.norm(b @ M - a) / np.linalg.norm(a)) for M, a, b in triples)
