"""FMUs of other programs as sampled controllers: motors, valves, controllers (FMI 2.0 and 3.0, co-simulation)."""

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property, partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import pinocchio as pin
from pydantic import Field, PrivateAttr

from ...discovery import lazy_import
from ...errors import InputError, StepError, UnknownNameError
from ..allowed_paths import AllowedPaths
from ..fmu.interface import FmuInterface, fmu_interface
from ..fmu.session import FmuSession, saved_states
from ..key_units import Unit
from ..time_functions.input_functions import Input, InputSetting
from ..tree.coordinate_units import model_suffixes
from ..tree.frames import find_joint, joint_names
from .force import Array, CoreData, Force
from .held_input import HeldInput
from .sampled import SampledElement

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism

SIGNALS = "mbdae.solution.signal_value"
STATE_SIGNALS = ("t", "y", "angle")  # kinds of signals that need no kinematics


class FMU(Force):
    """A motor, valve or controller of another program: an FMU for co-simulation (FMI 2.0 or 3.0), driven by FMPy.

        x_k+1 = F(x_k, u_k),   tau_k = H(x_k, u_k),   u_k = signals at t_k,   tau = tau_k for t_k <= t < t_k+1

    At each instant t_k = offset + k step the FMU steps from t_k-1 to t_k with its inputs held, samples the signals of
    the mechanism, and its outputs act on the joints until the next instant. It starts at the first instant of a run;
    before that, its outputs are zero and inputs have their start values. Its units are converted to and from SI units.
    Runs go forwards only and are not differentiable; a run can continue another one if the FMU can save its state.

    An output that sets an input u (`mbdae.Input`) holds it: u(t) = u_k. With ``hold = "first"`` it is the value at the
    next instant: u is continuous, with u' = (u_k - u(t_k)) / step, so that it may be the speed of a driver.

    Attributes:
        file: the FMU, ``"motor.fmu"``, within the folder of the mechanism file.
        step: communication step in s.
        inputs: inputs of the FMU, each a signal of the mechanism (`mbdae.Solution.signals`) or a constant number in SI
            units, also in files with other units.
        outputs: outputs of the FMU, each acting on a joint of one velocity, or on a velocity ``"ball.wx"`` of another
            one, in N m or N, or setting an input of the mechanism, in its unit.
        parameters: parameters of the FMU and other values set before the start, in the units of the FMU.
        offset: a communication instant in s.
        recorded: whether it belongs to a saved run, which contains the outputs of the FMU but does not run it.
        name: name in parameters, signals and messages; the kind and a number if omitted.

    Raises:
        InputError: for an unknown key or a wrong value; when a mechanism is created, for a missing file, a file that
            is not an FMU for co-simulation on this platform, or missing FMPy.
        UnknownNameError: when a mechanism is created, for an unknown joint, input, signal or variable of the FMU.
    """

    kind: Literal["fmu"] = "fmu"
    file: str
    step: Annotated[float, Unit("s")] = Field(gt=0)
    inputs: Annotated[dict[str, str | float], Unit("1")] = Field(default_factory=dict)
    outputs: dict[str, str] = Field(min_length=1)
    parameters: Annotated[dict[str, float | bool | str], Unit("1")] = Field(default_factory=dict)
    offset: Annotated[float, Unit("s")] = 0.0
    recorded: bool = False
    _inputs: Mapping[str, Input] = PrivateAttr(default_factory=dict)  # inputs of the mechanism

    def with_inputs(self, inputs: Mapping[str, Input]) -> "FMU":
        """Return a copy with the inputs of its mechanism, which its outputs may set."""
        out = self.model_copy()
        out._inputs = inputs
        return out

    @property
    def set_inputs(self) -> dict[str, Input]:
        """The inputs of the mechanism that its outputs set, by the names of the outputs."""
        return {name: self._inputs[x] for name, x in self.outputs.items() if x in self._inputs}

    def bind(self, model: pin.Model, data: pin.Data) -> "FmuElement":
        if not self.recorded:
            self._require_variables(fmu_interface(Path(self.file)))
        known, inputs = velocity_indices(model), self._inputs
        torques: dict[int, str] = {}
        for name, target in self.outputs.items():
            what = f"output {name!r} of {self.name!r}"
            if target in known and target in inputs:
                raise InputError(f"{what}: {target!r} is a joint and an input, which needs another name")
            if target in inputs:
                continue
            if target not in known:
                raise UnknownNameError(f"joint or input of {what}", target, [*known, *inputs])
            if known[target] in torques:
                raise InputError(f"two outputs of {self.name!r} act on {target!r}")
            torques[known[target]] = f"torque {target}"
        return FmuElement(self, torques, self.set_inputs)

    def _require_variables(self, found: FmuInterface) -> None:
        """Check that the FMU has the named variables, and that the parameters match their types."""
        for what, names in (("input", self.inputs), ("output", self.outputs), ("parameter", self.parameters)):
            for name in names:
                found.find(what, name)
        for name, x in self.parameters.items():
            if not found.parameters[name].accepts(x):
                kind = found.parameters[name].type
                raise InputError(f"parameter {name!r} of {self.name!r} is of type {kind}, got {x!r:.80}")

    def require_signals(self, mech: "Mechanism") -> None:
        """Check that its inputs are signals with values at a point.

        Raises:
            UnknownNameError, InputError: for any other input.
        """
        for name, signal in self.inputs.items():
            if signal == "work":
                raise InputError(f"input {name!r} of {self.name!r}: 'work' belongs to a run, not to a point")
            if isinstance(signal, str):
                lazy_import(SIGNALS, "find_point_signal")(mech, signal)

    def session(self, outputs: Sequence[str]) -> FmuSession:
        """Return a new session of the FMU, not yet started.

        Args:
            outputs: names of its outputs in the order of its samples.

        Raises:
            StepError: if it belongs to a saved run.
        """
        if self.recorded:
            raise StepError("force", f"FMU {self.name!r} is not in the file: load the mechanism with it again")
        found, path = fmu_interface(Path(self.file)), Path(self.file)
        return FmuSession(self.name, path, found, self.step, self.parameters, [*self.inputs], outputs)


