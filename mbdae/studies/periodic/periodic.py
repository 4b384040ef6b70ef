"""Periodic motions of mechanisms, and their stability."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, is_number
from ...mechanism import Mechanism
from ...mechanism.discrete_sensitivity.parameter_partials import Parameters
from ...mechanism.mechanism import Coordinates
from ...solution.problem import mechanism_of
from ...solution.solution import Solution
from ...system import Array
from ...tolerances import HALF_DIGITS, SAME_STATE
from .flow import Flow
from .guess import guess_of, settled_start
from .multipliers import on_quotient, periodic_eigenvalues
from .result import Neutral, PeriodicMotion
from .shooting import Cycle, Guess, Linearisation, newton

__all__ = ["periodic"]

METHOD, RTOL = "pherk6", 1e-12
GAP = 100.0  # of rtol: residual of shooting, which step-size control makes uneven


def periodic(
    model: Mechanism | Solution | str | Path,
    T: float | None = None,
    *,
    q: Coordinates | Array | None = None,
    v: Coordinates | Array | None = None,
    s: Array | None = None,
    t: float = 0.0,
    section: str | None = None,
    symmetry: Sequence[str] = (),
    parts: int | None = None,
    method: str | None = None,
    rtol: float = RTOL,
) -> PeriodicMotion:
    """Find a periodic motion near a state, and its Floquet multipliers.

        y(t + T) = g(sigma) y(t),   mu: eigenvalues of dy(T)/dy(0)

    Shooting by Newton's method with the exact tangents of the computed steps, in local coordinates of the closed
    manifold. If forces or drivers depend on time, T is a period of theirs; otherwise it is found, too.

    Args:
        model: a mechanism, a name or path, see `mbdae.load`; or a run that has nearly settled, whose end is the guess.
        T: period in s: given if the mechanism is driven, else an estimate, not needed with a section or a run.
        q: guess of the configuration: joint = value, or (nq,); the model's start when left out.
        v: guess of the velocity: joint = value, or (nv,).
        s: guess of the states of forces, (ns,).
        t: time in s of the start.
        section: signal and level at which a period begins and ends, ``"q.crank > 0.1"`` for rising crossings.
        symmetry: along which the motion advances in a period: ``"x"``, ``"y"``, ``"z"``, ``"turn"`` about the vertical,
            or names of joints on whose angles nothing depends.
        parts: of the period that are shot separately; for long or strongly unstable motions.
        method: of the runs; pherk6, or the model's, when left out.
        rtol: relative tolerance of the runs.

    Raises:
        InputError: if no periodic motion is found, or for a motion without derivatives.
        UnknownNameError: for an unknown signal, joint, method or symmetry.
    """
    require_positive_period(T)
    mech = mechanism_of(model.mechanism if isinstance(model, Solution) else model, "periodic")
    options = {"method": method or mech.settings.method or METHOD, "rtol": rtol}
    given = settled_start(model, T, symmetry) if isinstance(model, Solution) else None
    y0, T = given or (start_point(mech, q, v, s, t), T)
    flow = Flow(mech, Parameters(lambda values: mech, {}), options)
    return converged(flow, guess_of(flow, y0, T, t, section, symmetry, parts), rtol)


def require_positive_period(T: float | None) -> None:
    """Reject a period that is not a positive number.

    Raises:
        InputError: naming it.
    """
    if T is not None and not (is_number(T) and T > 0):
        raise InputError(f"the period T must be a positive number of seconds, got {T!r:.60}")


def start_point(mech: Mechanism, q: Any, v: Any, s: Array | None, t: float) -> Array:
    """Return the consistent point (q, v, s, 0) near a guess."""
    if isinstance(q, Mapping) or isinstance(v, Mapping):
        q, v = mech.assemble(q, v, t=t)
    return mech.point(q, v, t, s)


def converged(flow: Flow, kind: tuple[Cycle, Guess], rtol: float) -> PeriodicMotion:
    """Return the periodic motion near a guess.

    Raises:
        InputError: if none is found.
    """
    cycle, guess = kind
    found = newton(Linearisation(flow.mechanism.system(), flow, cycle, guess), GAP * rtol)
    return motion_of(newton(found.refined(), GAP * rtol))


def motion_of(found: Linearisation) -> PeriodicMotion:
    """Return the periodic motion of solved equations, with its multipliers."""
    cycle, at, mech = found.cycle, found.at, found.flow.mechanism
    q, v, s, _ = np.split(at.nodes[0], np.cumsum([mech.nq, mech.nv, len(mech.states)]))
    multipliers, neutral = floquet(found)
    T = float(found.ends[-1].sol.t[-1]) - cycle.t
    advances = {x.name: float(-sigma) for x, sigma in zip(cycle.symmetries, at.sigma, strict=True)}
    runs = tuple(end.sol for end in found.ends)
    return PeriodicMotion(mech, T, cycle.t, q, v, s, multipliers, neutral, advances, found.size, runs, found)


def floquet(found: Linearisation) -> tuple[Array, tuple[Neutral, ...]]:
    """Return the multipliers that are not neutral, and the neutral ones with their errors."""
    factors, k = found.factors, found.cycle.parts
    names = [x.name for x in found.cycle.symmetries]
    known = [found.symmetry_directions(i) for i in range(k)]
    flows = [found.flow_direction(i) for i in range(k)]
    if found.cycle.free and min(np.linalg.norm(x) for x in flows) > HALF_DIGITS:
        names, known = ["time", *names], [np.column_stack([f, w]) for f, w in zip(flows, known, strict=True)]
    neutral = [Neutral(name, _right_error(factors, known, j)) for j, name in enumerate(names)]
    energies = [found.energy_gradient(i) for i in range(k)]
    error = _left_error(factors, energies)
    if error <= SAME_STATE:
        neutral.append(Neutral("energy", error))
        known = [np.column_stack([w, e]) for w, e in zip(known, energies, strict=True)]
    return periodic_eigenvalues(on_quotient(factors, known)), tuple(neutral)


def _right_error(factors: Sequence[Array], known: Sequence[Array], j: int) -> float:
    """Return the largest relative distance of M_i w_i from the span of the known directions at the next node."""
    errors = [0.0]
    for M, here, there in zip(factors, known, [*known[1:], known[0]], strict=True):
        image = M @ here[:, j]
        rest = image - there @ np.linalg.lstsq(there, image, rcond=None)[0]
        errors.append(float(np.linalg.norm(rest) / np.linalg.norm(here[:, j])))
    return max(errors)


def _left_error(factors: Sequence[Array], rows: Sequence[Array]) -> float:
    """Return the largest relative distance of e_i+1 M_i from e_i; 1 for rows that vanish."""
    if not all(row.any() for row in rows):
        return 1.0
    triples = zip(factors, rows, [*rows[1:], rows[0]], strict=True)
    return max(float(np.linalg.norm(b @ M - a) / np.linalg.norm(a)) for M, a, b in triples)
