"""Newton's method for the equations of shooting."""

from contextlib import suppress

import numpy as np

from ....errors import InputError, MbdaeError
from ....mechanism.hybrid.kinds.unilateral import OPEN, gaps
from ....mechanism.hybrid.mode_point import AllRows, ModePoint
from ....system import Array
from ....tolerances import HALF_DIGITS, SOLUTION_ROUNDING, THREE_DIGITS, TRUNCATION, VISIBLE
from .shooting_equations import ShootingEquations

MAX_ITERATIONS, MAX_HALVINGS = 30, 8
GAIN = 0.1  # ratio of residuals below which an iteration is an improvement, not rounding


def newton(current: ShootingEquations, tolerance: float) -> ShootingEquations:
    """Return the equations at a solution, by Newton's method with halved steps.

    If no step reduces the residual, directions of small singular values are truncated: along them, neighbouring
    motions, such as those of another angular momentum, are solutions, too.

    Raises:
        InputError: if the method does not converge.
    """
    for _ in range(MAX_ITERATIONS):
        solved = current.size <= tolerance
        trial = _reduce_residual(current, _step(current, TRUNCATION**2), 1 if solved else MAX_HALVINGS)
        if trial is None and not solved:
            trial = _reduce_residual(current, _step(current, TRUNCATION), 1)
        if trial is None:
            break
        current, improved = trial, trial.size < GAIN * current.size
        if current.size <= tolerance and not improved:
            break
    if current.size > tolerance:
        advice = "start closer to it, from a run that has settled, or with more segments"
        if hit := _contacts_at_ends(current):
            advice = f"{hit} is hit where a segment of the period begins or ends: begin at another phase"
        gap = f"a gap of {current.size:.3g} between start and end"
        raise InputError(f"no periodic motion found: Newton's method ends with {gap}; {advice}")
    return current


def _contacts_at_ends(current: ShootingEquations) -> str:
    """Return the names of open contacts whose gaps are zero at an end of a segment, where no derivative exists."""
    found = list[str]()
    for run in current.runs:
        for i in (0, len(run.t) - 1):
            system, scales = run.at(i), run.mechanism.row_scales
            point = ModePoint(system, AllRows(system), float(run.t[i]), run.y[i])
            zero = (s for s, gap in gaps(point) if abs(gap) <= THREE_DIGITS * scales[s.row])
            found += [s.name for s in zero if system.mode[s.index] == OPEN]
    return " and ".join(map(repr, dict.fromkeys(found)))


def _step(current: ShootingEquations, truncation: float) -> Array:
    """Return Newton's step of the unknowns except parameters, without directions of small singular values.

    A conservative mechanism has a family of periodic motions over the energy, so that the matrix is singular at a
    solution. Therefore the energy of the start is fixed, and a force along its gradient, zero at a solution, is an
    additional unknown (Munoz-Almaraz et al., Physica D 181 (2003) 1).
    """
    unknowns = current.matrix.shape[1] - current.p
    matrix, rhs = current.matrix[:, :unknowns], np.zeros(len(current.matrix))
    rhs[: len(current.residual)] = -current.residual
    if conservative(current):
        n, last = current.n, len(current.residual) - current.n
        gradient, along, level = current.energy_gradient(0), np.zeros((len(matrix), 1)), np.zeros((1, unknowns + 1))
        gradient = gradient / (np.linalg.norm(gradient) or 1.0)
        along[last : last + n, 0] = level[0, :n] = gradient
        matrix, rhs = np.vstack([np.hstack([matrix, along]), level]), np.append(rhs, 0.0)
    return np.linalg.lstsq(matrix, rhs, rcond=truncation)[0][:unknowns]


def conservative(current: ShootingEquations) -> bool:
    """Return whether the equations are autonomous and no force dissipates or adds energy."""
    if not current.cycle.autonomous or current.flow.mechanism.resets:  # whose work may vanish at a solution
        return False
    works = max(float(np.ptp(run.y[:, -1])) for run in current.runs)
    kinetic = max(current.system.energy(*current.system.split(y))[0] for run in current.runs for y in run.y)
    return works <= SOLUTION_ROUNDING * kinetic


def require_motion(current: ShootingEquations) -> None:
    """Reject spurious solutions: an equilibrium, or another point with the same local coordinates as the start.

    Raises:
        InputError: if the nodes of an autonomous motion are at rest, or an end is not the next node.
    """
    rates = (np.linalg.norm(current.flow_direction(i)) for i in range(current.cycle.segments))
    if current.cycle.autonomous and max(rates) <= HALF_DIGITS:
        raise InputError(
            "no periodic motion found: Newton's method ends at an equilibrium, of which every T is a period; start"
            " further from it, or give a section"
        )
    mech, s = current.flow.mechanism, current.system
    nodes = [*current.guess.nodes[1:], current.guess.nodes[0]]
    ends = [*(run.y[-1] for run in current.runs[:-1]), current.return_map[0]]
    moved = [mech.manifold.difference(s.split(a)[0], s.split(b)[0]) for a, b in zip(nodes, ends, strict=True)]
    if np.abs(np.array(moved) / mech.coordinate_scales).max() > VISIBLE:
        raise InputError(
            f"no periodic motion found: after {current.guess.T:.6g} s the motion is at another point of the closures,"
            " with the local coordinates of the start; give a better T, or a section"
        )


def _reduce_residual(current: ShootingEquations, step: Array, trials: int) -> ShootingEquations | None:
    """Return the equations after a step that is halved until the residual decreases; None if it never does."""
    for _ in range(trials):
        with suppress(MbdaeError):
            trial = ShootingEquations(current.system, current.flow, current.cycle, current.guess_after(step))
            if trial.size < current.size and trial.tangents:  # a point without derivatives leads no further
                return trial
        step = step / 2
    return None
