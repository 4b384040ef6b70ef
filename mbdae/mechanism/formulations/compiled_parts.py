"""Closures, drivers, forces and thresholds as the plain numbers that the compiled core takes."""

from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING, Any

from scipy.interpolate import PPoly

from ...errors import MbdaeError
from .. import manifold, signals
from ..closures import independent_rows as rowmath
from ..closures.constraints import Constraints
from ..closures.driver import Driver
from ..forces import frame_forces
from ..forces.actuators import ActuatorLaw, MotorLaw, ResistanceLaw
from ..forces.controllers import PDLaw, PIDLaw, SampledLaw
from ..forces.frame_forces import BushingLaw, SpringDamperLaw, WrenchLaw
from ..forces.joint_forces import CurveLaw, DampingLaw, FrictionLaw, JointTorqueLaw, SpringLaw
from ..forces.law import Law, Laws, TorqueLaw
from ..frames import Anchor, Pair
from . import projection

if TYPE_CHECKING:
    from ..._native import Limits

Plain = dict[str, Any]


class NotCompiled(MbdaeError):
    """Names a part of a mechanism that the core does not have."""


def limits_of(native: ModuleType) -> "Limits":
    """Return all thresholds of points and steps; those of step-size control come with a run."""
    limits: Limits = native.Limits(
        largest_turn=manifold.LARGEST_TURN,
        bushing_turn=frame_forces.LARGEST_TURN,
        series=manifold.SERIES,
        series_end=manifold.SERIES_END,
        same_point=manifold.SAME_POINT,
        smallest_pivot=rowmath.SMALLEST_PIVOT,
        worst_conditioning=rowmath.WORST_CONDITIONING,
        grown=rowmath.GROWN,
        many=rowmath.MANY,
        reason=rowmath.REASON,
        probed=rowmath.PROBED,
        converged=rowmath.CONVERGED,
        spare=rowmath.SPARE,
        truncation=projection.TRUNCATION,
        rounding=projection.ROUNDING,
        open=projection.OPEN,
        stalled=projection.STALLED,
        iterations=projection.ITERATIONS,
    )
    return limits


def constraints_of(constraints: Constraints) -> tuple[list[Any], list[Plain], list[Plain]]:
    """Return pairs of frames, rows and drivers.

    Raises:
        NotCompiled: for rows that the core does not have.
    """
    pairs: list[Any] = []
    rows: list[Plain] = [{}] * constraints.ng
    for pair, kinds in constraints.frame_parts.values():
        for s, r, _ in kinds:
            rows[s] = found = [{"pair": len(pairs), **numbers} for numbers in r.plain()]
            if len(found) != r.m:
                raise NotCompiled(f"rows of kind {type(r).__name__}")
        pairs.append((_frame(pair.a), _frame(pair.b)))
    for part in constraints.joint_parts:
        rows[part.at] = part.plain()
    drivers = [{"row": at, "length": bool(d.frames), "motion": _motion(d)} for at, d in constraints.driven]
    return pairs, rows, drivers


def _frame(a: Anchor) -> tuple[int, list[float], list[float]]:
    return a.joint, a.R.ravel().tolist(), a.p.tolist()


def _motion(driver: Driver) -> Plain:
    if isinstance(driver.motion, signals.TimeTable):  # goes on at the ends' speed
        m = driver.motion
        return _pieces(signals.curve(m.points, m.interpolation, held=False))
    return _signal(driver.motion)


def _signal(s: Any) -> Plain:
    match s:
        case signals.Constant():
            return {"kind": "constant", "a": [s.value]}
        case signals.Harmonic():
            return {"kind": "harmonic", "a": [s.amplitude, s.omega, s.phase, s.offset]}
        case signals.Polynomial():
            return {"kind": "polynomial", "a": list(s.coefficients)}
        case signals.TimeTable():
            return _pieces(signals.curve(s.points, s.interpolation, held=True))
        case signals.Steps():
            return {"kind": "steps", "a": [y for _, y in s.points], "b": [x for x, _ in s.points]}
        case signals.Function():
            return {"kind": "python", "call": s.at}
    raise NotCompiled(f"functions of time of kind {type(s).__name__}")


def _pieces(c: PPoly) -> Plain:
    return {"kind": "pieces", "a": c.c.T.ravel().tolist(), "b": c.x.tolist(), "degree": len(c.c) - 1}


