"""Drivers: rheonomic constraints by which a joint, a coupling or a distance follows a given function of time.

A driver is one row 0 = g(t, q) = c(q) - u(t), with c a joint coordinate, the left side of a coupling or a distance.
Hence g_t = -u', g_tt = -u'' and g_tq = 0. Its multiplier is the driving torque (N m) or force (N), its power lam u'.
A speed driver prescribes u' only: its row c' - u' has no g, and the value of c follows from the motion.
"""

from collections.abc import Callable, Sequence
from functools import cached_property
from math import inf, isinf, sqrt
from typing import Annotated, Any, TypedDict, Unpack, get_args

from pydantic import Field, model_validator

from ...errors import InputError, StepError
from ...tolerances import COINCIDENT, THREE_DIGITS
from ..checked_table import Table
from ..key_units import Unit, UnitSymbols
from ..time_functions.input_functions import Input
from ..time_functions.piecewise_polynomial import Extrapolation, PiecewisePolynomial
from ..time_functions.time_functions import Function, Harmonic, Motion, Polynomial, Steps, TimeFunction, TimeTable
from .joint_rows import Coordinate
from .rows import Distance, FrameRows

SAMPLES = 64  # times of a run at which derivatives are compared with difference quotients
MIN_MISMATCHES = 2  # smallest number of samples: one may coincide with a jump of u''
GOLDEN = (sqrt(5) - 1) / 2  # golden ratio minus 1: its multiples modulo 1 are evenly distributed and on no regular grid
SPACING, START_OFFSET = 1e-5, 1e-3  # s: half width of the quotients, and distance of their centre from the start
Target = str | tuple[str, str]


class Options(TypedDict, total=False):
    """Optional keys of a driver."""

    coefficients: tuple[float, ...]
    name: str


