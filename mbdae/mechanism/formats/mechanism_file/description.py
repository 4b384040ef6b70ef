"""Description of a mechanism in a saved solution, and its reconstruction."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field, ValidationError

from ....callbacks import function_name
from ....data_types import JsonObject
from ....errors import InputError
from ...checked_table import Table, one_line
from ...forces import FORCES, PYTHON_FORCES
from ...forces.actuator import Actuator
from ...mechanism import Mechanism
from ...model_serialization import model_from_data, model_to_data
from ...model_settings import Motor
from ..sources import restored
from .load import ModelSpec, make, mechanism_from_file, table_of
from .schema import MechanismFile


def describe(mech: Mechanism) -> JsonObject:
    """Return the description of a mechanism for a saved solution as JSON data, with only the names of functions."""
    functions = _functions(mech)
    if mech.source:
        models = [x.record() for x in mech.source["parts"]]
        return {**mech.source, "file": _recorded(mech.source["file"]), "parts": models, "functions": functions}
    file = MechanismFile(
        title=mech.title,
        closure=mech.closures,
        driver=mech.drivers,
        stop=mech.stops,
        clutch=mech.clutches,
        event=mech.resets,
        force=tuple(f for f in mech.forces if isinstance(f, FORCES)),
        start=mech.start_values,
        order=mech.order,
        solve=mech.settings,
        duration=mech.duration,
    )
    table = _recorded(table_of(file))
    return {"name": mech.title, "file": table, "model": model_to_data(mech.model), "functions": functions}


def _recorded(file: Mapping[str, Any]) -> JsonObject:
    """Return a file whose FMUs are marked as recorded and not run, since a saved run may be untrusted."""
    forces = [{**x, "recorded": True} if x["kind"] == "fmu" else x for x in file["force"]]
    return {**file, "force": forces}


class _PythonForce(Table):
    """A Python force: its name, its index among all forces, and the initial values of its states."""

    name: str
    at: int = Field(ge=0)
    states: dict[str, float] | None


class _Parameter(Table):
    """A parameter of a mechanism.py; its keys are those of saved solutions.

    Attributes:
        name: name of the parameter.
        value: its value.
        takes: description of its type.
    """

    name: str
    value: Any
    takes: str


class _Description(Table):
    """Result of `describe`: a file with the imported models of its sources (key ``parts``), or with a model."""

    name: str
    file: MechanismFile
    functions: tuple[_PythonForce, ...]
    model: dict[str, Any] | None = None
    parts: tuple[dict[str, Any], ...] = ()
    motors: tuple[Motor, ...] = ()
    left_out: tuple[str, ...] = ()
    parameters: tuple[_Parameter, ...] = ()


def restore(description: Mapping[str, object], meshes: Sequence[Path] = ()) -> Mechanism:
    """Reconstruct a mechanism from its description, without Python forces; ``meshes`` are allowed mesh folders.

    Raises:
        InputError: for a damaged description.
    """
    try:
        d = _Description.model_validate(description)
    except ValidationError as e:
        raise InputError(one_line(e, lambda path: [])) from None
    unavailable = [(f.at, _unavailable_force(f.name, f.states)) for f in d.functions]
    if d.model is None:
        parameters = [p.model_dump() for p in d.parameters]
        models = [restored(r, meshes) for r in d.parts]
        spec = ModelSpec(d.file, d.name, models, d.motors, d.left_out, parameters)
        return make(spec, [law for _, law in unavailable])
    forces: list[Any] = list(d.file.force)
    for at, law in unavailable:
        forces.insert(at, law)
    return mechanism_from_file(model_from_data(d.model), d.file, forces, d.file.title)


def _functions(mech: Mechanism) -> list[dict[str, Any]]:
    """Return names, indices among all forces, and initial states of the Python forces."""
    states = {law.name: law.states for law, _ in mech.bind_forces(mech.make_workspace()).bound if law.states}
    python = [
        (i, f.name if isinstance(f, PYTHON_FORCES) else function_name(f))
        for i, f in enumerate(mech.forces)
        if not isinstance(f, FORCES)
    ]
    return [{"name": name, "at": i, "states": states.get(name)} for i, name in python]


def _unavailable_force(name: str, states: dict[str, float] | None) -> Any:
    """Return a placeholder for a Python force, which raises an error when evaluated."""

    def unavailable(*point: Any) -> np.ndarray:
        raise InputError(f"force {name!r} is a Python function and not in the file: load the mechanism with it again")

    unavailable.__name__ = name
    return Actuator(unavailable, unavailable, states, name) if states else unavailable
