"""Core data of a mechanism for the runtime of FMUs, `mbdae/native/runtime`, which has no Python and no Pinocchio."""

from collections.abc import Iterator
from types import ModuleType
from typing import Any

import numpy as np

from ...data_types import CoreData, JsonObject
from ...errors import InputError, NotCompiled
from ...integrate.events.core_modes import modes_to_core
from ...integrate.events.multiplier_resolution import shortest_step
from ...integrate.run.run_state import RunState
from ...integrate.simulator.simulator import Simulator
from ...integrate.steppers.native import NativeStepper
from ...mechanism import Mechanism
from ...mechanism.equations import local_coordinates as chart
from ...mechanism.forces.force import ForceElement
from ...mechanism.forces.linear import Linear
from ...mechanism.forces.sampled import SampledElement
from ...mechanism.formulations.compiled_systems import CompiledSystem
from ...mechanism.formulations.core_description import core_tolerances, describe, samplers_of
from ...mechanism.formulations.equation_partials import GAMMA_WIDTH
from ...solution.signal_value import SignalValue
from ...tolerances import CLOSED

DERIVED = ("states", "transitions", "nodes", "row_changes", "after_jumps")  # attributes of structs that are not fields
RESTART_MARGIN = 0.5  # fraction of the range of local coordinates beyond which a new chart is selected


class _Recorder:
    """Substitute for the core that records the fields of a struct instead of constructing it."""

    def __getattr__(self, name: str) -> Any:
        return lambda **fields: {"struct": name, **fields}


def require_exportable(mech: Mechanism) -> None:
    """Reject a mechanism with resets, which only Python computes.

    Raises:
        InputError: names the resets.
    """
    if mech.resets:
        names = ", ".join(str(getattr(x, "name", x)) for x in mech.resets)
        raise InputError(f"{mech.title}: resets cannot be exported: {names}")


def core_data(system: CompiledSystem) -> JsonObject:
    """Return the data of the mechanism of a workspace from which the runtime constructs its core.

    Raises:
        InputError: for joints and functions that the runtime does not support, by name.
    """
    native, mech, friction = system.native, system.mechanism, system.closure_friction
    if not native.sweeps(system.model):
        kinds = sorted({joint.shortname() for joint in list(system.model.joints)[1:]})
        raise InputError(f"{mech.title}: the runtime does not support one of the joints {', '.join(kinds)}")
    try:
        description, samplers, interfaces = describe(system), samplers_of(system.laws), friction.core_data()
    except NotCompiled as e:
        raise InputError(f"{mech.title}: the core does not support {e}") from None
    data = {
        "tree": native.tree_data(system.model),
        "expanded": native.tree_data(system.inertial.model),
        "tolerances": _fields(core_tolerances(_Recorder(), mech), "Tolerances"),  # type: ignore[arg-type]
        "description": description,
        "samplers": samplers,
        "interfaces": interfaces,
        "friction_active": np.asarray(friction.active, int),
        "slip_directions": np.asarray(friction.slip_directions),
        "smallest_slip": float(friction.min_slip_speed),
    }
    _require_no_functions(mech, system, data)
    return plain_json(data)


def _fields(recorded: Any, struct: str) -> CoreData:
    """Return the recorded fields of a struct.

    Raises:
        InputError: for another struct.
    """
    if not isinstance(recorded, dict) or recorded.pop("struct") != struct:
        raise InputError("only half-explicit methods can be exported: herk, pherk, hedop, hem and custom tableaus")
    return recorded


def _require_no_functions(mech: Mechanism, system: CompiledSystem, data: CoreData) -> None:
    for path, x in _leaves(data):
        if callable(x):
            raise InputError(f"{mech.title}: {_owner(system, path)}, which cannot be exported")


def _owner(system: CompiledSystem, path: tuple[str, ...]) -> str:
    """Describe the element that a function in the data belongs to."""
    bound: list[ForceElement] = [law for law, _ in system.laws.bound]
    law: ForceElement
    if path[0] == "samplers":
        law = [x for x in bound if isinstance(x, SampledElement)][int(path[1])]
    elif path[1] == "laws":
        law = system.laws.acting[int(path[2])][0]
    else:
        return f"{' '.join(path[1:-1])} is a function of Python"
    if isinstance(law, Linear):  # of several forces
        signal = law.u[int(path[4])][0]
        law = next(x for x in bound if any(u is signal for u in x.time_functions))
    return f"force {law.name!r} is {'an FMU' if law.external else 'a function of Python'}"


