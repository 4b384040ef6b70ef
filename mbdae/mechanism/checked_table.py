"""Validated tables of a mechanism file, or written in Python, with error messages of one line."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, LiteralString, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, ModelWrapValidatorHandler, ValidationError, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from ..errors import InputError
from .key_units import Coordinates, Unit, UnitSymbols, declared_unit

HUGE = 1e50  # larger numbers in SI units are mistakes; their products overflow
Location = Sequence[int | str]  # location of a value in a table: keys and positions
KnownKeys = Callable[[Location], list[str]]


if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
    from pydantic_core import ErrorDetails
else:
    ModelMetaclass = type(BaseModel)


class OneLine(ModelMetaclass):
    """Metaclass that reduces pydantic's report on a table written in Python to one line."""

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:
        known = sorted(getattr(cls, "model_fields", ()))
        if args:
            got = ", ".join(f"{value!r:.40}" for value in args)
            raise InputError(f"{cls.__name__} takes its values by name ({', '.join(known)}), got {got} without a name")
        try:
            return super().__call__(**kwargs)
        except ValidationError as e:
            raise InputError(f"{cls.__name__}: {one_line(e, lambda path: known, kwargs)}") from None


class Table(BaseModel, metaclass=OneLine):
    """A table that rejects unknown keys, numbers that are not finite, and strings or Booleans in place of numbers.

    Raises:
        InputError: for invalid values.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    @model_validator(mode="wrap")
    @classmethod
    def _reject_coerced_values(cls, given: Any, handler: ModelWrapValidatorHandler["Table"]) -> "Table":
        table = handler(given)
        if isinstance(given, Mapping):
            errors = [
                InitErrorDetails(type=PydanticCustomError("kind", expected), loc=(key,), input=x)
                for key, x in given.items()
                if (expected := _expected_type(x, getattr(table, key)))
            ]
            if errors:
                raise ValidationError.from_exception_data(cls.__name__, errors)
        return table

    def unit_of(self, key: str) -> Unit | Coordinates | None:
        """Return the unit of the numbers of a key; None for keys without numbers."""
        return declared_unit(type(self).model_fields[key])

    def unit_symbols(self) -> UnitSymbols:
        """Return units for further symbols in the units of keys, or for symbols of joints."""
        return {}

NO_LIST_OR_TABLE = "tuple_type", "model_type", "model_attributes_type", "dict_type"  # types of errors of pydantic


def _expected_type(given: Any, found: object) -> LiteralString:
    """Return the message for a string or Boolean coerced to a number, or a value coerced to a Boolean; else "".

    Pydantic's strict mode is too strict: it rejects lists for tuples, and numpy scalars.
    """
    if found is given:
        return ""
    if isinstance(found, bool):
        return "" if isinstance(given, bool | np.bool) else "Input should be true or false"
    if isinstance(found, int | float):
        return "Input should be a valid number" if isinstance(given, str | bytes | bool | np.bool) else ""
    if isinstance(found, dict) and isinstance(given, Mapping):
        return next(filter(None, (_expected_type(given.get(key), x) for key, x in found.items())), "")
    if isinstance(found, tuple | list) and isinstance(given, tuple | list):
        return next(filter(None, map(_expected_type, given, found)), "")
    return ""


def tables_in(annotation: object) -> list[type[Table]]:
    """Return the tables in a type, such as the kinds of a union."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        return [annotation]
    by_kind = getattr(annotation, "tables", None) or {}  # tables of TaggedByKind
    return [*by_kind.values(), *(table for argument in get_args(annotation) for table in tables_in(argument))]


def one_line(error: ValidationError, known: KnownKeys, content: object = None) -> str:
    """Return all errors of a table in one line, with the valid keys for an unknown key.

    Args:
        error: the validation error.
        known: valid keys of a table.
        content: the table, whose list entries are identified by their names. An error is reported once, even if
            pydantic has tried several kinds of table; a list or table with a wrong entry is no value of a wrong kind.
    """
    messages: dict[tuple[str, ...], str] = {}
    errors, of_other_kinds = error.errors(), set[tuple[str, ...]]()
    length = {e["loc"][:-1]: int(e["loc"][-1]) + 1 for e in errors if _has_too_few_entries(e)}  # the last one missing
    for e in errors:
        keys = _key_path(e["loc"], e["type"], content)
        path = tuple(keys[:-1] if _has_too_few_entries(e) else keys)
        if path not in messages:
            messages[path] = _message(e, ".".join(path), known, length.get(e["loc"][:-1]))
        if e["type"] in NO_LIST_OR_TABLE:
            of_other_kinds.add(path)
    with_entries = {path[:i] for path in messages for i in range(len(path))}
    return "; ".join(text for path, text in messages.items() if path not in of_other_kinds & with_entries)


