"""An FMU as a function of the number of its state: equal histories give equal numbers and outputs.

The state of an FMU is opaque, and a run may return to an earlier instant: the core delegates a jump to Python, a run
continues from the end of another run, or a simulator is reset. A number in s identifies the state at a point: it counts
the instants, and its fraction is a digest of the inputs at all instants; 0 is the state before the start. Saved states
are looked up by this number.
"""

import hashlib
import struct
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from pathlib import Path
from threading import Lock
from typing import NamedTuple

from ...errors import StepError
from ...tolerances import INPUT_DIGITS
from .instance import FmuInstance, Parameter
from .interface import FmuInterface

FRACTION_BITS = 32  # bits of the fraction of the number of a state, below 1/2
MAX_SAVED = 256  # saved states that a process keeps for runs that continue from other runs
HEADER = struct.Struct("<dd")  # number of a state, and its time
Values = tuple[float, ...]


class FmuSample(NamedTuple):
    """The outputs in SI units after an instant, and the number of the state."""

    outputs: Sequence[float]
    number: float


class SavedStates:
    """The latest saved states of all FMUs of the process, by number."""

    def __init__(self) -> None:
        self._states, self._lock = OrderedDict[float, bytes](), Lock()

    def store(self, states: Mapping[str, bytes]) -> None:
        """Store saved states.

        Raises:
            ValueError: for a state that is too short.
        """
        if any(len(state) <= HEADER.size for state in states.values()):
            raise ValueError("the state of an FMU is damaged")
        with self._lock:
            for state in states.values():
                number = HEADER.unpack_from(state)[0]
                self._states[number] = state
                self._states.move_to_end(number)
            while len(self._states) > MAX_SAVED:
                self._states.popitem(last=False)

    def find(self, number: float) -> bytes | None:
        """Return the saved state of a number."""
        return self._states.get(number)


saved_states = SavedStates()


class FmuSession:
    """A sampled FMU: it steps with constant inputs from one instant to the next.

    Args:
        name: name for messages.
        path: file of the FMU.
        description: description of the FMU.
        step: time in s from one instant to the next.
        parameters: values of parameters before the start.
        inputs: names of the inputs.
        outputs: names of the outputs.
    """

    def __init__(
        self,
        name: str,
        path: Path,
        description: FmuInterface,
        step: float,
        parameters: Mapping[str, Parameter],
        inputs: Sequence[str],
        outputs: Sequence[str],
    ) -> None:
        self.name, self.path, self.description, self.step = name, path, description, step
        self.parameters, self.inputs, self.outputs = parameters, inputs, outputs
        self._instance: FmuInstance | None = None
        self._number, self._t = 0.0, 0.0  # number and time of the state of the instance
        self._last: tuple[tuple[float, float, Values], FmuSample | StepError] | None = None
        origin = (description.token, step, sorted(parameters.items()), list(inputs), list(outputs))
        self._origin = hashlib.sha256(repr(origin).encode()).digest()

    def sample(self, number: float, t: float, inputs: Values) -> FmuSample:
        """Return the outputs at an instant, from which the inputs apply.

        Args:
            number: number of the previous state; 0 starts the FMU.
            t: the instant in s.
            inputs: inputs in SI units.

        Raises:
            StepError: if the FMU fails, or if its previous state is not available.
        """
        key = number, t, inputs
        if not (self._last and self._last[0] == key):  # Python repeats calls that the core delegates
            if number not in (0.0, self._number):
                self._restore(number)
            self._last = key, self._sample(key)
        found = self._last[1]
        if isinstance(found, StepError):
            raise found
        return found

    def _sample(self, key: tuple[float, float, Values]) -> FmuSample | StepError:
        number, t, inputs = key
        given = dict(zip(self.inputs, inputs, strict=True))
        try:
            if number == 0.0:
                self._start(t, given)
            else:
                self._continue(t)
            assert self._instance
            outputs = self._instance.exchange(given, self.outputs)
        except StepError as e:
            self.close()
            return e
        self._t, self._number = t, self._digest(key)
        return FmuSample(outputs, self._number)

    def _start(self, t: float, inputs: Mapping[str, float]) -> None:
        self.close()
        self._instance = FmuInstance(self.name, self.path, self.description)
        self._instance.start(t, self.parameters, inputs)

    def _continue(self, t: float) -> None:
        n = round((t - self._t) / self.step)
        if n < 1 or abs(t - self._t - n * self.step) > INPUT_DIGITS * n * self.step:
            before = f"its state belongs to t = {self._t:.9g} s"
            raise StepError("force", f"FMU {self.name!r} cannot continue at t = {t:.9g} s: {before}")
        assert self._instance
        for k in range(n):
            self._instance.step(self._t + k * self.step, self.step)

    def _restore(self, number: float) -> None:
        state = saved_states.find(number)
        if state is None:
            known = "begin at the start, or at the end of a run or a snapshot of a simulator"
            reason = "not kept" if self.description.can_save else "lost: it cannot be saved (canSerializeFMUState)"
            raise StepError("force", f"FMU {self.name!r}: its state at this point is {reason}; {known}")
        if self._instance is None:
            self._start(HEADER.unpack_from(state)[1], {})
        assert self._instance
        self._instance.restore(state[HEADER.size :])
        self._number, self._t = HEADER.unpack_from(state)

    def save(self, number: float) -> bytes | None:
        """Return the state of a number and store it; None if it is not the current state, or cannot be saved."""
        if number != self._number or not self._instance or not self.description.can_save:
            return saved_states.find(number)
        state = HEADER.pack(number, self._t) + self._instance.save()
        saved_states.store({self.name: state})
        return state

    def close(self) -> None:
        """Free the instance."""
        if self._instance:
            self._instance.free()
        self._instance, self._number = None, 0.0

    def _digest(self, key: tuple[float, float, Values]) -> float:
        number, t, inputs = key
        data = self._origin + struct.pack(f"<{2 + len(inputs)}d", number, t, *inputs)
        fraction = int.from_bytes(hashlib.sha256(data).digest()[: FRACTION_BITS // 8], "big") / 2 ** (FRACTION_BITS + 1)
        return float(int(number) + 1) + fraction
