"""Newton's method for the equations of shooting."""

from contextlib import suppress

import numpy as np

from ....errors import InputError, MbdaeError
from ....mechanism.hybrid.kinds.unilateral import OPEN, gaps
from ....mechanism.hybrid.mode_point import AllRows, ModePoint
from ....system import Array
from ....tolerances import HALF_DIGITS, SOLUTION_ROUNDING, THREE_DIGITS, TRUNCATION, VISIBLE
from .cycle import ShootingEquations

MAX_ITERATIONS, MAX_HALVINGS = 30, 8
GAIN = 0.1  # fraction of the residual: less is rounding


def newton(here: ShootingEquations, tolerance: float) -> ShootingEquations:
    """Return the equations at a solution, by Newton's method with halved steps.

    Where no step reduces the residual, directions in which the equations hardly change are left out: neighbours in
    them, such as motions of another angular momentum, are solutions, too.

    Raises:
        InputError: if it does not converge.
    """
    for _ in range(MAX_ITERATIONS):
        solved = here.size <= tolerance
        there = _shortened(here, _step(here, TRUNCATION**2), 1 if solved else MAX_HALVINGS)
        if there is None and not solved:
            there = _shortened(here, _step(here, TRUNCATION), 1)
        if there is None:
            break
        here, improved = there, there.size < GAIN * here.size
        if here.size <= tolerance and not improved:
            break
    if here.size > tolerance:
        advice = "start closer to it, from a run that has settled, or with more segments"
        if hit := _contacts_at_ends(here):
            advice = f"{hit} is hit where a segment of the period begins or ends: begin at another phase"
        gap = f"a gap of {here.size:.3g} between start and end"
        raise InputError(f"no periodic motion found: Newton's method ends with {gap}; {advice}")
    return here


def _contacts_at_ends(here: ShootingEquations) -> str:
    """Return the names of open contacts whose gaps are zero at an end of a segment: no derivative exists."""
    found = list[str]()
    for run in here.runs:
        for i in (0, len(run.t) - 1):
            system, scales = run.at(i), run.mechanism.row_scales
            point = ModePoint(system, AllRows(system), float(run.t[i]), run.y[i])
            zero = (s for s, gap in gaps(point) if abs(gap) <= THREE_DIGITS * scales[s.row])
            found += [s.name for s in zero if system.mode[s.index] == OPEN]
    return " and ".join(map(repr, dict.fromkeys(found)))


def _step(here: ShootingEquations, truncation: float) -> Array:
    """Return Newton's step of the unknowns without parameters, without directions of small singular values.

    Motions of a conservative mechanism have neighbours of any energy, and the matrix would be singular at a solution,
    and bad close to it: the energy of the start is kept, with a force along its gradient, zero at a solution, as an
    unknown (Munoz-Almaraz et al., Physica D 181 (2003) 1).
    """
    unknowns = here.matrix.shape[1] - here.p
    matrix, right = here.matrix[:, :unknowns], np.zeros(len(here.matrix))
    right[: len(here.residual)] = -here.residual
    if conservative(here):
        n, last = here.n, len(here.residual) - here.n
        gradient, along, level = here.energy_gradient(0), np.zeros((len(matrix), 1)), np.zeros((1, unknowns + 1))
        gradient = gradient / (np.linalg.norm(gradient) or 1.0)
        along[last : last + n, 0] = level[0, :n] = gradient
        matrix, right = np.vstack([np.hstack([matrix, along]), level]), np.append(right, 0.0)
    return np.linalg.lstsq(matrix, right, rcond=truncation)[0][:unknowns]


def conservative(here: ShootingEquations) -> bool:
    """Return whether the equations do not depend on time and no force takes or adds energy."""
    if not here.cycle.autonomous or here.flow.mechanism.resets:  # whose work may vanish at a solution
        return False
    works = max(float(np.ptp(run.y[:, -1])) for run in here.runs)
    kinetic = max(here.system.energy(*here.system.split(y))[0] for run in here.runs for y in run.y)
    return works <= SOLUTION_ROUNDING * kinetic


def require_motion(here: ShootingEquations) -> None:
    """Reject solutions that are no motion: an equilibrium, or an end whose local coordinates another point has.

    Raises:
        InputError: if the nodes of equations that do not depend on time are at rest, or an end is not the next node.
    """
    rates = (np.linalg.norm(here.flow_direction(i)) for i in range(here.cycle.segments))
    if here.cycle.autonomous and max(rates) <= HALF_DIGITS:
        raise InputError(
            "no periodic motion found: Newton's method ends at an equilibrium, of which every T is a period; start"
            " further from it, or give a section"
        )
    mech, s = here.flow.mechanism, here.system
    nodes, ends = [*here.at.nodes[1:], here.at.nodes[0]], [*(run.y[-1] for run in here.runs[:-1]), here.return_map[0]]
    moved = [mech.manifold.difference(s.split(a)[0], s.split(b)[0]) for a, b in zip(nodes, ends, strict=True)]
    if np.abs(np.array(moved) / mech.coordinate_scales).max() > VISIBLE:
        raise InputError(
            f"no periodic motion found: after {here.at.T:.6g} s the motion is at another point of the closures, with"
            " the local coordinates of the start; give a better T, or a section"
        )


def _shortened(here: ShootingEquations, step: Array, trials: int) -> ShootingEquations | None:
    """Return the equations after a step, halved until the residual falls; None if it never does."""
    for _ in range(trials):
        with suppress(MbdaeError):
            there = ShootingEquations(here.system, here.flow, here.cycle, here.moved(step))
            if there.size < here.size and there.tangents:  # a point without derivatives leads no further
                return there
        step = step / 2
    return None
