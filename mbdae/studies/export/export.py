"""Export of a mechanism as a Functional Mock-up Unit (FMI 3.0)."""

import hashlib
import json
import platform
import re
import sys
import zipfile
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ... import backend
from ...data_types import JsonObject
from ...errors import InputError, UnknownNameError, as_list, require
from ...file_io import atomic_write
from ...integrate.simulator.simulator import Simulator
from ...mechanism import Mechanism, ModelSource
from ...mechanism.equations.local_ode import max_coordinates
from ...mechanism.formulations.compiled_systems import CompiledSystem
from ...mechanism.hybrid.mode_point import AllRows, ModePoint
from ...solution.problem import mechanism_of
from ...solution.provenance import versions
from ...solution.signal_value import SignalValue, find_point_signal
from ...solution.signals import units
from ...system import Array
from ...tolerances import AGREEMENT
from .core_file import core_data, count_indicators, native_system, output_data, plain_json, require_exportable, run_data
from .model_description import KINDS, FmuDescription, Variable, event_indicators
from .parameter_partials import ParameterPartials, parameter_partials
from .picture import picture
from .source_files import source_files

__all__ = ["export"]

RUNTIME = "_native_fmi3.so"  # the core without Python, built with the core
PLATFORMS = {"linux": "linux", "darwin": "darwin"}
MACHINES = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}
DIAGRAM = "diagram.png"
SIMULATOR_SETTINGS = ("record", "restart", "events", "backend")
STATE_SIGNALS = ("t", "y", "angle")  # kinds of outputs that are functions of the state
DIFFERENTIABLE = (*STATE_SIGNALS, "rate", "lam", "force")


@dataclass(frozen=True)
class ExportedUnit:
    """An exported FMU.

    Attributes:
        path: the file.
        kinds: ``"cs"``, ``"me"``.
        inputs: names of its inputs.
        outputs: names of its outputs.
        parameters: names of its parameters.
        states: number of continuous states for model exchange.
        size: size of the file in bytes.
    """

    path: Path
    kinds: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    states: int
    size: int

    def __str__(self) -> str:
        rows = {"inputs": self.inputs, "outputs": self.outputs, "parameters": self.parameters}
        lines = [f"{self.path}: FMI 3.0, {' and '.join(KINDS[k] for k in self.kinds)}, {self.size / 1e6:.1f} MB"]
        lines += [f"  {name}: {', '.join(found)}" for name, found in rows.items() if found]
        return "\n".join([*lines, *([f"  states: {self.states}"] if "me" in self.kinds else [])])

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        lists = {"kinds": self.kinds, "inputs": self.inputs, "outputs": self.outputs, "parameters": self.parameters}
        found = {name: list(x) for name, x in lists.items()}
        return {"path": str(self.path), **found, "states": self.states, "size": self.size}


