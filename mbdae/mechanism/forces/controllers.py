"""Controllers: PD, PI and PID on a joint, continuous or sampled, and sampled controllers in Python.

A sampled controller looks at the mechanism at the instants t_k = offset + k/rate and holds its torque until the next
one. The held torque and the controller's memory are states with s' = 0 that jump at the instants: a rejected step
repeats nothing, and a state contains all that the motion from there depends on.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import floor
from typing import Any, Literal

import numpy as np
import pinocchio as pin
from pydantic import Field, model_validator

from ...errors import InputError, StepError
from ..callbacks import called, checked, function_name
from ..frames import find_joint, find_joints, joint_names
from ..signals import Constant, Function, Signal
from .actuators import start_values
from .joint_forces import Joints, single
from .law import Array, Force, Law, StateLaw

COINCIDE = 1e-6  # of a period: how near a time must be to count as a sampling instant
Sample = Callable[[float, Array, Array, Array], tuple[Array, Array]]


class JointPID(Force):
    """A controller on a joint: tau = kp e + ki s + kd e',   s' = e,   e = reference(t) - q.

    Without ki it is a PD controller and has no state. With ``controls = "velocity"`` e = reference(t) - v, and kd is
    zero. With a ``rate`` it is sampled: tau is held between the instants k/rate, and s grows by e/rate at each.

    Attributes:
        joint: a joint of one coordinate.
        reference: rad, m, rad/s or m/s; a constant or a function of time.
        kp: proportional gain.
        ki: gain of the integral.
        kd: gain of the error's rate.
        controls: ``"position"`` or ``"velocity"``.
        rate: sampling rate in Hz; continuous when left out.
        integral: s at the start.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is made, for a joint or frame that it does not have.
    """

    kind: Literal["joint_pid"] = "joint_pid"
    joint: str
    reference: Signal = Constant(value=0.0)
    kp: float = 0.0
    ki: float = 0.0
    kd: float = 0.0
    controls: Literal["position", "velocity"] = "position"
    rate: float | None = Field(default=None, gt=0)
    integral: float = 0.0

    @model_validator(mode="after")
    def _keys_fit(self) -> "JointPID":
        if self.controls == "velocity" and self.kd:
            raise ValueError("kd belongs to a joint_pid that controls the position")
        if self.integral and not self.ki:
            raise ValueError("integral belongs to a joint_pid with ki")
        r = self.reference
        if self.kd and isinstance(r, Function) and r.function is not None and r.rate is None:
            raise ValueError(f"kd needs the rate of {r.name!r}: give mbdae.Function(function=..., rate=...)")
        return self

    def bind(self, model: pin.Model, data: pin.Data) -> Law:  # noqa: D102
        if self.controls == "position":
            j = single(model, self.joint, "a joint_pid")[0]
        else:
            j = find_joint(model, self.joint)
            if j.nv != 1:
                raise InputError(f"a joint_pid needs a joint with one velocity; {self.joint!r} has {j.nv}")
        if self.rate is not None:
            memory = {"integral": self.integral} if self.ki else {}
            sample = self._sampled(j.idx_q, j.idx_v, 1 / self.rate)
            return SampledLaw(self.name, sample, self.rate, 0.0, [j.idx_v], [f"torque {self.joint}"], memory)
        return PIDLaw(self, j.idx_q, j.idx_v) if self.ki else PDLaw(self, j.idx_q, j.idx_v)

    def errors(self, t: float, x: float, v: float) -> tuple[float, float]:
        """Return e and the part kp e + kd e' of the torque at a joint's coordinate x and velocity v."""
        if self.controls == "velocity":
            e = self.reference.at(t) - v
            return e, self.kp * e
        e = self.reference.at(t) - x
        return e, self.kp * e + (self.kd * (self.reference.at(t, 1) - v) if self.kd else 0.0)

    def _sampled(self, iq: int, iv: int, period: float) -> Sample:
        def sample(t: float, q: Array, v: Array, x: Array) -> tuple[Array, Array]:
            e, tau = self.errors(t, float(q[iq]), float(v[iv]))
            return np.array([tau + self.ki * x.sum()]), x + e * period

        return sample


class PDLaw(Law):
    """The law of `JointPID` without an integral part."""

    def __init__(self, spec: JointPID, iq: int, iv: int) -> None:
        super().__init__(spec.name, [spec.reference])
        self.spec, self.iq, self.iv = spec, iq, iv

    def torque(self, t: float, q: Array, v: Array) -> tuple[float, Array]:  # noqa: D102
        tau = np.zeros_like(v)
        tau[self.iv] = self.spec.errors(t, float(q[self.iq]), float(v[self.iv]))[1]
        return 0.0, tau


class PIDLaw(StateLaw):
    """The law of `JointPID` with the integral of the error as its state."""

    def __init__(self, spec: JointPID, iq: int, iv: int) -> None:
        super().__init__(spec.name, [spec.reference])
        self.spec, self.iq, self.iv = spec, iq, iv
        self.states = {"integral": spec.integral}

    def evaluate(self, t: float, q: Array, v: Array, s: Array) -> tuple[Array, Array]:  # noqa: D102
        tau = np.zeros_like(v)
        e, tau[self.iv] = self.spec.errors(t, float(q[self.iq]), float(v[self.iv]))
        tau[self.iv] += self.spec.ki * s[0]
        return tau, np.array([e])


@dataclass(frozen=True)
class Sampled:
    """A controller that is sampled at a rate and holds its torque in between (zero-order hold), in Python.

        without memory:  tau = function(t, q, v)             with memory:  tau, x_next = function(t, q, v, x)

    A run that does not start at a sampling instant holds a torque of zero until the first one. Runs go forwards only.

    Args:
        function: returns tau (m,), one value for each coordinate of the joints, and the next memory (n,) if it has one.
        rate: samples per second in Hz.
        joints: names of the joints it drives; all when left out.
        memory: names of what it remembers from sample to sample, and the start values; none when left out.
        offset: a sampling instant in s.
        name: of the function when left out.

    Raises:
        InputError: for a rate that is not positive.

    Example:
        >>> hold = Sampled(lambda t, q, v: -5 * v, rate=100, name="brake")   # doctest: +SKIP
    """

    function: Callable[..., Any]
    rate: float
    joints: Joints = ()
    memory: Mapping[str, float] = field(default_factory=dict)
    offset: float = 0.0
    name: str = ""

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", function_name(self.function))
        object.__setattr__(self, "memory", start_values(self.name, self.memory))
        if not (0 < self.rate < np.inf and np.isfinite(self.offset)):
            raise InputError(f"controller {self.name!r} needs a rate > 0 in Hz, got {self.rate}, offset {self.offset}")

    def bind(self, model: pin.Model, data: pin.Data) -> "SampledLaw":
        """Return the law in a workspace."""
        names = [self.joints] if isinstance(self.joints, str) else list(self.joints) or joint_names(model)
        iv: list[int] = []
        held: list[str] = []
        for j, name in zip(find_joints(model, names), names, strict=True):
            iv += range(j.idx_v, j.idx_v + j.nv)
            held += [f"torque {name}" if j.nv == 1 else f"torque {name} {i}" for i in range(j.nv)]
        return SampledLaw(self.name, self._sample, self.rate, self.offset, iv, held, self.memory)

    def _sample(self, t: float, q: Array, v: Array, x: Array) -> tuple[Any, Any]:
        what = f"controller {self.name!r}"
        if not self.memory:
            return called(what, self.function, t, q, v), x
        out = called(what, self.function, t, q, v, x)
        if not (isinstance(out, tuple) and len(out) == 2):
            raise StepError("force", f"{what} with a memory returns (tau, x_next), got {out!r:.80}, at t = {t:.17g}")
        return out


class SampledLaw(StateLaw):
    """A held torque: s = (tau (m,), memory (n,)), s' = 0, jumps at the instants offset + k/rate."""

    def __init__(
        self,
        name: str,
        sample: Sample,
        rate: float,
        offset: float,
        iv: list[int],
        held: list[str],
        memory: Mapping[str, float],
    ) -> None:
        super().__init__(name)
        self.sample, self.rate, self.offset, self.iv, self.m = sample, rate, offset, iv, len(iv)
        self.states = {**dict.fromkeys(held, 0.0), **memory}

    def evaluate(self, t: float, q: Array, v: Array, s: Array) -> tuple[Array, Array]:  # noqa: D102
        tau = np.zeros_like(v)
        tau[self.iv] = s[: self.m]
        return tau, np.zeros_like(s)

    def breakpoint(self, t: float, sign: float) -> float:
        """Return the next sampling instant.

        Raises:
            InputError: backwards in time.
        """
        if sign < 0:
            raise InputError(f"controller {self.name!r} is sampled: a run with it cannot go backwards in time")
        return self.offset + (floor((t - self.offset) * self.rate + COINCIDE) + 1) / self.rate

    def jump(self, t: float, q: Array, v: Array, s: Array) -> Array:
        """Return the new torque and memory if t is a sampling instant."""
        k = (t - self.offset) * self.rate
        if abs(k - round(k)) > COINCIDE:
            return s
        tau, x = self.sample(t, q, v, s[self.m :].copy())
        what = f"controller {self.name!r}"
        return np.concatenate(
            [checked(tau, (self.m,), t, what), checked(x, (len(s) - self.m,), t, f"{what}, its memory,")]
        )
