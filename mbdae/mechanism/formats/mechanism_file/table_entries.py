"""Entries of checked tables by dotted paths, and copies of tables with other values there."""

from collections.abc import Mapping
from typing import Any

from ....errors import InputError, UnknownNameError
from ...checked_table import Table
from .schema import MechanismFile

TABLES = (  # of files
    "body", "closure", "clutch", "driver", "duration", "flexible", "force", "frame", "gravity", "start", "stop",
)  # fmt: skip


def with_entry(part: object, path: str, value: object, whole: str) -> Any:
    """Return a copy of a table with another value at the end of a dotted path.

    Args:
        part: a checked table, a list or a dict; the value itself if the path is empty.
        path: path of the value within ``part``.
        value: the value.
        whole: the complete path, for messages.

    Raises:
        UnknownNameError: for an invalid path.
        InputError: for an invalid value.
    """
    return with_entries(part, {whole: (path, value)})


def with_entries(part: Any, entries: Mapping[str, tuple[str, Any]]) -> Any:
    """Return a copy of a table with other values at the ends of several dotted paths, none within another.

    Args:
        part: a checked table, a list or a dict; the value itself if the path is empty.
        entries: by the complete path, for messages: the path of the value within ``part``, and the value.

    Raises:
        UnknownNameError, InputError: as `with_entry`.
    """
    groups: dict[str, dict[str, tuple[str, Any]]] = {}
    keys = entry_keys(part)
    for whole, (path, value) in entries.items():
        if not path:
            return value
        key, rest = _first_key(part, path, whole, keys)
        groups.setdefault(key, {})[whole] = rest, value
    if isinstance(part, Table):
        given = {k: getattr(part, k) for k in part.model_fields_set if k in type(part).model_fields}
        try:
            return type(part)(**given | {key: with_entries(getattr(part, key), group) for key, group in groups.items()})
        except UnknownNameError:
            raise
        except InputError as e:
            known = any(str(e).startswith(whole) for whole in entries)
            raise InputError(str(e) if known else f"{', '.join(entries)}: {e}") from None
    if isinstance(part, dict):
        return {**part, **{key: with_entries(part.get(key), group) for key, group in groups.items()}}
    return tuple(with_entries(x, groups[str(i)]) if str(i) in groups else x for i, x in enumerate(part))


def first_key(part: object, path: str, whole: str) -> tuple[str, str]:
    """Return the first key of a path, which may contain dots, and the rest of the path; list entries are numbered.

    Args:
        part: a checked table, a list or a dict.
        path: a path within ``part``.
        whole: the complete path, for messages.

    Raises:
        UnknownNameError: for an invalid path; lists the valid keys.
        InputError: for a name that several entries of a list have.
    """
    return _first_key(part, path, whole, entry_keys(part))


def _first_key(part: object, path: str, whole: str, keys: Mapping[str, str]) -> tuple[str, str]:
    if isinstance(part, dict):  # joint = value: the model checks the names of joints
        return path, ""
    name = path
    while name not in keys:
        name, dot, _ = name.rpartition(".")
        if not dot:
            above = whole.removesuffix(path).rstrip(".") or "the mechanism"
            raise UnknownNameError(f"entry of {above}", path, keys)
    if not keys[name]:
        raise InputError(f"{whole}: several entries are named {name!r}: give them different names")
    return keys[name], path[len(name) + 1 :]


def entry_at(part: Any, key: str) -> Any:
    """Return an entry of a table, a list or a dict by its key or index; None if a dict lacks it."""
    if isinstance(part, dict):
        return part.get(key)
    return part[int(key)] if isinstance(part, tuple) else getattr(part, key)


def entry_keys(part: object) -> dict[str, str]:
    """Return the valid next keys of a path, each with its key or index."""
    if isinstance(part, MechanismFile):
        return {k: k for k in TABLES}
    if isinstance(part, Table):
        return {k: k for k in type(part).model_fields}
    if isinstance(part, tuple):
        return entry_names(part) or {str(i): str(i) for i in range(len(part))}
    return {}


def entry_names(entries: tuple[Any, ...]) -> dict[str, str]:
    """Return the indices of the entries of a list of tables by name, "" of several; unnamed ones by kind and number."""
    out: dict[str, str] = {}
    for i, entry in enumerate(entries):
        if isinstance(entry, Table) and "name" in type(entry).model_fields:
            name = getattr(entry, "name", "") or f"{getattr(entry, 'kind', '')} {i + 1}".strip()
            out[name] = "" if name in out else str(i)
    return out
