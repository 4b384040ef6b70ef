"""PD, PI and PID controllers on a joint, continuous or sampled."""

from typing import Annotated, Literal

import numpy as np
import pinocchio as pin
from pydantic import Field, model_validator

from ..key_units import Unit, UnitSymbols
from ..time_functions.time_functions import Constant, Function, TimeFunction
from .force import Array, Force, ForceElement, single_coordinate_joints, single_velocity_joint
from .linear import LinearElement, Term
from .sampled import Sample, SampledElement


class JointPID(Force):
    """A controller on a joint: tau = kp e + ki s + kd e',   s' = e,   e = reference(t) - q.

    Without ki it is a PD controller and has no state. With ``controls = "velocity"`` e = reference(t) - v, and kd is
    zero. With a ``rate`` it is sampled: tau is constant between the instants k/rate, and s increases by e/rate at each.

    Attributes:
        joint: a joint of one coordinate.
        reference: set point in rad, m, rad/s or m/s, a constant or a function of time.
        kp: proportional gain.
        ki: integral gain.
        kd: derivative gain.
        controls: ``"position"`` or ``"velocity"``.
        rate: sampling rate in Hz; continuous if omitted.
        integral: initial value of s.
        name: name in parameters, signals and messages; the kind and a number if omitted.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint or frame.
    """

    kind: Literal["joint_pid"] = "joint_pid"
    joint: str
    reference: Annotated[TimeFunction, Unit("r")] = Constant(value=0.0)
    kp: Annotated[float, Unit("e/r")] = 0.0
    ki: Annotated[float, Unit("e/r/s")] = 0.0
    kd: Annotated[float, Unit("e s/r")] = 0.0
    controls: Literal["position", "velocity"] = "position"
    rate: Annotated[float | None, Unit("Hz")] = Field(default=None, gt=0)
    integral: Annotated[float, Unit("r s")] = 0.0

    @model_validator(mode="after")
    def _check_keys(self) -> "JointPID":
        if self.controls == "velocity" and self.kd:
            raise ValueError("kd belongs to a joint_pid that controls the position")
        if self.integral and not self.ki:
            raise ValueError("integral belongs to a joint_pid with ki")
        r = self.reference
        if self.kd and isinstance(r, Function) and r.function is not None and r.rate is None:
            raise ValueError(f"kd needs the rate of {r.name!r}: give mbdae.Function(function=..., rate=...)")
        return self

    def unit_symbols(self) -> UnitSymbols:
        return {"r": "q" if self.controls == "position" else "q/s"}

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:
        what = f"joint_pid {self.name!r} that controls the {self.controls}"
        if self.controls == "position":
            j = single_coordinate_joints(model, self.joint, what)[0]
            i, x, ix, core_index = j.idx_v, "q", j.idx_q, j.idx_q
        else:
            j = single_velocity_joint(model, self.joint, what)
            i, x, ix, core_index = j.idx_v, "v", j.idx_v, model.nq + j.idx_v
        if self.rate is not None:
            memory = {"integral": self.integral} if self.ki else {}
            sample = self._sampled(ix, i, 1 / self.rate)
            core = {"kind": "pid", "reference": self.reference.core_data(), "a": [self.kp, self.ki, self.kd]}
            core |= {"x": core_index, "v": model.nq + i}
            names = {i: f"torque {self.joint}"}
            return SampledElement(self.name, sample, self.rate, 0.0, names, memory, core, [self.reference])
        terms: list[Term] = [("tau", i, "u", 0, self.kp), ("tau", i, x, ix, -self.kp)]
        terms += [("tau", i, "du", 0, self.kd), ("tau", i, "v", i, -self.kd)]
        if not self.ki:
            return LinearElement(self.name, terms, time_functions=[self.reference])
        terms += [("tau", i, "s", 0, self.ki), ("ds", 0, "u", 0, 1.0), ("ds", 0, x, ix, -1.0)]
        return LinearElement(self.name, terms, time_functions=[self.reference], states={"integral": self.integral})

    def _sampled(self, ix: int, iv: int, period: float) -> Sample:
        def sample(t: float, q: Array, v: Array, s: Array) -> tuple[Array, Array]:
            e = self.reference.at(t) - float((q if self.controls == "position" else v)[ix])
            derivative = self.kd and self.kd * (self.reference.at(t, 1) - float(v[iv]))
            return np.array([self.kp * e + derivative + self.ki * s.sum()]), s + e * period

        return sample
