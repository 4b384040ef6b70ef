"""Inputs of a simulator with perturbations, for sensitivities over a communication step."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pydantic import PrivateAttr

from .input_functions import Input
from .time_function_base import BaseTimeFunction


@dataclass
class CommunicationStep:
    """The last communication step: its start and its size in s."""

    start: float = 0.0
    size: float = 1.0


class PerturbedInput(BaseTimeFunction):
    """The input of a simulator over its last communication step, perturbed.

        u(t) = u + du_1                                               hold = "zero"
        u(t) = u_0 + du_0 + (u_1 + du_1 - u_0 - du_0) (t - t_0)/dt     hold = "first"

    Attributes:
        du_0: perturbation at the start of the step; unused for hold = "zero".
        du_1: perturbation of the value set for the step; with hold = "first", at its end.
    """

    du_0: float = 0.0
    du_1: float = 0.0
    _at: Callable[..., float] = PrivateAttr()

    @classmethod
    def of(cls, source: Input, step: CommunicationStep, du_0: float, du_1: float) -> "PerturbedInput":
        """Return the perturbed input of a simulator."""
        out, nominal, linear = cls(du_0=du_0, du_1=du_1), source.at, source.hold == "first"

        def at(t: float, k: int = 0) -> float:
            if not linear:
                return nominal(t, k) + (0.0 if k else du_1)
            rate = (du_1 - du_0) / step.size
            return nominal(t, k) + (du_0 + rate * (t - step.start), rate, 0.0)[k]

        out._at = at
        return out

    def at(self, t: float, k: int = 0) -> float:
        return self._at(t, k)

    def core_data(self) -> dict[str, Any]:
        return {"kind": "python", "call": self._at}
