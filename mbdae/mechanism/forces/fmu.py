"""FMUs of other programs as sampled controllers: motors, valves, controllers (FMI 2.0 and 3.0, co-simulation)."""

from collections.abc import Sequence
from functools import cached_property, partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import pinocchio as pin
from pydantic import Field

from ...discovery import lazy_import
from ...errors import InputError, StepError, UnknownNameError
from ..allowed_paths import AllowedPaths
from ..fmu.interface import fmu_interface
from ..fmu.session import FmuSession, kept_states
from ..key_units import Unit
from ..tree.coordinate_units import model_suffixes
from ..tree.frames import find_joint, joint_names
from .force import Array, Force
from .sampled import SampledElement

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism

SIGNALS = "mbdae.solution.signal_value"
OF_Y = ("t", "y", "angle")  # kinds of signals that need no kinematics


class FMU(Force):
    """A motor, valve or controller of another program: an FMU for co-simulation (FMI 2.0 or 3.0), driven by FMPy.

        x_k+1 = F(x_k, u_k),   tau_k = H(x_k, u_k),   u_k = signals at t_k,   tau = tau_k for t_k <= t < t_k+1

    At each instant t_k = offset + k step the FMU steps from t_k-1 to t_k with its inputs held, takes the signals of
    the mechanism, and its outputs act on the joints until the next instant. It starts at the first instant of a run;
    before, its outputs are zero. Its units are converted from and to SI units. Runs go forwards only, and have no
    derivatives; a run continues from another one if the FMU can save its state.

    Attributes:
        file: the FMU, ``"motor.fmu"``, within the folder of the mechanism file.
        step: communication step in s.
        inputs: its inputs, each a signal of the mechanism (`mbdae.Solution.signals`) or a constant number in SI units,
            also in files with other units.
        outputs: its outputs, each acting on a joint of one velocity, or on a velocity ``"ball.wx"`` of another one,
            in N m or N.
        parameters: its parameters and other values before the start, in its own units.
        offset: an instant in s.
        recorded: whether it belongs to a saved run, which has the outputs of the FMU, but does not run it again.
        name: for parameters, signals and messages; the kind and a number if omitted.

    Raises:
        InputError: for an unknown key or a wrong value; when a mechanism is created, for a missing file, a file that
            is no FMU for co-simulation on this platform, or missing FMPy.
        UnknownNameError: when a mechanism is created, for an unknown joint, signal or variable of the FMU.
    """

    kind: Literal["fmu"] = "fmu"
    file: str
    step: Annotated[float, Unit("s")] = Field(gt=0)
    inputs: Annotated[dict[str, str | float], Unit("1")] = Field(default_factory=dict)
    outputs: dict[str, str] = Field(min_length=1)
    parameters: Annotated[dict[str, float | bool | str], Unit("1")] = Field(default_factory=dict)
    offset: Annotated[float, Unit("s")] = 0.0
    recorded: bool = False

    def bind(self, model: pin.Model, data: pin.Data) -> "FmuElement":
        if not self.recorded:
            found = fmu_interface(Path(self.file))
            for what, names in (("input", self.inputs), ("output", self.outputs), ("parameter", self.parameters)):
                for name in names:
                    found.find(what, name)
            for name, x in self.parameters.items():
                if not found.parameters[name].accepts(x):
                    kind = found.parameters[name].type
                    raise InputError(f"parameter {name!r} of {self.name!r} is of type {kind}, got {x!r:.80}")
        known = velocity_indices(model)
        torques: dict[int, str] = {}
        for name, joint in self.outputs.items():
            if joint not in known:
                raise UnknownNameError(f"joint of output {name!r} of {self.name!r}", joint, known)
            if known[joint] in torques:
                raise InputError(f"two outputs of {self.name!r} act on {joint!r}")
            torques[known[joint]] = f"torque {joint}"
        return FmuElement(self, torques)

    def require_signals(self, mech: "Mechanism") -> None:
        """Require that its inputs are signals with values at a point.

        Raises:
            UnknownNameError, InputError: for others.
        """
        for name, signal in self.inputs.items():
            if signal == "work":
                raise InputError(f"input {name!r} of {self.name!r}: 'work' belongs to a run, not to a point")
            if isinstance(signal, str):
                lazy_import(SIGNALS, "find_point_signal")(mech, signal)

    def session(self) -> FmuSession:
        """Return the FMU before its start.

        Raises:
            StepError: if it belongs to a saved run.
        """
        if self.recorded:
            raise StepError("force", f"FMU {self.name!r} is not in the file: load the mechanism with it again")
        found, path = fmu_interface(Path(self.file)), Path(self.file)
        return FmuSession(self.name, path, found, self.step, self.parameters, [*self.inputs], [*self.outputs])


