"""Load mechanisms from files."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import pinocchio as pin

from ....discovery import is_model_name
from ....errors import InputError, UnknownNameError, require
from ....file_io import read_text
from ....tolerances import INPUT_DIGITS
from ...closures.closure import Closure
from ...closures.clutch import Clutch
from ...closures.driver import Driver
from ...closures.unilateral_constraint import Stop
from ...element_kinds import require_elements
from ...forces import FORCES
from ...forces.fmu import with_fmu_paths
from ...hybrid.reset import Reset
from ...imported_model import ImportedModel, not_carried_over
from ...mechanism import Mechanism
from ...model_settings import Motor
from ..body_tables import Source
from ..model_library import IN_FOLDER, find
from ..readers import CONVERTERS, MECHANISM, PARAMETRIC, converted
from ..sources import read_source
from .build import build
from .error_context import with_error_context
from .flexible_table import with_data
from .merge import merge_sources
from .parametric import ParametricFile, split
from .schema import MechanismFile, checked, read_toml
from .unit_conversion import in_si

BODIES = "body", "flexible"  # tables whose defaults are valid only for some joints
ModelSource: TypeAlias = str | Path | Mapping[str, Any]
"""Argument of `load`: the name or the path of a model, or its tables."""


def load(
    path: ModelSource,
    *,
    closures: Sequence[Closure] = (),
    drivers: Sequence[Driver] = (),
    stops: Sequence[Stop] = (),
    clutches: Sequence[Clutch] = (),
    resets: Sequence[Reset] = (),
    forces: Sequence[object] = (),
    motors: Mapping[str, object] | None = None,
    key: str = "",
    assemble: bool = True,
    free_flyer: bool = False,
    **parameters: Any,
) -> Mechanism:
    """Load a mechanism.

    Args:
        path: the name of a model of mbdae, a mechanism.toml, a mechanism.py, a URDF file, an MJCF file, a robot.yaml
            next to a robot.urdf, or a folder with one of these; or the tables of a mechanism.toml as a dict, whose
            file names are relative to the current folder.
        closures: additional closures, after those of the file.
        drivers: additional drivers, after those of the file.
        stops: additional stops, after those of the file.
        clutches: additional clutches, after those of the file.
        resets: additional events at which the state jumps, after those of the file.
        forces: additional forces, after those of the file.
        motors: controls of named inputs (`Mechanism.motors`): numbers or functions of time.
        key: keyframe of an MJCF file with the initial state; the first keyframe if omitted, ``"qpos0"`` for none.
        assemble: make the initial state consistent; if False, the state of the file is kept, and rejected if it
            violates a closure.
        free_flyer: add a free joint, ``root_joint``, between the world and the root link of each URDF source, which is
            fixed to the world otherwise; the same as ``free_flyer = true`` of a mechanism file.
        parameters: values for a mechanism.py; they can also follow the name: ``"n_four_bar?N=10"``.

    Raises:
        UnknownNameError: for an unknown model, parameter, frame, joint, motor or keyframe; lists the valid names.
        InputError: for an invalid file; the message names the key and the expected value.
    """
    require_elements(closures=closures, drivers=drivers, stops=stops, clutches=clutches, resets=resets)
    require(forces, Sequence, "forces are a list")
    require(motors, Mapping | None, "motors are a table of controls by name")
    more: dict[str, Any] = {"closure": closures, "driver": drivers, "stop": stops, "clutch": clutches, "event": resets}
    more |= {"force": [f for f in forces if isinstance(f, FORCES)], "motor": motors or {}}
    spec = read(path, parameters, key=key, assemble=assemble, free_flyer=free_flyer, more=more)
    if spec.remarks:
        warnings.warn(not_carried_over(spec.name, spec.remarks), stacklevel=2)
    label = "" if forces or any(more.values()) else _label(path)
    with with_error_context(label, spec.file, spec.models):
        mech = make(spec, [f for f in forces if not isinstance(f, FORCES)])
    if spec.file.start.assemble and any(m.start.guess for m in spec.models):
        _warn_if_violated(mech, spec.name)
    return mech


class ModelSpec(NamedTuple):
    """Merged contents of all files of a mechanism.

    Attributes:
        file: the mechanism file, merged with its sources.
        name: name of the model.
        models: the imported models of its sources.
        motors: named inputs.
        left_out: features of the files that are not supported.
        parameters: name, value and description of the type of each parameter of a mechanism.py.
        remarks: unsupported features of sources that are not ``quiet``.
    """

    file: MechanismFile
    name: str
    models: Sequence[ImportedModel]
    motors: Sequence[Motor]
    left_out: Sequence[str]
    parameters: Sequence[dict[str, Any]]
    remarks: Sequence[str] = ()


def read(
    path: ModelSource,
    parameters: Mapping[str, Any],
    *,
    key: str = "",
    assemble: bool = True,
    free_flyer: bool = False,
    more: Mapping[str, Any] | None = None,
    parametric: ParametricFile | None = None,
) -> ModelSpec:
    """Read the files of a mechanism.

    ``more`` contains additional entries of its tables, ``parametric`` is its mechanism.py if already run; for other
    arguments see `load`.
    """
    label = _label(path)
    if isinstance(path, Mapping):
        found, file = Path.cwd() / IN_FOLDER[0], checked(dict(path), label)
        name, chosen = file.title or "mechanism", _without_parameters("the tables", parameters)
    else:
        found, written = (parametric.path, split(label)[1]) if parametric else located(label)
        name = found.parent.name if found.name in IN_FOLDER else found.stem
        file, chosen = _read(found, name, {**written, **parameters}, parametric)
    if free_flyer and not file.source:
        raise InputError(f'{name}: free_flyer belongs to a source; a [[body]] says joint = "free"')
    sources = tuple(_with_options(s, free_flyer or file.free_flyer, key) for s in file.source)
    from_files = {"flexible": with_data(file.flexible, found), "force": with_fmu_paths(file.force, found)}
    file = file.model_copy(update={"source": sources, **from_files})
    models = [read_source(s, found.parent) for s in file.source]
    with with_error_context(label, file, models):
        file = in_si(file, models, name)
    added = dict(more or {})
    update = {
        "start": file.start if assemble else file.start.model_copy(update={"assemble": False}),
        "motor": MechanismFile(motor={**file.motor, **added.pop("motor", {})}).motor,
        **{table: (*getattr(file, table), *entries) for table, entries in added.items()},
    }
    file = file.model_copy(update=update)
    with with_error_context("" if any((more or {}).values()) else label, file, models):
        file, motors, left_out, remarks = merge_sources(file, models)
    return ModelSpec(file, name, models, motors, left_out, chosen, remarks)


def _label(path: object) -> str:
    """Return the name of a model in messages: a path, or "the tables"."""
    if isinstance(path, Mapping):
        return "the tables"
    require(path, str | Path, "a mechanism is the name of a model, a path or a dict of tables")
    return str(path)


def located(path: str) -> tuple[Path, dict[str, str]]:
    """Return the file for a name or a path, and the parameters that follow it.

    Raises:
        UnknownNameError, InputError: as `load`.
    """
    name, written = split(path)
    found = find(name)
    if found.suffix == PARAMETRIC and Path(name).suffix != PARAMETRIC and not is_model_name(name):
        warnings.warn(f"{name}: the Python file {found} is run", stacklevel=4)
    return found, written


def _without_parameters(name: str, values: Mapping[str, object]) -> Sequence[dict[str, Any]]:
    for key in values:
        if "." in key:
            raise InputError(f"{key!r}: {name} has no parameters; sweep, fit and optimize vary entries of its tables")
        raise UnknownNameError(f"parameter of {name}", key, ())
    return ()


def _read(
    found: Path, name: str, values: Mapping[str, object], parametric: ParametricFile | None
) -> tuple[MechanismFile, Sequence[dict[str, Any]]]:
    """Return the mechanism file, and a description of its parameters."""
    if found.suffix == PARAMETRIC:
        return (parametric or ParametricFile(found)).tables(name, values)
    chosen = _without_parameters(name, values)
    if found.suffix in CONVERTERS:
        return read_toml(converted(found), str(found)), chosen
    if found.suffix == MECHANISM:
        return read_toml(read_text(found), str(found)), chosen
    return MechanismFile(source=(Source(file=found.name),), title=name), chosen


def _warn_if_violated(mech: Mechanism, name: str) -> None:
    """Warn if a source specifies all joint values and violates a closure; assembly will move the joints."""
    violation = mech.start_violation
    if violation and violation.relative > INPUT_DIGITS:
        warnings.warn(f"{name}: {violation.message()} as given: assembly corrects it", stacklevel=3)


def _with_options(source: Source, free_flyer: bool, key: str) -> Source:
    return source.model_copy(update={"free_flyer": source.free_flyer or free_flyer, "key": key or source.key})


def make(spec: ModelSpec, functions: Sequence[object] = (), *, recorded: bool = True) -> Mechanism:
    """Create the mechanism that the files describe.

    Args:
        spec: the merged files.
        functions: Python forces, after those of the file.
        recorded: store the files for `describe`; False if their values were changed after reading.

    Raises:
        UnknownNameError, InputError: for inconsistent input.
    """
    file, name = spec.file, spec.name
    if not (spec.models or file.body or file.flexible):
        raise InputError(f"{name}: a mechanism needs a source, a [[body]] or a [[flexible]]")
    model, visuals = build(file, spec.models, name)
    source = _source(spec) if recorded else None
    rest = {"visuals": visuals, "source": source, "motors": spec.motors}
    rest |= {"left_out": spec.left_out, "remarks": spec.remarks}
    try:
        return mechanism_from_file(model, file, [*file.force, *functions], file.title or name, **rest)
    except MemoryError:
        raise InputError(f"{name}: there is not enough memory for {model.njoints - 1} joints") from None


def _source(spec: ModelSpec) -> dict[str, Any]:
    """Return the description of a mechanism from files."""
    return {
        "name": spec.name,
        "file": table_of(spec.file),
        "parts": [replace(m, visuals=None) for m in spec.models],  # meshes are large, and read again when saved
        "motors": [list(m) for m in spec.motors],
        "left_out": list(spec.left_out),
        "parameters": list(spec.parameters),
    }


def mechanism_from_file(
    model: pin.Model, file: MechanismFile, forces: Sequence[object], title: str, **rest: Any
) -> Mechanism:
    """Return the mechanism of a model, with the other tables of a file."""
    return Mechanism(
        model, file.closure, forces, drivers=file.driver, stops=file.stop, clutches=file.clutch, resets=file.event,
        start=file.start,
        title=title, duration=file.duration, order=file.order, settings=file.solve, **rest,
    )  # fmt: skip


def spec_from_mechanism(mech: Mechanism) -> ModelSpec:
    """Return the files of a mechanism, without visuals."""
    source: dict[str, Any] = mech.source or {}
    file = MechanismFile.model_validate(source["file"])
    return ModelSpec(file, source["name"], source["parts"], mech.motors, mech.left_out, source["parameters"])


def table_of(file: MechanismFile) -> dict[str, Any]:
    """Return the file, in SI, as JSON data; closures and bodies without defaults, since keys depend on the kind."""
    tables = {x: [row.model_dump(mode="json", exclude_defaults=True) for row in getattr(file, x)] for x in BODIES}
    closures = [x.model_dump(mode="json", exclude_none=True) for x in file.closure]
    return {**file.model_dump(mode="json", exclude={*BODIES, "closure", "units"}), **tables, "closure": closures}