def _key_path(loc: Location, kind: str, content: object) -> list[str]:
    """Return the keys and names that lead to an error, without the kinds of table that pydantic has tried."""
    if content is None:
        return [str(p) for p in loc]
    out: list[str] = []
    at = content
    for i, p in enumerate(loc):
        if isinstance(at, dict) and p in at:
            out, at = [*out, str(p)], at[p]
        elif isinstance(at, list | tuple) and isinstance(p, int) and p < len(at):
            at = at[p]
            out.append(_entry_name(at) or str(p))
        elif kind == "missing" and i == len(loc) - 1:
            out.append(str(p))
    return out


def _entry_name(entry: object) -> str:
    """Return the name of a list entry, or else the names of its joints."""
    if not isinstance(entry, dict):
        return ""
    joints = "" if "kind" in entry else entry.get("joint") or entry.get("joints") or ""
    if isinstance(joints, list) and all(isinstance(name, str) for name in joints):
        joints = "-".join(joints)
    return next((x for x in (entry.get("name"), joints) if isinstance(x, str) and x), "")


def wrong_kind(where: str, known: Iterable[str], got: object) -> str:
    """Return the message about a table whose kind is missing or unknown."""
    return f"{where}: Input should be {', '.join(map(repr, known))}, got {got!r:.80}" if got else f"missing key {where}"


def _has_too_few_entries(e: "ErrorDetails") -> bool:
    """Return whether the error is a list with too few entries."""
    return e["type"] == "missing" and isinstance(e["loc"][-1], int)


def _kind_text(loc: Location, where: str) -> str:
    """Return the kind of the table whose key is unknown or missing, unless ``where`` has it."""
    kind = loc[-2] if len(loc) > 1 else None
    return f" (kind {kind!r})" if isinstance(kind, str) and not where.endswith(f"{kind}.{loc[-1]}") else ""


def _structure(e: "ErrorDetails", where: str) -> str:
    """Return the message for a value that is not a list or table, or of wrong length; "" for other errors."""
    kind, ctx = e["type"], e.get("ctx", {})
    if kind == "tuple_type":
        named = isinstance(e["input"], dict) and ("kind" in e["input"] or _entry_name(e["input"]))
        return f"Input should be a list of tables, [[{where}]]" if named else "Input should be a list"
    if kind in ("too_long", "too_short"):
        bound = f"at most {ctx['max_length']}" if kind == "too_long" else f"at least {ctx['min_length']}"
        return f"Input should have {bound} entries, not {ctx['actual_length']}"
    return "Input should be a table" if kind in NO_LIST_OR_TABLE else ""


def _message(e: "ErrorDetails", where: str, known: KnownKeys, length: int | None) -> str:
    if e["type"].startswith("union_tag_"):  # e["ctx"]["expected_tags"] are quoted and separated by commas
        tag, kinds = e["ctx"]["discriminator"].strip("'"), e["ctx"].get("expected_tags", "").replace("'", "")
        return wrong_kind(f"{where}.{tag}" if where else tag, kinds.split(", "), e["ctx"].get("tag"))
    if e["type"] == "extra_forbidden":
        return f"unknown key {where}; known: {', '.join(known(e['loc'][:-1]))}{_kind_text(e['loc'], where)}"
    if _has_too_few_entries(e):
        return f"{where}: Input should have {length} entries, not {len(e['input'])}, got {str(e['input'])[:80]!r}"
    if e["type"] == "missing":
        return f"missing key {where}{_kind_text(e['loc'], where)}"
    message = _structure(e, where) or e["msg"].removeprefix("Value error, ")
    if not where:
        return message
    of_table = e["type"] == "value_error" and isinstance(e["input"], dict)  # the message names the inconsistency
    got = f", got {str(e['input'])[:80]!r}"  # a nested table may have added it
    return f"{where}: {message}" if of_table or message.endswith(got) else f"{where}: {message}{got}"
