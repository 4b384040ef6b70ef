"""Variables, units and capabilities of an FMU, from its modelDescription.xml."""

import zipfile
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, UnknownNameError, is_number

REALS = {"2.0": "Real", "3.0": "Float64"}  # type of inputs and outputs by version of FMI
TYPES: dict[str, tuple[type, ...]] = {"Boolean": (bool,), "String": (str,)}  # types of values; other types are numbers
SIZES = ("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")
INTEGERS = {"Integer": np.iinfo("int32"), "Enumeration": np.iinfo("int32")} | {x: np.iinfo(x.lower()) for x in SIZES}
SETTABLE = ("parameter", "structuralParameter", "local", "input")  # settable before a start, with initial = "exact"


class FmuVariable(NamedTuple):
    """A scalar variable of an FMU: SI value = factor x + offset.

    Attributes:
        reference: value reference.
        type: type in FMI, ``"Real"``, ``"Float64"``, ``"Integer"`` ...
        factor: unit of the variable in SI units.
        offset: offset in SI units.
    """

    reference: int
    type: str
    factor: float = 1.0
    offset: float = 0.0

    def accepts(self, value: object) -> bool:
        """Return whether a value has the type of the variable."""
        if self.type in TYPES:
            return isinstance(value, TYPES[self.type])
        if not is_number(value) or self.type not in INTEGERS:
            return is_number(value)
        return value == int(value) and INTEGERS[self.type].min <= value <= INTEGERS[self.type].max

    def to_si(self, x: float) -> float:
        """Return a value in SI units."""
        return self.factor * x + self.offset

    def from_si(self, x: float) -> float:
        """Return a value in the unit of the variable."""
        return (x - self.offset) / self.factor


class FmuInterface(NamedTuple):
    """An FMU for co-simulation.

    Attributes:
        version: version of FMI, ``"2.0"`` or ``"3.0"``.
        token: instantiation token.
        identifier: name of the library.
        once_per_process: whether a process may have only one instance.
        can_save: whether states can be saved as bytes.
        inputs: inputs by name.
        outputs: outputs by name.
        parameters: parameters by name.
    """

    version: str
    token: str
    identifier: str
    once_per_process: bool
    can_save: bool
    inputs: Mapping[str, FmuVariable]
    outputs: Mapping[str, FmuVariable]
    parameters: Mapping[str, FmuVariable]

    def find(self, what: str, name: str) -> FmuVariable:
        """Return the variable of this name that is an ``"input"``, ``"output"`` or ``"parameter"``.

        Raises:
            UnknownNameError: lists the names of the FMU.
        """
        known: Mapping[str, FmuVariable] = getattr(self, f"{what}s")
        if name not in known:
            raise UnknownNameError(f"{what} of FMU {self.identifier!r}", name, known)
        return known[name]


def fmpy_module() -> ModuleType:
    """Return FMPy.

    Raises:
        InputError: if it is not installed.
    """
    try:
        import fmpy
    except ImportError:
        raise InputError("FMUs need the package fmpy, which is not installed: pip install 'mbdae[fmi]'") from None
    return fmpy  # type: ignore[no-any-return]


def fmu_interface(path: Path) -> FmuInterface:
    """Return the description of an FMU for co-simulation on this platform.

    Raises:
        InputError: for a missing file, a file that is not such an FMU, or missing FMPy.
    """
    if not path.is_file():
        raise InputError(f"no such file: {path}")
    state = path.stat()
    return _interface_of(path.resolve(), state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=32)
def _interface_of(path: Path, *version: int) -> FmuInterface:
    fmpy = fmpy_module()
    try:
        found = fmpy.read_model_description(str(path), validate=False)
        with zipfile.ZipFile(path) as file:
            libraries = [name.split("/")[1:] for name in file.namelist() if name.startswith("binaries/")]
    except Exception as e:  # of zipfile, lxml and FMPy
        raise InputError(f"{path} is not an FMU: {_line(e)}") from None
    fmi = "3.0" if found.fmiVersion.startswith("3.") else found.fmiVersion
    if fmi not in REALS:
        raise InputError(f"{path} is of FMI {found.fmiVersion}; known: {', '.join(REALS)}")
    if found.coSimulation is None:
        kind = "scheduled execution" if found.modelExchange is None else "model exchange"
        raise InputError(f"{path} is an FMU for {kind}; only FMUs for co-simulation can drive a mechanism")
    cs, platform = found.coSimulation, fmpy.platform_tuple if fmi == "3.0" else fmpy.platform
    if [platform, cs.modelIdentifier + fmpy.sharedLibraryExtension] not in libraries:
        others = ", ".join(sorted({name[0] for name in libraries if name[1:] != [""]})) or "no platform"
        raise InputError(f"{path} has no library for {platform}, only for {others}")
    return FmuInterface(
        fmi, found.guid, cs.modelIdentifier, cs.canBeInstantiatedOnlyOncePerProcess,
        cs.canGetAndSetFMUstate and cs.canSerializeFMUstate, *_variables(found, REALS[fmi]),
    )  # fmt: skip


def _variables(found: Any, real: str) -> tuple[dict[str, FmuVariable], ...]:
    """Return inputs, outputs and parameters."""
    units = {unit.name: unit.baseUnit for unit in found.unitDefinitions if unit.baseUnit is not None}
    out: tuple[dict[str, FmuVariable], ...] = {}, {}, {}
    for x in found.modelVariables:
        variable = FmuVariable(int(x.valueReference), x.type, *_scale(x, units))
        if x.dimensions or x.name in out:
            continue
        if x.causality in ("input", "output") and x.type == real:
            out[x.causality == "output"][x.name] = variable
        if x.causality in SETTABLE and x.variability != "constant" and x.start is not None:
            out[2][x.name] = variable
    return out


def _scale(variable: Any, units: dict[str, Any]) -> tuple[float, ...]:
    """Return the factor and the offset of the unit; differences (``relativeQuantity``) have no offset."""
    kind, is_difference = variable.declaredType, variable.relativeQuantity
    unit = units.get(variable.unit or (kind and kind.unit))
    if unit is None:
        return ()
    if is_difference is None:
        is_difference = kind is not None and kind.relativeQuantity
    return float(unit.factor), 0.0 if is_difference else float(unit.offset)


def _line(e: Exception) -> str:
    return (str(e).splitlines() or [type(e).__name__])[0]
