"""Periodic motions of mechanisms, and their stability."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...errors import InputError, is_number
from ...mechanism import Mechanism, ModelSource
from ...mechanism.discrete_sensitivity.parameter_partials import Parameters
from ...solution.problem import mechanism_of
from ...solution.solution import Solution
from ...system import Array
from ...tolerances import SOLUTION_ROUNDING, VISIBLE
from .guess import guess_of, number_of_segments
from .motion import motion_of
from .period import has_period, is_autonomous
from .result import PeriodicMotion
from .returns import CycleStart, points_of, start_from_run
from .shooting.flow import Flow
from .shooting.newton import newton, require_motion
from .shooting.shooting_equations import Cycle, Guess, ShootingEquations

__all__ = ["periodic"]

METHOD, RTOL = "pherk6", SOLUTION_ROUNDING
GAP = 100.0  # ratio of the residual's tolerance to rtol: step-size control makes the shooting residual non-smooth


def periodic(
    model: Mechanism | Solution | ModelSource,
    T: float | None = None,
    *,
    q: Mapping[str, float] | Array | None = None,
    v: Mapping[str, float] | Array | None = None,
    s: Array | None = None,
    section: str | None = None,
    symmetry: Sequence[str] | None = None,
    exchange: Mapping[str, str] | None = None,
    segments: int | None = None,
    method: str | None = None,
    rtol: float = RTOL,
) -> PeriodicMotion:
    """Find a periodic motion near a state, and its Floquet multipliers.

        y(t + T) = g(sigma) y(t),   mu: eigenvalues of dy(T)/dy(0)

    Shooting by Newton's method with the exact tangents of the computed steps, in local coordinates of the constraint
    manifold. If forces or drivers depend on time, T is their period; otherwise it is an unknown.

    Args:
        model: a mechanism, an argument of `mbdae.load`; or a run that has nearly settled, whose end is the guess.
        T: period in s: fixed if the mechanism is driven, else an estimate. When left out: the period of functions of
            time, or of events at which the state jumps, or the time since a run last passed its final state; without a
            run as ``model``, over the duration of the model.
        q: guess of the configuration: joint = value, or (nq,); the model's start when left out.
        v: guess of the velocity: joint = value, or (nv,).
        s: guess of the states of forces, (ns,).
        section: signal and level at which a period begins and ends, ``"q.crank > 0.1"`` for rising crossings.
        symmetry: symmetries along which the motion advances in a period: ``"x"``, ``"y"``, ``"z"``, ``"incline"`` down
            inclined ground, ``"level"`` across it, ``"turn"`` about the direction of gravity, or names of joints with
            cyclic coordinates (``"x (joint)"`` for a joint named as a symmetry). When left out, all under which rows
            and accelerations are invariant.
        exchange: joints that are exchanged at the end of a period, joint = other joint, or ``"-"`` and a joint for the
            opposite sign: half a stride of a walker with two equal legs, half a swing of a pendulum.
        segments: number of segments of multiple shooting; for long or strongly unstable motions.
        method: method of the runs; pherk6, or the model's, when left out.
        rtol: relative tolerance of the runs.

    Raises:
        InputError: if no periodic motion is found, or for a motion without derivatives.
        UnknownNameError: for an unknown signal, joint, method or symmetry.
    """
    require_positive_period(T)
    number_of_segments(segments, section)
    mech = mechanism_of(model.mechanism if isinstance(model, Solution) else model, "periodic")
    flow = Flow(mech, Parameters(lambda values: mech, {}), run_options(mech, method, rtol))

    def motion_from(start: CycleStart) -> PeriodicMotion:
        guessed = guess_of(flow, start.y, start.T, start.t, section, start.symmetries, segments, exchange)
        return solve_from_guess(flow, guessed, rtol)

    if isinstance(model, Solution):
        return motion_from(start_from_run(model, T, symmetry))
    y, names = start_point(mech, q, v, s), None if symmetry is None else tuple(symmetry)
    unknown = T is None and not section and not mech.resets  # the end of a run of the model is a guess
    if unknown and is_autonomous(mech, 0.0, y):
        return motion_from(start_from_run(flow.run(0.0, y, mech.duration, None), None, names))
    try:
        return motion_from(CycleStart(0.0, y, T, names))
    except InputError:
        if not unknown or q is not None or v is not None:
            raise
    return motion_from(start_from_run(flow.run(0.0, y, mech.duration, None), None, names))


def run_options(mech: Mechanism, method: str | None, rtol: float) -> dict[str, Any]:
    """Return the options of the runs.

    Raises:
        InputError: for a tolerance that is not a positive number.
    """
    if not (is_number(rtol) and 0 < rtol < 1):
        raise InputError(f"rtol is a number between 0 and 1, got {rtol!r:.60}")
    return {"method": method or mech.settings.method or METHOD, "rtol": rtol}


def require_positive_period(T: float | None) -> None:
    """Reject a period that is not a positive number.

    Raises:
        InputError: for any other period.
    """
    if T is not None and not (is_number(T) and T > 0):
        raise InputError(f"the period T must be a positive number of seconds, got {T!r:.60}")


def start_point(mech: Mechanism, q: Any, v: Any, s: Array | None) -> Array:
    """Return the consistent point (q, v, s, 0) closest to a guess."""
    if isinstance(q, Mapping) or isinstance(v, Mapping):
        q, v = mech.assemble(q, v)
    return mech.point(q, v, s=s)


def solve_from_guess(flow: Flow, guessed: tuple[Cycle, Guess], rtol: float) -> PeriodicMotion:
    """Return the periodic motion close to a guess.

    Raises:
        InputError: if none is found.
    """
    cycle, guess = guessed
    found = newton(ShootingEquations(flow.mechanism.system(), flow, cycle, guess), GAP * rtol)
    require_motion(found)
    require_period_of_functions(found)
    found = newton(found.refine_steps(), GAP * rtol)
    require_second_period(found)
    return motion_of(found)


def require_period_of_functions(found: ShootingEquations) -> None:
    """Require that the equations of a motion without exchanged joints have its period, if they depend on time.

    Raises:
        InputError: if T, or the time between two crossings of a section, is not a period of the equations.
    """
    cycle, end = found.cycle, found.runs[-1]
    if cycle.autonomous or cycle.exchange:
        return
    T, points = float(end.t[-1]) - cycle.t, [p for run in found.runs for p in points_of(run)]
    if not has_period(found.flow.mechanism, T, points, found.guess.shifts):
        raise InputError(
            "no periodic motion found: forces, drivers or controllers depend on time, and do not repeat themselves"
            f" after {T:.6g} s: give a period of theirs, T, and no section"
        )


def require_second_period(found: ShootingEquations) -> None:
    """Require that a motion whose joints were exchanged at the end of a period returns to its start after the next one.

    Raises:
        InputError: if the exchange is not a symmetry of the mechanism.
    """
    P, mech = found.cycle.exchange, found.flow.mechanism
    if not P:
        return
    middle = found.runs[-1]
    t = float(middle.t[-1])
    second = found.flow.run(t, middle.y[-1], t - found.cycle.t, None)
    q0, q1, q2 = found.guess.nodes[0][: mech.nq], middle.q[-1], second.q[-1]
    steps = [mech.manifold.difference(P.apply(b), a) / mech.coordinate_scales for a, b in ((q0, q1), (q1, q2))]
    if np.abs(steps[1] - steps[0]).max() > VISIBLE:
        raise InputError("the exchange of joints is not a symmetry: the motion does not continue with exchanged joints")
