"""Inputs of a simulator with perturbations, for the derivatives of an advance."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pydantic import PrivateAttr

from .input_functions import Input
from .time_function_base import BaseTimeFunction


@dataclass
class AdvanceSpan:
    """The last advance: its start and its length in s."""

    start: float = 0.0
    length: float = 1.0


class PerturbedInput(BaseTimeFunction):
    """The input of a simulator over its last advance, perturbed.

        u(t) = u + end                                                            hold = "zero"
        u(t) = u_0 + begin + (u_1 + end - u_0 - begin) (t - t_0)/dt               hold = "first"

    Attributes:
        begin: perturbation at the start of the advance; unused for hold = "zero".
        end: perturbation of the value set for the advance; with hold = "first", at the end of the advance.
    """

    begin: float = 0.0
    end: float = 0.0
    _at: Callable[..., float] = PrivateAttr()

    @classmethod
    def of(cls, source: Input, span: AdvanceSpan, begin: float, end: float) -> "PerturbedInput":
        """Return the perturbed input of a simulator."""
        out, nominal, linear = cls(begin=begin, end=end), source.at, source.hold == "first"

        def at(t: float, k: int = 0) -> float:
            if not linear:
                return nominal(t, k) + (0.0 if k else end)
            rate = (end - begin) / span.length
            return nominal(t, k) + (begin + rate * (t - span.start), rate, 0.0)[k]

        out._at = at
        return out

    def at(self, t: float, k: int = 0) -> float:
        return self._at(t, k)

    def core_data(self) -> dict[str, Any]:
        return {"kind": "python", "call": self._at}