def export(
    mech: Mechanism | ModelSource,
    path: str | Path,
    *,
    kind: Sequence[str] = ("cs", "me"),
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    parameters: Sequence[str] = (),
    sources: bool = False,
    **settings: Any,
) -> ExportedUnit:
    """Write a mechanism as a Functional Mock-up Unit (FMI 3.0) for other simulation programs.

    Co-simulation takes the steps of `mbdae.Simulator`. Model exchange provides the equation x' = F(t, x, u) of
    `Mechanism.ode`, whose solutions satisfy the constraints to rounding; at the end of the range of its local
    coordinates, an event selects new ones. Impacts and changes of the mode are events; in a mode with fewer degrees of
    freedom, the surplus states remain zero. The file contains the compiled core and the data of the mechanism: it needs
    neither Python nor a compiler.

    Args:
        mech: a mechanism without resets and functions of Python.
        path: a file ``.fmu``.
        kind: ``"cs"`` for co-simulation, ``"me"`` for model exchange.
        inputs: names of inputs, see `mbdae.Input`; all of them if omitted.
        outputs: names of signals, see `mbdae.Solution.signals`; q and v of all joints if omitted. ``"work"`` is
            available in co-simulation only.
        parameters: dotted names of parameters, as in `mbdae.sensitivity`, on which the mechanism depends linearly; they
            are set before the initialization.
        sources: whether to add the sources of the runtime, for other platforms: C++17 without further libraries.
        **settings: settings of `mbdae.Simulator`: a half-explicit method, step, rtol, t, q, v and others.

    Raises:
        UnknownNameError: for an unknown kind, input, output or parameter.
        InputError: for a mechanism that cannot be exported, naming the element; for an input with the name of another
            variable; without a runtime or its sources.

    Example:
        >>> mbdae.export(mbdae.load("slider_crank"), "slider_crank.fmu", step=1e-3)   # doctest: +SKIP
    """
    mech = mechanism_of(mech, "export")
    for name in settings:
        if name in SIMULATOR_SETTINGS:
            raise InputError(f"export has no {name}: it is a setting of mbdae.Simulator alone")
    kinds, path, runtime = _checked_kinds(kind), _checked_path(path), _runtime()
    code = source_files(_identifier(path)) if sources else {}
    require_exportable(mech)
    simulator = Simulator(mech, record=False, backend="native", **settings)
    system: CompiledSystem = simulator._run.system  # type: ignore[assignment]
    user_inputs = simulator.inputs.user_inputs
    chosen = _checked_names("input", user_inputs if inputs is None else inputs, user_inputs)
    output_signals = _outputs(mech, outputs, kinds)

    def start_of(other: Mechanism) -> Array:
        started = Simulator(other, record=False, backend="native", **settings)
        return np.concatenate([started.mode, started.q, started.v, started.s])

    varied = _checked_names("parameter", parameters, None)
    partials = parameter_partials(simulator.inputs, varied, system.native, start_of)
    states = _states(mech, kinds)
    data = core_data(native_system(simulator.mechanism, system.native)) | run_data(simulator, system)
    by_rate = simulator.inputs.rate_dependent
    data["inputs"] = [
        {"value": x.setting.value, "linear": x.hold == "first", "by_rate": name in by_rate}
        for name, x in user_inputs.items()
    ]
    data["outputs"] = plain_json([output_data(mech, name, x) for name, x in output_signals.items()])
    data["parameters"] = [x.core_data() for x in partials.values()]
    dependent, indeterminate = _indeterminate_rows(simulator, system.mode)
    data |= {"states": states, "dependent": dependent, "indeterminate": sorted(indeterminate)}
    token = hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
    variables = _variables(mech, user_inputs, chosen, partials, output_signals, states)
    variables += event_indicators(1 + variables[-1].reference, count_indicators(data) if "me" in kinds else 0)
    _require_unique_names(variables)
    differentiable = all(x.kind in DIFFERENTIABLE and not indeterminate & {*x.rows} for x in output_signals.values())
    differentiable &= not system.closure_friction
    description = FmuDescription(
        mech.title,
        _identifier(path),
        token,
        kinds,
        variables,
        differentiable,
        simulator.options.step,
        simulator.start,
        simulator.start + mech.duration,
        versions()["mbdae"],
    )
    _write(path, description, json.dumps({"token": token, **data}), runtime, picture(mech), code)
    return ExportedUnit(path, kinds, tuple(chosen), tuple(output_signals), tuple(partials), states, path.stat().st_size)


def _checked_kinds(kind: Sequence[str]) -> tuple[str, ...]:
    kinds = _checked_names("kind", kind, KINDS)
    if not kinds:
        raise InputError(f"kind is one or both of {', '.join(KINDS)}")
    return tuple(kinds)


def _checked_path(path: str | Path) -> Path:
    if not isinstance(path, str | Path) or Path(path).suffix != ".fmu":
        raise InputError(f"an FMU is saved as .fmu, got {str(path)!r}")
    return Path(path)


def _checked_names(kind: str, names: Any, known: Mapping[str, object] | None) -> list[str]:
    listed = as_list(names, f"{kind}s are a list of names")
    for name in listed:
        require(name, str, f"{kind}s are a list of names")
        if known is not None and name not in known:
            raise UnknownNameError(kind, name, known)
    return list(dict.fromkeys(listed))


def _runtime() -> bytes:
    """Return the runtime of this platform.

    Raises:
        InputError: if it was not built.
    """
    core = backend.load()
    file = Path(core.__file__ or "").with_name(RUNTIME) if core else Path(RUNTIME)
    if core is None or not file.is_file():
        raise InputError("the runtime of exported mechanisms was not built: install mbdae with a C++17 compiler")
    return file.read_bytes()


