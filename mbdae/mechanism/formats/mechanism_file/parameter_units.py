"""Units of parameters with dotted names, as declared with the keys of tables (`mbdae.mechanism.key_units`)."""

from collections.abc import Iterable
from typing import Any

from ....units import Units, substituted
from ...checked_table import Table
from ...forces.force import Force
from ...key_units import Coordinates, Unit, UnitSymbols, function_symbols
from ...mechanism import Mechanism
from ...tree.coordinate_units import joint_coordinate_units
from .loaded_model import joint_entry
from .table_entries import entry_at, first_key
from .template import Template
from .unit_conversion import Conversion


def parameter_unit(template: Template, name: str) -> str:
    """Return the SI unit of the parameter with a dotted name; "" for a parameter of a mechanism.py, without units.

    It depends on the joints of the mechanism: a stiffness is in N m/rad on a revolute joint, in N/m on a prismatic one.

    Raises:
        UnknownNameError, InputError: for an invalid path.
    """
    spec = template.spec({})
    if name in [p["name"] for p in spec.parameters]:
        return ""
    conversion = units_conversion(template.make({}))
    entry: Any = spec.file
    rest, text, symbols = name, "", dict[str, str]()
    unit: Unit | Coordinates | None = None
    if name.startswith("joint."):
        entry, rest = joint_entry(spec, name.removeprefix("joint."))
    while rest:
        key, rest = first_key(entry, rest, name)
        if isinstance(unit, Coordinates):
            return conversion.coordinate_unit(key, unit.per_time)
        if isinstance(entry, Table):
            symbols |= symbols_of(conversion, entry, unit)
            unit = entry.unit_of(key)
        if isinstance(unit, Unit):
            text = unit.entries(len(entry))[int(key)] if isinstance(entry, tuple) else unit.texts[0]
        entry = entry_at(entry, key)
    return substituted(text, symbols) if isinstance(unit, Unit) else ""


def parameter_units(make: object, names: Iterable[str]) -> dict[str, str]:
    """Return the units of parameters by name, see `parameter_unit`; empty if the mechanism is not from files."""
    return {name: parameter_unit(make, name) for name in names} if isinstance(make, Template) else {}


def function_units(mech: Mechanism) -> dict[str, str]:
    """Return the units of the functions of time of forces, such as the voltage of a motor in V, by force."""
    conversion = units_conversion(mech)
    out = {}
    for force in (x for x in mech.forces if isinstance(x, Force)):
        for key in type(force).model_fields:
            value, unit = getattr(force, key), force.unit_of(key)
            first = value[0] if isinstance(value, tuple) and value else value
            if isinstance(unit, Unit) and isinstance(first, Table) and hasattr(first, "at"):
                out[force.name] = substituted(unit.texts[0], symbols_of(conversion, force, None))
    return out


def units_conversion(mech: Mechanism) -> Conversion:
    """Return the conversion of tables of a mechanism, with the units of its joints and closures."""
    return Conversion(Units(), joint_coordinate_units(mech.model), {c.name: c.friction for c in mech.closures})


def symbols_of(conversion: Conversion, table: Table, unit: "Unit | Coordinates | None") -> UnitSymbols:
    """Return the units of symbols in the keys of a table, including value and argument if it is a function."""
    return {**function_symbols(unit), **conversion.joint_symbols(table), **table.unit_symbols()}
