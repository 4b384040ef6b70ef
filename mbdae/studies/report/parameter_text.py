"""Parameters of forces as text, in display units."""

from typing import Any

from ...mechanism import Mechanism
from ...mechanism.checked_table import Table
from ...mechanism.formats.mechanism_file.parameter_units import symbols_of, units_conversion
from ...mechanism.key_units import Coordinates, Unit, UnitSymbols, function_symbols
from ...mechanism.time_functions.time_functions import Constant
from ...units import quantity, substituted


def parameter_texts(mech: Mechanism, table: Table) -> dict[str, str]:
    """Return the values of the keys of a table that differ from their defaults, with units."""
    symbols = symbols_of(units_conversion(mech), table, None)
    return {key: _text(getattr(table, key), table.unit_of(key), symbols) for key in _given(table)}


def _given(table: Table) -> list[str]:
    return list(table.model_dump(exclude_defaults=True))


def _text(value: Any, unit: "Unit | Coordinates | None", symbols: UnitSymbols) -> str:
    if isinstance(value, Constant):
        value = value.value
    if isinstance(value, Table):
        inner = {**symbols, **function_symbols(unit)}
        return " ".join(f"{key} {_text(getattr(value, key), value.unit_of(key), inner)}" for key in _given(value))
    if isinstance(value, tuple):
        return f"[{', '.join(_entries(value, unit, symbols))}]"
    if isinstance(value, int | float) and not isinstance(value, bool):
        return quantity(value, substituted(unit.texts[0], symbols) if isinstance(unit, Unit) else "")
    return str(value)


def _entries(values: tuple[Any, ...], unit: "Unit | Coordinates | None", symbols: UnitSymbols) -> list[str]:
    if isinstance(unit, Unit) and all(isinstance(x, int | float) for x in values):
        units = [substituted(text, symbols) for text in unit.entries(len(values))]
        return [quantity(x, u) for x, u in zip(values, units, strict=True)]
    return [_text(x, unit, symbols) for x in values]
