"""Inputs of a mechanism: functions of time whose values are set while it is simulated, by a user or by FMUs."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ..errors import InputError, UnknownNameError
from ..system import Array
from .forces import FORCES
from .forces.fmu import fmu_by_input
from .time_functions.input_functions import Input, InputHistory, InputSetting, as_input, inputs_in, map_inputs
from .time_functions.time_function_base import BaseTimeFunction
from .variant import rebuilt

if TYPE_CHECKING:
    from .mechanism import Mechanism


def _source_with(source: Any, forces: Iterable[Any], drivers: Iterable[Any]) -> Any:
    """Return the source of a mechanism with its forces and drivers replaced; it keeps the meshes and parameters."""
    if not source:
        return source
    tables = {"force": [f for f in forces if isinstance(f, FORCES)], "driver": drivers}
    changed = {table: [x.model_dump(mode="json") for x in entries] for table, entries in tables.items()}
    return {**source, "file": {**source["file"], **changed}}


class Inputs:
    """Inputs of a mechanism, and a copy of it in which they can be set.

    Args:
        mechanism: the mechanism; without inputs in its forces and drivers it is not copied.
        settable: whether the user sets inputs; if not, inputs that no FMU sets remain constant.

    Attributes:
        original: the mechanism.
        mechanism: the copy, in which inputs can be set.
        original_inputs: inputs of the mechanism that the user sets, by name.
        user_inputs: the same inputs of the copy.
        fmu_inputs: inputs of the copy that outputs of FMUs set.
        rate_dependent: names of inputs whose rate enters the accelerations, which jump with it.

    Raises:
        InputError: for inputs of one name with different settings, or an input that makes the speed of a driver jump.
    """

    def __init__(self, mechanism: "Mechanism", settable: bool = True) -> None:
        self.original, self._fmu_by_input = mechanism, fmu_by_input(mechanism.forces)
        found = inputs_in([*mechanism.forces, *mechanism.drivers]) if settable or self._fmu_by_input else {}
        self.original_inputs = self._set_by_user(found) if settable else {}
        self.user_inputs = {name: x.settable_copy(i) for i, (name, x) in enumerate(self.original_inputs.items())}
        numbered = enumerate(self._fmu_by_input, len(self.user_inputs))
        self.fmu_inputs = {name: as_input(found[name]).settable_copy(i) for i, name in numbered}
        inputs = self.user_inputs | self.fmu_inputs
        self.mechanism = self.replaced(inputs) if inputs else mechanism
        self._laws = self.mechanism.bind_forces(self.mechanism.make_workspace())
        self.rate_dependent = self._rate_dependent()

    def _set_by_user(self, found: Mapping[str, object]) -> dict[str, Input]:
        """Return the inputs that the user sets; they must not make the speed of a driver jump."""
        for driver in self.original.drivers:
            driver.require_continuous()
        return {name: x for name, x in found.items() if isinstance(x, Input) and name not in self._fmu_by_input}

    def _rate_dependent(self) -> set[str]:
        paths = [d.path for d in self.mechanism.drivers]
        in_laws = [u for law, _ in self._laws.bound for u in law.differentiated]
        return {u.name for u in [*paths, *in_laws] if isinstance(u, Input)}

    @classmethod
    def of_run(cls, problem: object) -> "Inputs | None":
        """Return the inputs that FMUs set during a run; None if there are none."""
        forces = getattr(problem, "forces", ())
        return cls(cast("Mechanism", problem), settable=False) if fmu_by_input(forces) else None

    def replaced(self, replaced: Mapping[str, BaseTimeFunction], m: "Mechanism | None" = None) -> "Mechanism":
        """Return the mechanism, or a variant of it, with functions of time in place of its inputs."""
        m = m or self.original
        return rebuilt(m, **self._with_inputs(replaced, m), source=None)

    def _with_inputs(self, replaced: Mapping[str, BaseTimeFunction], m: "Mechanism") -> dict[str, list[Any]]:
        """Return the forces and drivers of a mechanism with functions of time in place of its inputs."""

        def change(x: Input | InputHistory) -> BaseTimeFunction:
            return replaced.get(x.name, x) if isinstance(x, Input) or x.name in self._fmu_by_input else x

        return {name: [map_inputs(x, change) for x in getattr(m, name)] for name in ("forces", "drivers")}

    def user_input(self, name: str) -> Input:
        """Return an input of the copy that the user sets.

        Raises:
            InputError: for an input that an FMU sets.
            UnknownNameError: lists the inputs.
        """
        if name in self._fmu_by_input:
            raise InputError(f"input {name!r} is set by FMU {self._fmu_by_input[name]!r}")
        if name not in self.user_inputs:
            raise UnknownNameError("input", name, self.user_inputs)
        return self.user_inputs[name]

    @property
    def values(self) -> dict[str, InputSetting]:
        """Current setting of each input that the user sets."""
        return {name: x.setting for name, x in self.user_inputs.items()}

    def begin(self, s: Array | None) -> "Mechanism":
        """Return the copy; inputs that FMUs set have their values from the initial states s (ns,), if given."""
        m = self.mechanism
        if self.fmu_inputs:
            values = np.array([*m.states.values()]) if s is None else m.vector("s", s, len(m.states))
            self._laws.set_inputs(values)
        return m

    def recorded(self, t: Array, y: Array, by_user: Mapping[str, Iterable[InputSetting]] | None = None) -> "Mechanism":
        """Return the mechanism with inputs as functions of time.

        Args:
            t: nodes of a run in s, (n,).
            y: points at these nodes, (n, ...), which contain the settings by FMUs.
            by_user: settings by the user, by name of the input.
        """
        inputs, history = self.user_inputs | self.fmu_inputs, {**(by_user or {}), **self._history_set_by_fmus(t, y)}
        pieces = {name: tuple(map(tuple, settings)) for name, settings in history.items()}
        new = {name: InputHistory(name=name, pieces=x, hold=inputs[name].hold) for name, x in pieces.items()}
        m = self.original
        if not new:
            return m
        changed = self._with_inputs(new, m)
        source = _source_with(m.source, **changed)
        return rebuilt(m, **changed, source=source)

    def _history_set_by_fmus(self, t: Array, y: Array) -> dict[str, list[InputSetting]]:
        """Return the settings of inputs by FMUs, from the nodes t (n,) of a run and its points y (n, ...)."""
        history: dict[str, list[InputSetting]] = {name: [] for name in self.fmu_inputs}
        states = y[:, self.mechanism.nq + self.mechanism.nv : -1]
        for law, span in self._laws.bound if history else ():
            s = states[:, span]
            changed = np.flatnonzero((s[1:] != s[:-1]).any(axis=1)) + 1
            for i in (0, *changed.tolist()) if law.external else ():
                for name, x in law.input_settings(s[i]).items():
                    setting = InputSetting(float(t[i]), x.at(float(t[i])), x.rate)
                    if not history[name] or history[name][-1][1:] != setting[1:]:
                        history[name].append(setting)
        return history
