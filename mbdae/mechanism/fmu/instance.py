"""An instance of an FMU for co-simulation, by FMPy."""

import os
import shutil
import tempfile
import weakref
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache, partial
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar

from ...errors import StepError
from .interface import INTEGERS, FmuInterface, FmuVariable, fmpy_module

T = TypeVar("T")
USED_ONCE = set[str]()  # tokens of FMUs that allow one instance per process and have one
LOADING = Lock()  # FMPy changes the working directory while it loads a library
Parameter = float | bool | str


class FmuInstance:
    """An instance, freed with the last reference to it.

    Args:
        name: name for messages.
        path: file of the FMU.
        description: description of the FMU.

    Raises:
        StepError: if it cannot be created; all methods raise it with the messages of the FMU.
    """

    def __init__(self, name: str, path: Path, description: FmuInterface) -> None:
        self.name, self.description, self._messages = name, description, list[str]()
        state = path.stat()
        folder = _folder(path.resolve(), state.st_mtime_ns, state.st_size)
        if description.once_per_process and description.token in USED_ONCE:
            reason = "it allows one instance per process, which another run or simulator has"
            raise StepError("force", f"FMU {name!r} cannot be instantiated: {reason}")
        self._fmu: Any = self._try("be instantiated", lambda: self._instantiated(folder))
        if description.once_per_process:
            USED_ONCE.add(description.token)
        self._finalizer = weakref.finalize(self, _free, self._fmu, description.token)

    def _instantiated(self, folder: str) -> Any:
        fmpy_module()
        import fmpy.fmi2 as fmi2
        import fmpy.fmi3 as fmi3

        d = self.description
        given = {"guid": d.token, "modelIdentifier": d.identifier, "unzipDirectory": folder, "instanceName": self.name}
        log = partial(_record, self._messages)
        with LOADING:
            working_directory = Path.cwd()
            try:
                if d.version == "3.0":
                    fmu: Any = fmi3.FMU3Slave(**given)
                    fmu.instantiate(logMessage=lambda of, status, category, text: log(status, text))
                    return fmu
                fmu = fmi2.FMU2Slave(**given)
                callbacks = fmi2.fmi2CallbackFunctions.from_buffer_copy(fmi2.defaultCallbacks)
                callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(lambda of, name, status, kind, text: log(status, text))
                fmu.instantiate(callbacks=callbacks)
            finally:
                os.chdir(working_directory)
        return fmu

    def start(self, t: float, parameters: Mapping[str, Parameter], inputs: Mapping[str, float]) -> None:
        """Initialize at time t in s."""

        def initialize() -> None:
            for name, x in parameters.items():
                self._set(self.description.find("parameter", name), x)
            if self.description.version == "2.0":
                self._fmu.setupExperiment(startTime=t)
                self._fmu.enterInitializationMode()
            else:
                self._fmu.enterInitializationMode(startTime=t)
            self._set_inputs(inputs)
            self._fmu.exitInitializationMode()

        self._try(f"initialize at t = {t:.9g} s", initialize)

    def step(self, t: float, h: float) -> None:
        """Step from t to t + h."""

        def step() -> None:
            found = self._fmu.doStep(t, h)
            _, ends, early, _ = found or (False, False, False, t + h)
            if ends or early:
                raise RuntimeError("it ends the simulation" if ends else "it returns before the end of the step")

        self._try(f"step from t = {t:.9g} s by {h:.9g} s", step)

    def exchange(self, inputs: Mapping[str, float], outputs: Sequence[str]) -> list[float]:
        """Set inputs, then return outputs, all in SI units."""

        def exchange() -> list[float]:
            self._set_inputs(inputs)
            variables = [self.description.find("output", name) for name in outputs]
            references = [x.reference for x in variables]
            get = self._fmu.getReal if self.description.version == "2.0" else self._fmu.getFloat64
            return [x.to_si(value) for x, value in zip(variables, get(references), strict=True)]

        return self._try("compute outputs", exchange)

    def save(self) -> bytes:
        """Return the state as bytes."""

        def serialize() -> bytes:
            state = self._fmu.getFMUState()
            try:
                return bytes(self._fmu.serializeFMUState(state))
            finally:
                self._fmu.freeFMUState(state)

        return self._try("save its state", serialize)

    def restore(self, data: bytes) -> None:
        """Restore a saved state."""

        def restore() -> None:
            state = self._fmu.deserializeFMUState(data)
            try:
                self._fmu.setFMUState(state)
            finally:
                self._fmu.freeFMUState(state)

        self._try("restore a state", restore)

    def _set_inputs(self, inputs: Mapping[str, float]) -> None:
        variables = [self.description.find("input", name) for name in inputs]
        values = [x.from_si(value) for x, value in zip(variables, inputs.values(), strict=True)]
        if variables:
            put = self._fmu.setReal if self.description.version == "2.0" else self._fmu.setFloat64
            put([x.reference for x in variables], values)

    def _set(self, variable: FmuVariable, value: Parameter) -> None:
        kind, number = variable.type, variable.type in INTEGERS
        fmi_type = "Int64" if self.description.version == "3.0" and kind == "Enumeration" else kind
        fmi_type = "Integer" if self.description.version == "2.0" and number else fmi_type
        getattr(self._fmu, f"set{fmi_type}")([variable.reference], [int(value) if number else value])

    def _try(self, what: str, action: Callable[[], T]) -> T:
        try:
            return action()
        except Exception as e:  # of FMPy, ctypes and the FMU
            messages = "; ".join(dict.fromkeys(self._messages)) or (str(e).splitlines() or [type(e).__name__])[0]
            raise StepError("force", f"FMU {self.name!r} cannot {what}: {messages}") from None
        finally:
            self._messages.clear()

    def free(self) -> None:
        """Free the instance now."""
        self._finalizer()


def _record(messages: list[str], status: int, text: bytes) -> None:
    """Record an error message."""
    if status > 1:
        messages.append(text.decode("utf-8", "replace").strip())


def _free(fmu: Any, token: str) -> None:
    with suppress(Exception):  # an FMU may reject this after an error
        fmu.terminate()
    with suppress(Exception):
        fmu.freeInstance()
    USED_ONCE.discard(token)


@lru_cache(maxsize=32)
def _folder(path: Path, *version: int) -> str:
    """Return a folder with the content of an FMU, which is removed when the process ends."""
    folder = tempfile.mkdtemp(prefix="mbdae-fmu-")
    weakref.finalize(_folder, shutil.rmtree, folder, ignore_errors=True)
    fmpy_module().extract(str(path), unzipdir=folder)
    return folder