def velocity_indices(model: pin.Model) -> dict[str, int]:
    """Return the velocity indices of joints of one velocity, and of ``joint.component`` of others."""
    out: dict[str, int] = {}
    for name in joint_names(model):
        first = find_joint(model, name).idx_v
        out |= {f"{name}{suffix}": first + i for i, suffix in enumerate(model_suffixes(model, name)[1])}
    return out


def fmu_by_input(forces: Iterable[object]) -> dict[str, str]:
    """Return the name of the FMU that sets an input, by the name of the input.

    Raises:
        InputError: for an input that two outputs set.
    """
    found: dict[str, str] = {}
    for fmu in (x for x in forces if isinstance(x, FMU)):
        for u in fmu.set_inputs.values():
            if u.name in found:
                raise InputError(f"input {u.name!r} is set by an output of {found[u.name]!r} and of {fmu.name!r}")
            found[u.name] = fmu.name
    return found


def with_fmu_paths(forces: Sequence[Any], path: Path) -> tuple[Any, ...]:
    """Return the forces of a mechanism file with the paths of their FMUs, which are in its folder.

    Raises:
        InputError: for a missing file, or a file outside the folder.
    """
    if not any(isinstance(x, FMU) for x in forces):
        return tuple(forces)
    paths = AllowedPaths.from_model_file(path)

    def found(x: Any) -> Any:
        if not isinstance(x, FMU) or x.recorded:
            return x
        try:
            return x.model_copy(update={"file": str(paths.find(x.file))})
        except InputError as e:
            raise InputError(f"{x.name or x.kind}.file: {e}") from None

    return tuple(map(found, forces))


