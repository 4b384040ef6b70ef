"""Inputs of a mechanism that outputs of FMUs set."""

from typing import NamedTuple

from ..time_functions.input_functions import Input, InputSetting
from .force import Array, CoreData


class HeldInput(NamedTuple):
    """An input that an output of an FMU sets; the states s of the law contain its setting, t_k second to last.

    Attributes:
        input: the input.
        value: index of its value.
        rate: index of its rate; None for a zero-order hold.
    """

    input: Input
    value: int
    rate: int | None

    def setting(self, s: Array) -> InputSetting:
        """Return the setting from the states."""
        if self.rate is None:
            return InputSetting(0.0, float(s[self.value]))
        return InputSetting(float(s[-2]), float(s[self.value]), float(s[self.rate]))

    def set_output(self, output: float, t: float, step: float, before: Array, after: Array) -> None:
        """Set the input to an output: at once, or linearly until the end of the step that begins at t."""
        if self.rate is None:
            after[self.value] = output
        else:
            u = self.setting(before).at(t)
            after[self.value], after[self.rate], after[-2] = u, (output - u) / step, t

    def core_data(self, at: slice) -> CoreData:
        """Return the core data; the states of the law are s[at]."""
        first = self.rate is not None
        rate, instant = (at.start + self.value + 1, at.stop - 2) if first else (-1, -1)
        return {"input": self.input.index, "value": at.start + self.value, "rate": rate, "instant": instant}
