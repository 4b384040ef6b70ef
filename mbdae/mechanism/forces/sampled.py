"""Sampled (discrete-time) controllers.

A sampled controller is evaluated at the instants t_k = offset + k/rate; its torque is constant until the next one
(zero-order hold). The torque and the memory of the controller are states with s' = 0 that jump at these instants, so
rejected steps evaluate it only once, and the state determines all of the following motion.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import floor, ulp
from typing import Any

import numpy as np
import pinocchio as pin

from ...callbacks import call_with_views, checked_value, function_name
from ...errors import InputError, StepError, as_list
from ...tolerances import INPUT_DIGITS
from ..time_functions.time_functions import TimeFunction
from ..tree.frames import find_joints, joint_names
from .force import Array, CoreData, PythonForce, distinct_joints, start_values
from .linear import LinearElement, Term

Sample = Callable[[float, Array, Array, Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Sampled(PythonForce):
    """A controller in Python, sampled at a rate, with constant torque between samples (zero-order hold).

        without memory:  tau = function(t, q, v)             with memory:  tau, x_next = function(t, q, v, x)

    A run that does not start at a sampling instant has zero torque until the first one. Runs go forwards only.

    Args:
        function: returns tau (m,), one value for each coordinate of the joints, and the next memory (n,) if it has one.
        rate: sampling rate in Hz.
        joints: names of the actuated joints; all if omitted.
        memory: names and initial values of the discrete states; none if omitted.
        offset: a sampling instant in s.
        name: the name of the function if omitted.

    Raises:
        InputError: for a rate that is not positive, no joint, or one that is listed twice.

    Example:
        >>> hold = Sampled(lambda t, q, v: -5 * v, rate=100, name="brake")   # doctest: +SKIP
    """

    function: Callable[..., Any]
    rate: float
    joints: str | Sequence[str] | None = None
    memory: Mapping[str, float] = field(default_factory=dict)
    offset: float = 0.0
    name: str = ""

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", function_name(self.function))
        object.__setattr__(self, "memory", start_values(self.name, self.memory))
        if self.joints is not None:
            names = tuple(as_list(self.joints, f"joints of controller {self.name!r} are names"))
            object.__setattr__(self, "joints", distinct_joints(names, context=f"controller {self.name!r}: "))
        if not (0 < self.rate < np.inf and np.isfinite(self.offset)):
            raise InputError(f"controller {self.name!r} needs a rate > 0 in Hz, got {self.rate}, offset {self.offset}")

    def bind(self, model: pin.Model, data: pin.Data) -> "SampledElement":
        """Return the law bound to a workspace."""
        names = joint_names(model) if self.joints is None else list(self.joints)
        torque_names: dict[int, str] = {}
        for j, name in zip(find_joints(model, names), names, strict=True):
            for i in range(j.nv):
                torque_names[j.idx_v + i] = f"torque {name}" if j.nv == 1 else f"torque {name} {i}"
        return SampledElement(self.name, self._sample, self.rate, self.offset, torque_names, self.memory)

    def _sample(self, t: float, q: Array, v: Array, x: Array) -> tuple[Array, Array]:
        what = f"controller {self.name!r}"
        if not self.memory:
            return call_with_views(what, self.function, t, q, v), x
        out = call_with_views(what, self.function, t, q, v, x)
        if not (isinstance(out, tuple) and len(out) == 2):
            raise StepError("force", f"{what} with a memory returns (tau, x_next), got {out!r:.80}, at t = {t:.17g}")
        return out


class SampledElement(LinearElement):
    """A sampled torque: s = (tau (m,), memory (n,)), s' = 0, with jumps at the instants offset + k/rate.

    Args:
        name: name of the controller.
        sample: returns tau and the next memory.
        rate: sampling rate in Hz.
        offset: a sampling instant in s.
        torque_names: names of the torques by the index of their velocity.
        memory: names and initial values.
        core: core data of the controller; the core calls Python if omitted.
        references: functions of time that it evaluates at the sampling instants.
    """

    def __init__(
        self,
        name: str,
        sample: Sample,
        rate: float,
        offset: float,
        torque_names: dict[int, str],
        memory: Mapping[str, float],
        core: CoreData | None = None,
        references: Sequence[TimeFunction] = (),
    ) -> None:
        terms: list[Term] = [("tau", i, "s", k, 1.0) for k, i in enumerate(torque_names)]
        super().__init__(name, terms, states={**dict.fromkeys(torque_names.values(), 0.0), **memory})
        self.sample, self.rate, self.offset, self.m = sample, rate, offset, len(torque_names)
        self.core, self.references = core, references

    def breakpoint(self, t: float, sign: float) -> float:
        """Return the next sampling instant.

        Raises:
            InputError: for a run backwards in time.
        """
        if sign < 0:
            raise InputError(f"controller {self.name!r} is sampled: a run with it cannot go backwards in time")
        return self.offset + (floor((t - self.offset) * self.rate + INPUT_DIGITS) + 1) / self.rate

    def sampler(self, at: slice) -> CoreData:
        """Return the core data; its states are s[at]."""
        core = self.core or {"kind": "python", "call": lambda t, q, v, s: self.jump(t, q, v, s, at)}
        data = {**core, "rate": self.rate, "offset": self.offset, "coincide": INPUT_DIGITS, "inputs": []}
        return data | {"state": at.start, "states": at.stop - at.start}

    def jump(self, t: float, q: Array, v: Array, s: Array, at: slice) -> Array:
        """Return the new torque and memory if t is a sampling instant."""
        k = (t - self.offset) * self.rate
        if abs(k - round(k)) > INPUT_DIGITS:
            return s[at]
        tau, x = self.sampled(t, q, v, s, at)
        what, memory = f"controller {self.name!r}", at.stop - at.start - self.m
        return np.concatenate(
            [checked_value(tau, (self.m,), t, what), checked_value(x, (memory,), t, f"{what}, its memory,")]
        )

    def has_jumped(self, t: float, late: float) -> bool:
        instant = self.offset + round((t - self.offset) * self.rate) / self.rate
        return t - instant > late * ulp(max(abs(t), abs(self.offset)))

    def sampled(self, t: float, q: Array, v: Array, s: Array, at: slice) -> tuple[Array, Array]:
        """Return the new torque and memory at a sampling instant; s has the states of all laws."""
        return self.sample(t, q, v, s[at][self.m :].copy())