def _outputs(mech: Mechanism, outputs: Sequence[str] | None, kinds: Sequence[str]) -> dict[str, SignalValue]:
    names = [n for n in units(mech) if n[:2] in ("q.", "v.")] if outputs is None else outputs
    if "me" in kinds and "work" in as_list(names, "outputs are a list of names"):
        raise InputError("output 'work' is integrated by the steps of co-simulation: export kind 'cs' alone")
    return {name: find_point_signal(mech, name) for name in _checked_names("output", names, None)}


def _states(mech: Mechanism, kinds: Sequence[str]) -> int:
    """Return the largest number of continuous states of all modes; 0 without model exchange.

    Raises:
        InputError: for a mechanism that has no ordinary differential equation in some mode.
    """
    return max_coordinates(mech) if "me" in kinds else 0


def _variables(
    mech: Mechanism,
    user_inputs: Mapping[str, Any],
    chosen: Sequence[str],
    partials: Mapping[str, ParameterPartials],
    output_signals: Mapping[str, SignalValue],
    states: int,
) -> list[Variable]:
    """Return all variables; value references follow the order of `mbdae/native/runtime/fmu_instance.hpp`."""
    known, out = units(mech), [Variable(0, "time", "independent", "s")]
    for i, (name, user_input) in enumerate(user_inputs.items()):
        if name in chosen:
            out.append(Variable(1 + i, name, "input", user_input.unit, user_input.setting.value))
    first = 1 + len(user_inputs)
    out += [Variable(first + i, name, "parameter", "", x.value) for i, (name, x) in enumerate(partials.items())]
    first += len(partials)
    for i, (name, x) in enumerate(output_signals.items()):
        out.append(Variable(first + i, name, "output", known[name], depends_on_states_only=x.kind in STATE_SIGNALS))
    first += len(output_signals)
    coordinate = "local coordinate of the constraint manifold: its origin moves at events"
    out += [Variable(first + i, f"local[{i + 1}]", "local", description=coordinate) for i in range(states)]
    out += [Variable(first + states + i, f"der(local[{i + 1}])", "local", derivative=first + i) for i in range(states)]
    return out


def _require_unique_names(variables: Sequence[Variable]) -> None:
    """Require unique names of variables, as FMI does: users choose the names of inputs.

    Raises:
        InputError: if two variables have the same name.
    """
    count = Counter(x.name for x in variables)
    for x in variables:
        if count[x.name] > 1 and x.causality in ("input", "parameter"):
            raise InputError(f"{x.causality} {x.name!r} has the name of another variable of the FMU: rename it")


def _indeterminate_rows(simulator: Simulator, mode: tuple[int, ...]) -> tuple[int, set[int]]:
    """Return the number of dependent rows at the start, and the rows whose multipliers are not unique."""
    with simulator.mechanism.workspaces.borrowed() as system:
        system.enter(mode)
        null = ModePoint(system, AllRows(system), simulator.start, simulator._run.ys[-1]).null_multipliers
    leverage = (null * null).sum(axis=1)  # 1 for a row without effect, such as the out-of-plane row of a planar loop
    return null.shape[1], {*np.flatnonzero((leverage > AGREEMENT) & (leverage < 1 - AGREEMENT)).tolist()}


def _identifier(path: Path) -> str:
    name = re.sub(r"\W", "_", path.stem, flags=re.ASCII)
    return name if name[:1].isalpha() or name[:1] == "_" else f"_{name}"


def _write(
    path: Path, description: FmuDescription, data: str, runtime: bytes, image: bytes, code: Mapping[str, bytes]
) -> None:
    system, machine = PLATFORMS.get(sys.platform, ""), MACHINES.get(platform.machine().lower(), "")
    if not system or not machine:
        raise InputError(f"FMUs are exported on Linux and macOS, not on {sys.platform} {platform.machine()}")
    suffix = ".dylib" if system == "darwin" else ".so"
    with atomic_write(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("modelDescription.xml", description.xml())
        file.writestr("documentation/index.html", description.page(DIAGRAM if image else ""))
        for name in (f"documentation/{DIAGRAM}", "model.png") if image else ():  # names of the standard and of FMPy
            file.writestr(name, image)
        file.writestr("resources/mechanism.json", data)
        file.writestr(f"binaries/{machine}-{system}/{description.identifier}{suffix}", runtime)
        for name, content in code.items():
            file.writestr(f"sources/{name}", content)
