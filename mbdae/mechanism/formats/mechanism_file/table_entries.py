"""Entries of checked tables by dotted paths, and copies of tables with changed entries."""

from collections.abc import Mapping
from typing import Any

from ....errors import InputError, UnknownNameError
from ...checked_table import Table
from .schema import MechanismFile

TABLES = (  # tables of files
    "body", "closure", "clutch", "driver", "duration", "flexible", "force", "frame", "gravity", "start", "stop",
)  # fmt: skip


def with_entry(table: object, path: str, value: object, full_path: str) -> Any:
    """Return a copy of a table with a new value at the end of a dotted path.

    Args:
        table: a checked table, a list or a dict; the value itself if the path is empty.
        path: path of the value within ``table``.
        value: the value.
        full_path: full path in the mechanism, for messages.

    Raises:
        UnknownNameError: for an invalid path.
        InputError: for an invalid value.
    """
    return with_entries(table, {full_path: (path, value)})


def with_entries(table: Any, entries: Mapping[str, tuple[str, Any]]) -> Any:
    """Return a copy of a table with new values at the ends of several dotted paths, none within another.

    Args:
        table: a checked table, a list or a dict; the value itself if the path is empty.
        entries: path of the value within ``table``, and the value, by full path in the mechanism, for messages.

    Raises:
        UnknownNameError, InputError: as `with_entry`.
    """
    groups: dict[str, dict[str, tuple[str, Any]]] = {}
    keys = entry_keys(table)
    for full_path, (path, value) in entries.items():
        if not path:
            return value
        key, rest = _first_key(table, path, full_path, keys)
        groups.setdefault(key, {})[full_path] = rest, value
    if isinstance(table, Table):
        given = {k: getattr(table, k) for k in table.model_fields_set if k in type(table).model_fields}
        try:
            changed = {key: with_entries(getattr(table, key), group) for key, group in groups.items()}
            return type(table)(**given | changed)
        except UnknownNameError:
            raise
        except InputError as e:
            known = any(str(e).startswith(full_path) for full_path in entries)
            raise InputError(str(e) if known else f"{', '.join(entries)}: {e}") from None
    if isinstance(table, dict):
        return {**table, **{key: with_entries(table.get(key), group) for key, group in groups.items()}}
    return tuple(with_entries(x, groups[str(i)]) if str(i) in groups else x for i, x in enumerate(table))


def first_key(table: object, path: str, full_path: str) -> tuple[str, str]:
    """Return the first key of a path, which may contain dots, and the rest of the path; list entries are numbered.

    Args:
        table: a checked table, a list or a dict.
        path: a path within ``table``.
        full_path: full path in the mechanism, for messages.

    Raises:
        UnknownNameError: for an invalid path; lists the valid keys.
        InputError: for a name shared by several entries of a list.
    """
    return _first_key(table, path, full_path, entry_keys(table))


def _first_key(table: object, path: str, full_path: str, keys: Mapping[str, str]) -> tuple[str, str]:
    if isinstance(table, dict):  # joint = value: the model checks the names of joints
        return path, ""
    name = path
    while name not in keys:
        name, dot, _ = name.rpartition(".")
        if not dot:
            above = full_path.removesuffix(path).rstrip(".") or "the mechanism"
            raise UnknownNameError(f"entry of {above}", path, keys)
    if not keys[name]:
        raise InputError(f"{full_path}: several entries are named {name!r}: give them different names")
    return keys[name], path[len(name) + 1 :]


def entry_at(table: Any, key: str) -> Any:
    """Return an entry of a table, a list or a dict by its key or index; None if a dict lacks it."""
    if isinstance(table, dict):
        return table.get(key)
    return table[int(key)] if isinstance(table, tuple) else getattr(table, key)


def entry_keys(table: object) -> dict[str, str]:
    """Return the valid next keys of a path, each with its key or index."""
    if isinstance(table, MechanismFile):
        return {k: k for k in TABLES}
    if isinstance(table, Table):
        return {k: k for k in type(table).model_fields}
    if isinstance(table, tuple):
        return entry_names(table) or {str(i): str(i) for i in range(len(table))}
    return {}


def entry_names(entries: tuple[Any, ...]) -> dict[str, str]:
    """Return the indices of list entries by name, "" for a repeated name; unnamed entries by kind and number."""
    out: dict[str, str] = {}
    for i, entry in enumerate(entries):
        if isinstance(entry, Table) and "name" in type(entry).model_fields:
            name = getattr(entry, "name", "") or f"{getattr(entry, 'kind', '')} {i + 1}".strip()
            out[name] = "" if name in out else str(i)
    return out