class FmuElement(SampledElement):
    """The law of `FMU`: s = (torques (m,), inputs that it sets, the last instant, the number of its saved state).

    The instant, and a rate after each value, are states only for inputs with a first-order hold. See
    `mbdae.mechanism.fmu.session` for the number.

    Args:
        spec: the FMU.
        torques: names of the torques by the index of their velocity.
        inputs: inputs of the mechanism by the outputs that set them.
    """

    external = True

    def __init__(self, spec: FMU, torques: dict[int, str], inputs: Mapping[str, Input]) -> None:
        memory: dict[str, float] = {}
        self.held: list[HeldInput] = []
        for x in inputs.values():
            first, value = x.hold == "first", len(torques) + len(memory)
            memory |= {f"input {x.name}": x.value} | ({f"rate {x.name}": 0.0} if first else {})
            self.held.append(HeldInput(x, value, value + 1 if first else None))
        memory |= {"instant": 0.0} if any(x.rate is not None for x in self.held) else {}
        super().__init__(spec.name, self._unused_sample, 1 / spec.step, spec.offset, torques, {**memory, "state": 0.0})
        self._outputs = [name for name in spec.outputs if name not in inputs] + [*inputs]
        self.spec, self._session = spec, None
        self._system: Index2System | None = None  # workspace of the run
        self._signal_system: Index2System | None = None  # workspace to evaluate signals

    _session: FmuSession | None

    def _unused_sample(self, *point: Any) -> Any:
        raise NotImplementedError  # `sampled` replaces it

    def attach(self, system: "Index2System") -> None:
        self._system, self._signal_system = system, None
        vars(self).pop("_signals", None)

    def sampled(self, t: float, q: Array, v: Array, s: Array, at: slice) -> tuple[Array, Array]:
        """Return the torques, and the memory: inputs that it sets, and the number of the FMU's state."""
        assert self._system
        t = self.offset + round((t - self.offset) * self.rate) * self.spec.step
        self._system.laws.set_inputs(s, notify=False)  # the core cannot be called while it calls Python
        inputs = self._inputs(t, np.concatenate([q, v, s, [np.nan]]))
        self._session = self._session or self.spec.session(self._outputs)
        found = self._session.sample(float(s[at][-1]), t, inputs)
        before, after = s[at], s[at].copy()
        after[-1] = found.number
        for x, value in zip(self.held, found.outputs[self.m :], strict=True):
            x.set_output(value, t, self.spec.step, before, after)
        return np.array(found.outputs[: self.m]), after[self.m :]

    def input_settings(self, s: Array) -> dict[str, InputSetting]:
        """Return the settings of the inputs that it sets, by name, from its states."""
        return {x.input.name: x.setting(s) for x in self.held}

    def set_inputs(self, s: Array, notify: bool = True) -> None:
        for x in self.held:
            x.input.set(x.setting(s), notify)

    def sampler(self, at: slice) -> CoreData:
        return super().sampler(at) | {"inputs": [x.core_data(at) for x in self.held if x.input.index >= 0]}

    def _inputs(self, t: float, y: Array) -> tuple[float, ...]:
        return tuple(x if isinstance(x, float) else self._evaluate(x, t, y) for x in self._signals)

    @cached_property
    def _signals(self) -> list[Any]:
        """The signals of its inputs, or constant numbers."""
        assert self._system
        find = partial(lazy_import(SIGNALS, "find_point_signal"), self._system.mechanism)
        return [find(x) if isinstance(x, str) else float(x) for x in self.spec.inputs.values()]

    def _evaluate(self, signal: Any, t: float, y: Array) -> float:
        workspace = None if signal.kind in STATE_SIGNALS else self._workspace()
        return self._signal_value(workspace, signal, t, y)  # type: ignore[no-any-return]

    @cached_property
    def _signal_value(self) -> Any:
        return import_module(SIGNALS).value  # in a higher layer: imported lazily to avoid a cycle

    def _workspace(self) -> "Index2System":
        """Return a Python workspace in the mode of the run: the core cannot be called while it calls Python."""
        assert self._system
        if self._signal_system is None:
            self._signal_system = self._system.mechanism.system("index2")
        if self._signal_system.mode != self._system.mode:
            self._signal_system.enter(self._system.mode)
        return self._signal_system

    def save(self, s: Array) -> bytes | None:
        number = float(s[-1])
        if number == 0.0:
            return b""
        return self._session.save(number) if self._session else saved_states.find(number)

    def detach_program(self) -> FmuSession | None:
        found, self._session = self._session, None
        return found

    def attach_program(self, program: object) -> None:
        self._session = program if isinstance(program, FmuSession) else None
