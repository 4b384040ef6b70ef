"""Values of a simulator's inputs: those that were set, and their history."""

from collections.abc import Mapping

from ...errors import InputError, is_number
from ...mechanism.inputs import Inputs
from ...mechanism.time_functions.input_functions import InputSetting


class InputSettings:
    """Inputs that were set since the last advance, and the settings of all inputs since the start.

    Args:
        inputs: the inputs of a mechanism.
        wanted: inputs that were set, by name, since the last advance.

    Attributes:
        history: the settings of each input, by name.
    """

    def __init__(self, inputs: Inputs, wanted: Mapping[str, float] | None = None) -> None:
        self.inputs, self.wanted = inputs, dict(wanted or {})
        self.history = {name: [setting] for name, setting in inputs.values.items()}

    def value(self, name: str, t: float) -> float:
        """Return an input at time t.

        Raises:
            UnknownNameError: lists the inputs.
        """
        cell = self.inputs.fmu_inputs.get(name) or self.inputs.user_input(name)
        return self.wanted.get(name, cell.at(t))

    def want(self, name: str, value: float) -> None:
        """Set an input for the next advance.

        Raises:
            UnknownNameError: lists the inputs.
            InputError: for a value that is not a finite number.
        """
        self.inputs.user_input(name)
        if not is_number(value):
            raise InputError(f"input {name!r} must be a finite number, got {value!r}")
        self.wanted[name] = float(value)

    def apply(self, t: float, dt: float) -> bool:
        """Let the inputs follow what was set, from t over dt; return whether one of them jumps."""
        jumps = False
        for name, cell in self.inputs.user_inputs.items():
            now = cell.at(t)
            value = self.wanted.get(name, now)
            setting = InputSetting(t, value) if cell.hold == "zero" else InputSetting(t, now, (value - now) / dt)
            if setting[1:] != (now, cell.setting.rate):
                rate_jumps = name in self.inputs.rate_dependent and setting.rate != cell.setting.rate
                jumps |= setting.value != now or rate_jumps
                cell.set(setting)
                history = self.history[name]
                if history[-1].t == t:
                    history.pop()
                history.append(setting)
        self.wanted.clear()
        return jumps
