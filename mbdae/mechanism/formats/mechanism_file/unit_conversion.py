"""Mechanism files in units of the user, converted to SI when they are read.

Numbers are converted once, by the units declared with their keys (`mbdae.mechanism.key_units`). Text is not converted:
signals, levels and expressions of events are in SI units, as are parameters, options and Python.
"""

import re
from collections.abc import Iterator, Sequence
from typing import Any

from ....errors import InputError
from ....units import SYMBOL, Units, substituted
from ...checked_table import Table
from ...imported_model import ImportedModel
from ...key_units import Coordinates, Unit, UnitSymbols, function_symbols
from ...tree.coordinate_units import JointUnits, joint_coordinate_units, units_by_coordinate
from .build import build
from .file_units import FileUnits
from .schema import MechanismFile

BODIES = ("source", "body", "flexible", "frame")  # tables that define the joints, and do not use their units
EFFORTS = {"rad": "N m", "m": "N"}  # units of efforts by the unit of the coordinate
JOINT_SYMBOL = re.compile(r"q\d*|e")
ROTATIONAL = ("revolute", "spherical")  # kinds of friction in bearings


def in_si(file: MechanismFile, models: Sequence[ImportedModel], name: str) -> MechanismFile:
    """Return a mechanism file with all numbers in SI units.

    Args:
        file: the file in its units.
        models: the imported models of its sources, which are in SI units.
        name: name of the model.

    Raises:
        UnknownNameError, InputError: for bodies and frames that cannot be attached; for a number shared by joints whose
            coordinates have different units.
    """
    if not file.units.units.chosen:
        return file
    body_conversion = Conversion(file.units.units, {"q": {}, "v": {}}, {})
    tables = {key: tuple(body_conversion.table(x) for x in getattr(file, key)) for key in BODIES}
    model, _ = build(file.model_copy(update={**tables, "lock": {}}), models, name)
    closures = {c.name: c.friction for m in models for c in m.closures} | {c.name: c.friction for c in file.closure}
    conversion = Conversion(file.units.units, joint_coordinate_units(model), closures)
    out: MechanismFile = conversion.table(file.model_copy(update={"units": FileUnits()}))
    return out