def velocity_indices(model: pin.Model) -> dict[str, int]:
    """Return the velocity indices of joints of one velocity, and of ``joint.component`` of others."""
    out: dict[str, int] = {}
    for name in joint_names(model):
        first = find_joint(model, name).idx_v
        out |= {f"{name}{suffix}": first + i for i, suffix in enumerate(model_suffixes(model, name)[1])}
    return out


def with_fmu_paths(forces: Sequence[Any], path: Path) -> tuple[Any, ...]:
    """Return the forces of a mechanism file with the paths of their FMUs, which are in its folder.

    Raises:
        InputError: for a missing file, or one elsewhere.
    """
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
    """The law of `FMU`: s = (its outputs (m,), the number of its state), see `mbdae.mechanism.fmu.session`."""

    external = True

    def __init__(self, spec: FMU, torques: dict[int, str]) -> None:
        super().__init__(spec.name, self._no_memory, 1 / spec.step, spec.offset, torques, {"state": 0.0})
        self.spec, self._session = spec, None
        self._system: Index2System | None = None  # that runs
        self._own: Index2System | None = None  # a workspace for signals

    _session: FmuSession | None

    def _no_memory(self, *point: Any) -> Any:
        raise NotImplementedError

    def attach(self, system: "Index2System") -> None:
        self._system, self._own = system, None
        vars(self).pop("_signals", None)

    def sampled(self, t: float, q: Array, v: Array, s: Array, at: slice) -> tuple[Array, Array]:
        """Return the outputs of the FMU, and the number of its state."""
        t = self.offset + round((t - self.offset) * self.rate) * self.spec.step
        inputs = self._inputs(t, np.concatenate([q, v, s, [np.nan]]))
        self._session = self._session or self.spec.session()
        found = self._session.sample(float(s[at][-1]), t, inputs)
        return np.array(found.outputs), np.array([found.number])

    def _inputs(self, t: float, y: Array) -> tuple[float, ...]:
        return tuple(x if isinstance(x, float) else self._value(x, t, y) for x in self._signals)

    @cached_property
    def _signals(self) -> list[Any]:
        """The signals of its inputs, or constant numbers."""
        assert self._system
        find = partial(lazy_import(SIGNALS, "find_point_signal"), self._system.mechanism)
        return [find(x) if isinstance(x, str) else float(x) for x in self.spec.inputs.values()]

    def _value(self, signal: Any, t: float, y: Array) -> float:
        of_y = signal.kind in OF_Y
        return self._value_of(None if of_y else self._workspace(), signal, t, y)  # type: ignore[no-any-return]

    @cached_property
    def _value_of(self) -> Any:
        return import_module(SIGNALS).value  # of a floor above

    def _workspace(self) -> "Index2System":
        """Return a workspace of Python in the mode of the run: the core cannot be called while it calls Python."""
        assert self._system
        if self._own is None:
            self._own = self._system.mechanism.system()
        if self._own.mode != self._system.mode:
            self._own.enter(self._system.mode)
        return self._own

    def save(self, s: Array) -> bytes | None:
        number = float(s[-1])
        if number == 0.0:
            return b""
        return self._session.save(number) if self._session else kept_states.find(number)

    def take(self) -> FmuSession | None:
        found, self._session = self._session, None
        return found

    def give(self, external: object) -> None:
        self._session = external if isinstance(external, FmuSession) else None