def laws_of(laws: Laws) -> tuple[list[Any], list[Plain]]:
    """Return pairs of frames and force laws.

    Raises:
        NotCompiled: for a law that the core does not have.
    """
    pairs: list[Any] = []
    out: list[Plain] = []
    states = [(law, slice(0, 0)) for law in laws.plain] + list(laws.stateful)
    for law, part in states:
        numbers = _law(law)
        pair: Pair | None = numbers.pop("frames", None)
        if pair is not None:
            numbers["pair"] = len(pairs)
            pairs.append((_frame(pair.a), _frame(pair.b)))
        out.append({**numbers, "state": part.start, "states": part.stop - part.start})
    return pairs, out


def _law(law: Any) -> Plain:
    if type(law) not in LAWS:
        raise NotCompiled(f"force {law.name!r} of kind {type(law).__name__}")
    return LAWS[type(law)](law)


def _damping(law: DampingLaw) -> Plain:
    return {"kind": "damping", "a": law.d.tolist()}


def _friction(law: FrictionLaw) -> Plain:
    return {"kind": "friction", "a": [*law.d.tolist(), law.v0]}


def _spring(law: SpringLaw) -> Plain:
    return {"kind": "spring", "iq": law.iq, "iv": law.iv, "a": [law.k, law.rest, law.damping]}


def _curve(law: CurveLaw) -> Plain:
    numbers = {"iq": law.iq, "iv": law.iv, "a": [0.0, law.rest, law.damping]}
    return {"kind": "curve", **numbers, "signals": [_pieces(law.c)]}


def _torque(law: JointTorqueLaw) -> Plain:
    return {"kind": "torque", "iv": [law.part.start], "a": [law.gear], "signals": [_signal(s) for s in law.values]}


def _pid(law: PDLaw | PIDLaw) -> Plain:
    spec, kind = law.spec, "pid" if isinstance(law, PIDLaw) else "pd"
    numbers = {"iq": [law.iq], "iv": [law.iv], "a": [spec.kp, spec.kd, spec.ki], "flag": spec.controls == "velocity"}
    return {"kind": kind, **numbers, "signals": [_signal(spec.reference)]}


def _resistance(law: ResistanceLaw) -> Plain:
    numbers = {"iv": [law.iv], "a": [law.k, law.spec.resistance]}
    return {"kind": "resistance", **numbers, "signals": [_signal(law.spec.voltage)]}


def _motor(law: MotorLaw) -> Plain:
    numbers = {"iv": [law.iv], "a": [law.k, law.spec.resistance, law.spec.inductance]}
    return {"kind": "motor", **numbers, "signals": [_signal(law.spec.voltage)]}


def _held(law: SampledLaw) -> Plain:
    return {"kind": "held", "iv": list(law.iv)}


def _spring_damper(law: SpringDamperLaw) -> Plain:
    s = law.spec
    numbers = {"frames": law.pair, "a": [s.stiffness, s.damping, s.length]}
    return {"kind": "spring_damper", **numbers, "signals": [_signal(s.force)]}


def _bushing(law: BushingLaw) -> Plain:
    numbers = {"frames": law.pair, "a": [*law.k, *law.kr, *law.d, *law.dr]}
    return {"kind": "bushing", **numbers, "flag": law.damped}


def _wrench(law: WrenchLaw) -> Plain:
    s = law.spec
    flags = {"flag": s.axes == "frame", "steady": law.steady}
    return {"kind": "wrench", "frames": law.pair, **flags, "signals": [_signal(x) for x in (*s.force, *s.torque)]}


def _python(law: TorqueLaw) -> Plain:
    return {"kind": "python", "call": lambda t, q, v: law.torque(t, q, v)[1]}


def _actuator(law: ActuatorLaw) -> Plain:
    return {"kind": "actuator", "call": law.evaluate}


LAWS: dict[type[Law], Callable[[Any], Plain]] = {
    DampingLaw: _damping,
    FrictionLaw: _friction,
    SpringLaw: _spring,
    CurveLaw: _curve,
    JointTorqueLaw: _torque,
    PDLaw: _pid,
    PIDLaw: _pid,
    ResistanceLaw: _resistance,
    MotorLaw: _motor,
    SampledLaw: _held,
    SpringDamperLaw: _spring_damper,
    BushingLaw: _bushing,
    WrenchLaw: _wrench,
    TorqueLaw: _python,
    ActuatorLaw: _actuator,
}