class Conversion:
    """Conversion of tables to SI.

    Args:
        units: units of the numbers in the tables.
        coordinates: units in SI of ``q`` and ``v`` by joint and coordinate, see `joint_coordinate_units`.
        closures: kinds of friction of closures by name.
    """

    def __init__(self, units: Units, coordinates: JointUnits, closures: dict[str, str]) -> None:
        self.units, self.coordinates, self.closures = units, coordinates, closures
        self.components = units_by_coordinate(coordinates)

    def table(self, table: Any, symbols: UnitSymbols | None = None) -> Any:
        """Return a table in SI; omitted keys keep their defaults."""
        known = {**(symbols or {}), **self.joint_symbols(table), **table.unit_symbols()}
        given = {key: getattr(table, key) for key in type(table).model_fields if key in table.model_fields_set}
        return type(table)(**{key: self._key(table, key, value, known) for key, value in given.items()})

    def _key(self, table: Any, key: str, value: Any, symbols: UnitSymbols) -> Any:
        unit = table.unit_of(key)
        if isinstance(unit, Coordinates):
            return {name: self._coordinate(name, x, unit.per_time) for name, x in value.items()}
        try:
            return self._value(value, unit, symbols)
        except InputError as e:
            owner = getattr(table, "name", "") or getattr(table, "kind", "")
            raise InputError(f"{owner}.{key}: {e}".lstrip(".")) from None

    def _value(self, value: Any, unit: Unit | None, symbols: UnitSymbols) -> Any:
        """Return a value of a key; inner tables have the unit as that of their values."""
        if isinstance(value, Table):
            return self.table(value, {**symbols, **function_symbols(unit)})
        if isinstance(value, tuple):
            return self._list(value, unit, symbols)
        if unit is None:
            return value
        if isinstance(value, dict):
            return {name: self._value(x, unit, symbols) for name, x in value.items()}
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        return self._number(value, unit.texts[0], symbols) if is_number else value

    def _list(self, values: tuple[Any, ...], unit: Unit | None, symbols: UnitSymbols) -> tuple[Any, ...]:
        """Return the entries of a list: numbers by the units of the entries, lists and tables each."""
        if unit and all(isinstance(x, int | float) for x in values):
            units = unit.entries(len(values))
            return tuple(self._number(x, text, symbols) for x, text in zip(values, units, strict=True))
        return tuple(self._value(x, unit, symbols) for x in values)

    def _number(self, x: float, unit: str, symbols: UnitSymbols) -> float:
        missing = [s for s in _expanded(unit, symbols) if JOINT_SYMBOL.fullmatch(s) and s not in symbols]
        if missing:
            raise InputError("[units] need joints of one kind, revolute or prismatic: use one table for each kind")
        return self.units.factor(substituted(unit, symbols)).apply(x)

    def _coordinate(self, name: str, value: Any, per_time: bool) -> Any:
        """Return the coordinates of a joint, or one with its name, ``q.crank``."""
        if isinstance(value, str):
            return value
        known = self._coordinate_units(name, per_time)
        values = value if isinstance(value, tuple) else (value,)
        units = known if len(known) == len(values) else ["1"] * len(values)  # others: cosine and sine of an angle
        out = tuple(self.units.factor(u).apply(x) for x, u in zip(values, units, strict=True))
        return out if isinstance(value, tuple) else out[0]

    def coordinate_unit(self, name: str, per_time: bool) -> str:
        """Return the unit in SI of the coordinate of a joint, or of one of several, ``base.x``; "" if they differ."""
        found = set(self._coordinate_units(name, per_time))
        return found.pop() if len(found) == 1 else ""

    def _coordinate_units(self, name: str, per_time: bool) -> list[str]:
        """Return the units of the coordinates of a joint, of one of them, or of ``q.<joint>``; names may have dots."""
        letter = "v" if per_time else "q"
        if name in self.coordinates[letter]:
            return list(self.coordinates[letter][name].values())
        return [self.components[x] for x in (f"{letter}.{name}", name) if x in self.components]

    def joint_symbols(self, table: Any) -> UnitSymbols:
        """Return the units of the coordinates of the joints of a table, of their effort and of a closure's slip."""
        if closure := getattr(table, "closure", ""):
            return {"q": "rad" if self.closures.get(closure) in ROTATIONAL else "m"} if isinstance(closure, str) else {}
        out: dict[str, str] = {}
        for k, names in enumerate(_joint_groups(table)):
            found = set(self._velocity_units(names))
            if len(found) == 1:
                out[f"q{k or ''}"] = found.pop()
        return out | ({"e": EFFORTS[out["q"]]} if "q" in out else {})

    def _velocity_units(self, names: Sequence[str]) -> Iterator[str]:
        """Yield rad or m for each velocity of joints; of all joints without names."""
        for joint, units in self.coordinates["v"].items():
            for name, unit in units.items():
                if not names or joint in names or name in names:
                    yield unit.removesuffix("/s")


def _joint_groups(table: Any) -> list[tuple[str, ...]]:
    """Return the joints that share a number of a table, or each of its joints; an empty group means all joints."""
    shared = getattr(table, "joint", None)
    if isinstance(shared, str | tuple):
        return [shared if isinstance(shared, tuple) else (shared,)]
    return [(name,) for name in getattr(table, "joints", None) or ()]


def _expanded(unit: str, symbols: UnitSymbols) -> set[str]:
    """Return the symbols of a unit, and those in the units of symbols."""
    out = {found[1] for found in SYMBOL.finditer(unit)}
    return out | {inner for s in out if s in symbols for inner in _expanded(symbols[s], symbols)}
