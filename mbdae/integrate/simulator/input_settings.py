"""Inputs of a simulator: values to apply in the next communication step, and the history of settings."""

from collections.abc import Mapping

from ...errors import InputError, is_number
from ...mechanism.inputs import Inputs
from ...mechanism.time_functions.input_functions import InputSetting


class InputSettings:
    """Inputs that were set since the last communication step, and all settings of inputs since the start.

    Args:
        inputs: the inputs of a mechanism.
        pending: inputs that were set, by name, since the last communication step.

    Attributes:
        history: the settings of each input, by name.
    """

    def __init__(self, inputs: Inputs, pending: Mapping[str, float] | None = None) -> None:
        self.inputs, self.pending = inputs, dict(pending or {})
        self.history = {name: [setting] for name, setting in inputs.values.items()}

    def value(self, name: str, t: float) -> float:
        """Return an input at time t.

        Raises:
            UnknownNameError: lists the inputs.
        """
        u = self.inputs.fmu_inputs.get(name) or self.inputs.user_input(name)
        return self.pending.get(name, u.at(t))

    def set(self, name: str, value: float) -> None:
        """Set an input for the next communication step.

        Raises:
            UnknownNameError: lists the inputs.
            InputError: for a value that is not a finite number.
        """
        self.inputs.user_input(name)
        if not is_number(value):
            raise InputError(f"input {name!r} must be a finite number, got {value!r}")
        self.pending[name] = float(value)

    def apply(self, t: float, dt: float) -> bool:
        """Apply the pending values over a communication step from t by dt; return whether an input jumps."""
        jumps = False
        for name, u in self.inputs.user_inputs.items():
            now = u.at(t)
            value = self.pending.get(name, now)
            setting = InputSetting(t, value) if u.hold == "zero" else InputSetting(t, now, (value - now) / dt)
            if setting[1:] != (now, u.setting.rate):
                rate_jumps = name in self.inputs.rate_dependent and setting.rate != u.setting.rate
                jumps |= setting.value != now or rate_jumps
                u.set(setting)
                history = self.history[name]
                if history[-1].t == t:
                    history.pop()
                history.append(setting)
        self.pending.clear()
        return jumps