class Driver(Table):
    """A driver: a joint, coupling or distance, and the function of time u(t) that it follows.

    Motions are functions of time with two derivatives: constant, harmonic, polynomial (constant speed w from u_0 on:
    coefficients u_0, w), table (a cubic spline; u''' jumps at its points, which limits the order of methods to 3), or
    Python functions. Speeds are functions of time with one derivative, or steps; each step is an impact that satisfies
    all closures.

    A table of motion is not defined outside its times: a run ends there, unless the table has ``beyond``: ``"hold"``
    (then u' = 0 at both ends, a clamped spline, since a stop at a nonzero speed would be an impact), ``"linear"`` or
    ``"periodic"``.

    Attributes:
        motion: u(t), in rad or m; or
        speed: the rate u'(t), in rad/s or m/s.
        joint: name of a joint of one coordinate, q_joint = u; or
        joints: names of joints i and j, with ``coefficients``: q_i - c_0 - c_1 q_j - c_2 q_j^2 - ... = u; or
        frames: names of two frames with the distance u > 0 between their origins.
        coefficients: c_0, c_1, ... for ``joints``.
        name: name of the driver; by default the names above and "driver".

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint or frame.
    """

    motion: Annotated[Motion | None, Unit("q")] = None
    speed: Annotated[TimeFunction | None, Unit("q/s")] = None
    joint: str | None = None
    joints: tuple[str, str] | None = None
    frames: tuple[str, str] | None = None
    coefficients: Annotated[tuple[float, ...] | None, Unit("q", powers_of="q1")] = Field(default=None, min_length=2)
    name: str = ""

    def unit_symbols(self) -> UnitSymbols:
        return {"q": "m"} if self.frames else {}

    @model_validator(mode="after")
    def _check_target(self) -> "Driver":
        targets = [t for t in (self.joint, self.joints, self.frames) if t is not None]
        if len(targets) != 1:
            raise ValueError("a driver needs one of joint, joints and frames")
        if (self.joints is None) != (self.coefficients is None):
            raise ValueError("a driver of joints needs coefficients, and no other driver takes them")
        names = self.between
        if len(set(names)) < len(names):
            raise ValueError(f"a driver joins {names[0]!r} with itself")
        if not self.name:
            object.__setattr__(self, "name", "-".join(names) + " driver")
        return self

    @model_validator(mode="after")
    def _check_motion(self) -> "Driver":
        m, speed = self.motion, self.speed
        if (m is None) == (speed is None):
            raise ValueError("a driver needs one of motion and speed")
        if isinstance(m, Steps):
            raise ValueError("a driver cannot follow steps of motion, which needs two derivatives; a speed may step")
        if isinstance(speed, Function) and speed.function and not speed.rate:
            raise ValueError(f"the speed {speed.name!r} needs a rate: difference quotients reduce the order")
        if isinstance(m, Function) and m.function and not (m.rate and m.acceleration):
            raise ValueError(f"the motion {m.name!r} needs rate and acceleration: differences reduce the order")
        return self

    @property
    def between(self) -> tuple[str, ...]:
        """Names of the driven joints or frames."""
        return (self.joint,) if self.joint else self.joints or self.frames or ()

    @property
    def m(self) -> int:
        """Number of rows: 1."""
        return 1

    def primitives(self) -> Sequence[FrameRows] | Sequence[Coordinate]:
        """The row c(q), without u(t)."""
        if self.frames:
            return [Distance(0.0)]
        joint, other = self.joints or (self.joint or "", "")
        return [Coordinate(joint, other, self.coefficients or ())]

    @cached_property
    def path(self) -> PiecewisePolynomial | TimeFunction:
        """The function of time u(t), or the speed u'(t) of a speed driver."""
        return self.motion.motion if isinstance(self.motion, TimeTable) else self._given

    @cached_property
    def span(self) -> tuple[float, float]:
        """First and last time at which u is defined: those of a table of motion without ``beyond``."""
        if isinstance(self.motion, TimeTable) and self.motion.beyond is None:
            return self.motion.points[0][0], self.motion.points[-1][0]
        return -inf, inf

    def require_continuous(self) -> None:
        """Reject an input that makes the speed jump when it is set during a run.

        Raises:
            InputError: for a motion, whose speed would jump with its rate, or a speed that jumps: both are impacts.
        """
        u = self._given
        if isinstance(u, Input) and (self.speed is None or u.hold != "first"):
            what = "motion" if self.speed is None else "speed"
            use = "a driver follows an input as its speed, with hold = 'first'"
            raise InputError(f"driver {self.name!r}: input {u.name!r} makes its {what} jump, an impact: {use}")

    def outside(self, t: float) -> str:
        """Return a message if u is not defined at time t, up to rounding; otherwise an empty string."""
        (first, last), tolerance = self.span, COINCIDENT * (self.span[1] - self.span[0])
        if isinf(tolerance) or first - tolerance <= t <= last + tolerance:
            return ""
        known = ", ".join(map(repr, get_args(Extrapolation)))
        return f"the table of driver {self.name!r} is known from t = {first:g} to {last:g} s only; give beyond: {known}"

    def nonsmooth_times(self) -> Sequence[float]:
        """Return the times at which the highest derivative in use jumps: u'', or the rate of a speed."""
        return self.path.nonsmooth_times

    @property
    def _given(self) -> Any:
        return self.motion if self.speed is None else self.speed

    def follow(self, t: float) -> tuple[float, float, float]:
        """Return u (0 for a speed driver), its first and its second derivative at time t.

        Raises:
            StepError: outside a table without ``beyond``.
        """
        if message := self.outside(t):
            raise StepError("driver", f"{message}, got t = {t:.17g}")
        if self.speed is not None:
            return 0.0, self.path.at(t), self.path.at(t, 1)
        return self.path.at(t), self.path.at(t, 1), self.path.at(t, 2)

    def third_derivative(self, t: float) -> float:
        """Return the third derivative of u at time t."""
        return float(self.path.derivative(t, 3 if self.speed is None else 2))

    def check(self, t: float) -> None:
        """Compare the derivatives of Python functions with difference quotients just after t.

        Raises:
            InputError: if one of them is inconsistent.
        """
        if isinstance(self._given, Function) and (mismatch := self._mismatch(t + START_OFFSET)):
            raise InputError(mismatch)

    def check_run(self, t0: float, t1: float) -> None:
        """Compare the derivatives of Python functions with difference quotients at 64 times between t0 and t1.

        Raises:
            StepError: if one of them is inconsistent at two times or more; the first is named.
        """
        length = abs(t1 - t0) - 2 * SPACING
        if not isinstance(self._given, Function) or length <= 0:
            return
        first = min(t0, t1) + SPACING
        times = sorted(first + length * (k * GOLDEN % 1.0) for k in range(1, SAMPLES + 1))
        mismatches = [mismatch for mismatch in map(self._mismatch, times) if mismatch]
        if len(mismatches) >= MIN_MISMATCHES:
            raise StepError("driver", mismatches[0])

    def _mismatch(self, t: float) -> str:
        """Return a message if a derivative is inconsistent with its function at t; empty otherwise."""
        before, current, after = self.follow(t - SPACING), self.follow(t), self.follow(t + SPACING)
        given = ((0, "rate"), (1, "acceleration")) if self.speed is None else ((1, "rate"),)
        for k, what in given:
            quotient = (after[k] - before[k]) / (2 * SPACING)
            if abs(quotient - current[k + 1]) > THREE_DIGITS * (1 + abs(quotient)):
                return (
                    f"the {what} of driver {self.name!r} is {current[k + 1]:.6g} at t = {t:g} s, "
                    f"but its function's derivative is {quotient:.6g}"
                )
        return ""

    @classmethod
    def at_speed(cls, target: Target, rate: float, *, start: float = 0.0, **more: Unpack[Options]) -> "Driver":
        """Constant speed: u = start + rate t.

        Args:
            target: a joint; a pair of frames whose distance is driven; or, with ``coefficients``, a pair of joints.
            rate: u', in rad/s or m/s.
            start: u at t = 0, in rad or m.
            **more: coefficients, name.
        """
        return cls(motion=Polynomial(coefficients=(start, rate)), **_target(target, more))

    @classmethod
    def harmonic(
        cls,
        target: Target,
        amplitude: float,
        omega: float,
        *,
        phase: float = 0.0,
        offset: float = 0.0,
        **more: Unpack[Options],
    ) -> "Driver":
        """Oscillation u = offset + amplitude sin(omega t + phase), omega in rad/s; target as for `at_speed`."""
        motion = Harmonic(amplitude=amplitude, omega=omega, phase=phase, offset=offset)
        return cls(motion=motion, **_target(target, more))

    @classmethod
    def polynomial(cls, target: Target, coefficients_of_t: Sequence[float], **more: Unpack[Options]) -> "Driver":
        """Polynomial u = c_0 + c_1 t + c_2 t^2 + ...; target as for `at_speed`."""
        return cls(motion=Polynomial(coefficients=tuple(coefficients_of_t)), **_target(target, more))

    @classmethod
    def table(
        cls,
        target: Target,
        points: Sequence[tuple[float, float]],
        *,
        beyond: Extrapolation | None = None,
        **more: Unpack[Options],
    ) -> "Driver":
        """A cubic spline through points (t, u), and its ``beyond`` option; target as for `at_speed`."""
        rows = tuple((float(t), float(u)) for t, u in points)
        return cls(motion=TimeTable(points=rows, beyond=beyond), **_target(target, more))

    @classmethod
    def function(
        cls,
        target: Target,
        u: Callable[[float], float],
        rate: Callable[[float], float],
        acceleration: Callable[[float], float],
        **more: Unpack[Options],
    ) -> "Driver":
        """Python functions of t: u, u' and u''; target as for `at_speed`.

        Both derivatives are required because difference quotients would reduce the order of the methods. They are
        compared with difference quotients at the start and at 64 times of a finished run.
        """
        motion = Function(function=u, rate=rate, acceleration=acceleration)
        return cls(motion=motion, **_target(target, more))


def _target(target: Target, more: Options) -> dict[str, Any]:
    if isinstance(target, str):
        return {"joint": target, **more}
    return {"joints" if "coefficients" in more else "frames": tuple(target), **more}