def _leaves(data: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield all values in nested tables and lists, with their paths."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list | tuple) else None
    if items is None:
        yield path, data
        return
    for key, value in items:
        yield from _leaves(value, (*path, str(key)))


def values_by_path(data: CoreData) -> dict[tuple[str, ...], Any]:
    """Return all values in the data by their paths."""
    return dict(_leaves(data))


def plain_json(data: Any) -> Any:
    """Return nested data as JSON types; arrays become flat lists of numbers."""
    if isinstance(data, dict):
        return {key: plain_json(x) for key, x in data.items()}
    if isinstance(data, np.ndarray):
        return data.ravel().tolist()
    if isinstance(data, list | tuple):
        return [plain_json(x) for x in data]
    return data.item() if isinstance(data, np.generic) else data


def run_data(simulator: Simulator, system: CompiledSystem) -> JsonObject:
    """Return method, step sizes and start of a simulator.

    Raises:
        InputError: for a method that the runtime does not support.
    """
    run: RunState = simulator._run
    if not isinstance(run.stepper, NativeStepper):
        raise InputError(f"method {run.tableau.name!r} cannot be exported: the core does not take its steps")
    core_run = run.stepper.core_run(run)
    limits = {
        "iterations": chart.ITERATIONS,
        "halvings": chart.HALVINGS,
        "largest_step": chart.LARGEST_STEP,
        "closed": CLOSED,
        "smallest_cosine": chart.SMALLEST_COSINE,
        "largest_rotation": chart.LARGEST_ROTATION,
        "gamma_width": GAMMA_WIDTH,
        "restart_margin": RESTART_MARGIN,
    }
    rows = list(system.core.rows)
    start = {"t": simulator.t, "y": run.point_before_sampling(), "rows": rows, "floor": float(system.rank_threshold)}
    modes = _modes(run, core_run)
    found = {
        "tableau": _fields(run.tableau.compiled(_Recorder()), "Tableau"),
        "run": _attributes(core_run, type(core_run).__module__),
        "coordinates": limits,
        "start": start,
        "modes": modes,
    }
    return plain_json(found)


def _modes(run: RunState, core_run: Any) -> CoreData:
    """Return switches, and the guards of the mode.

    Raises:
        InputError: for switches that the core does not handle.
    """
    changes = run.mode_changes
    if changes is None:
        return {"switches": [], "guards": []}
    system, modes, names = changes.system, core_run.modes, ", ".join(s.name for s in changes.switches)
    if not changes.core_switches:
        raise InputError(f"{system.mechanism.title}: the core does not handle all of these switches: {names}")
    if core_run.jumps.times or samplers_of(system.laws):
        raise InputError(
            f"{system.mechanism.title}: switches cannot be exported with force jumps or sampled controllers: {names}"
        )
    modes.in_core, modes.unswitched = True, changes.unswitched.tolist()
    modes.set_switches(changes.core_switches)
    modes_to_core(modes, changes, shortest_step(run))
    return {"switches": changes.core_switches, "guards": np.ravel(modes.states)}


def count_indicators(data: CoreData) -> int:
    """Return the number of event indicators, the sum of the largest numbers of guards of all switches.

    Source: `native/runtime/exported_modes.cpp`.
    """
    return sum(2 if x["interface"] >= 0 or x["kind"] == "ratchet" else 1 for x in data["modes"]["switches"])


def _attributes(struct: Any, core: str) -> Any:
    """Return the attributes of a struct of the core."""
    if type(struct).__module__ != core:
        return struct
    found = {name: getattr(struct, name) for name in dir(struct) if not name.startswith("_")}
    return {name: _attributes(x, core) for name, x in found.items() if not callable(x) and name not in DERIVED}


def output_data(mech: Mechanism, name: str, signal: SignalValue) -> CoreData:
    """Return the core data of an output.

    Raises:
        InputError: for a signal that the core does not compute.
    """
    if not signal.compiled:
        raise InputError(f"{mech.title}: signal {name!r} cannot be exported: the core does not compute it")
    return signal.core_data()


def native_system(mech: Mechanism, native: ModuleType) -> CompiledSystem:
    """Return a workspace of the core.

    Raises:
        InputError: names a feature that the core does not support.
    """
    try:
        system: Any = mech.system(native=native)
    except NotCompiled as e:
        raise InputError(f"{mech.title}: the core does not support {e}") from None
    return system  # type: ignore[no-any-return]
