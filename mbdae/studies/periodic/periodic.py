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
from .shooting.cycle import Cycle, Guess, ShootingEquations
from .shooting.flow import Flow
from .shooting.newton import newton, require_motion

__all__ = ["periodic"]

METHOD, RTOL = "pherk6", SOLUTION_ROUNDING
GAP = 100.0  # multiple of rtol: residual of shooting, which step-size control makes uneven


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
    manifold. If forces or drivers depend on time, T is a period of theirs; otherwise it is found, too.

    Args:
        model: a mechanism, an argument of `mbdae.load`; or a run that has nearly settled, whose end is the guess.
        T: period in s: given if the mechanism is driven, else an estimate. When left out: the period of functions of
            time, or of events at which the state jumps, or the time since a run was last where it ends, which is that
            of the duration of the model.
        q: guess of the configuration: joint = value, or (nq,); the model's start when left out.
        v: guess of the velocity: joint = value, or (nv,).
        s: guess of the states of forces, (ns,).
        section: signal and level at which a period begins and ends, ``"q.crank > 0.1"`` for rising crossings.
        symmetry: along which the motion advances in a period: ``"x"``, ``"y"``, ``"z"``, ``"incline"`` down inclined
            ground, ``"level"`` across it, ``"turn"`` about the vertical, which is that of gravity, or names of joints
            on whose angles nothing depends (``"x (joint)"`` for a joint with one of the other names). When left out,
            all that rows and accelerations follow.
        exchange: joints that change places at the end of a period, joint = other joint, or ``"-"`` and a joint for the
            opposite sign: half a stride of a walker with two equal legs, half a swing of a pendulum.
        segments: number of segments of the period, shot separately; for long or strongly unstable motions.
        method: of the runs; pherk6, or the model's, when left out.
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
        kind = guess_of(flow, start.y, start.T, start.t, section, start.symmetries, segments, exchange)
        return converged(flow, kind, rtol)

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
        InputError: naming it.
    """
    if T is not None and not (is_number(T) and T > 0):
        raise InputError(f"the period T must be a positive number of seconds, got {T!r:.60}")


def start_point(mech: Mechanism, q: Any, v: Any, s: Array | None) -> Array:
    """Return the consistent point (q, v, s, 0) near a guess."""
    if isinstance(q, Mapping) or isinstance(v, Mapping):
        q, v = mech.assemble(q, v)
    return mech.point(q, v, s=s)


def converged(flow: Flow, kind: tuple[Cycle, Guess], rtol: float) -> PeriodicMotion:
    """Return the periodic motion near a guess.

    Raises:
        InputError: if none is found.
    """
    cycle, guess = kind
    found = newton(ShootingEquations(flow.mechanism.system(), flow, cycle, guess), GAP * rtol)
    require_motion(found)
    require_period_of_functions(found)
    found = newton(found.refined(), GAP * rtol)
    require_second_period(found)
    return motion_of(found)


def require_period_of_functions(found: ShootingEquations) -> None:
    """Require that the equations of a motion without exchanged joints have its period, if they depend on time.

    Raises:
        InputError: for a given T that is none, and the time between two crossings of a section.
    """
    cycle, end = found.cycle, found.runs[-1]
    if cycle.autonomous or cycle.exchange:
        return
    T, points = float(end.t[-1]) - cycle.t, [p for run in found.runs for p in points_of(run)]
    if not has_period(found.flow.mechanism, T, points, found.at.shifts):
        raise InputError(
            "no periodic motion found: forces, drivers or controllers depend on time, and do not repeat themselves"
            f" after {T:.6g} s: give a period of theirs, T, and no section"
        )


def require_second_period(found: ShootingEquations) -> None:
    """Require that a motion whose joints were exchanged at the end of a period is back after the next one.

    Raises:
        InputError: if the exchange is no symmetry of the mechanism.
    """
    P, mech = found.cycle.exchange, found.flow.mechanism
    if not P:
        return
    middle = found.runs[-1]
    t = float(middle.t[-1])
    again = found.flow.run(t, middle.y[-1], t - found.cycle.t, None)
    q0, q1, q2 = found.at.nodes[0][: mech.nq], middle.q[-1], again.q[-1]
    steps = [mech.manifold.difference(P.moved(b), a) / mech.coordinate_scales for a, b in ((q0, q1), (q1, q2))]
    if np.abs(steps[1] - steps[0]).max() > VISIBLE:
        raise InputError("the exchange of joints is no symmetry: the motion does not continue with exchanged joints")
