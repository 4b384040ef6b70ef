"""Errors of a mechanism file, with the file and key path; all unknown names at once."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from ...errors import MbdaeError, UnknownNameError, printable
from ..frames import WORLD, frame_names, joint_names
from ..imported_model import ImportedModel, mimic_couplings
from .schema import MechanismFile

SAYS = {"parent": "frame", "frame": "frame", "frames": "frame", "joint": "joint", "joints": "joint"}
SAYS |= {"closure": "closure"}  # keys whose values are names, and tables name = value
TABLES = {"motor": "motor"} | dict.fromkeys(("lock", "joint_type", "q", "v", "guess", "guess_v"), "joint")


@contextmanager
def with_error_context(path: str, file: MechanismFile, parts: Sequence[ImportedModel]) -> Iterator[None]:
    """Add the path of a file to errors, and report all unknown names together; no effect without a path.

    Args:
        path: path of the file.
        file: its contents.
        parts: its imported sources.
    """
    try:
        yield
    except MbdaeError as e:
        if path:
            said = _unknown(e, file, parts) if isinstance(e, UnknownNameError) else []
            e.args = (printable(f"{path}: {'; '.join(said) or e}"),)
        raise


def _unknown(e: UnknownNameError, file: MechanismFile, parts: Sequence[ImportedModel]) -> list[str]:
    """Return the unknown name and all others, by kind, each with the valid names."""
    known, out = _known(file, parts), list[str]()
    uses = [use for use in _uses(file.model_dump()) if use[2] not in known[use[0]] or use[::2] == (e.kind, e.name)]
    for kind in dict.fromkeys(kind for kind, *_ in uses):
        valid = e.valid if kind == e.kind != "frame" else known[kind]  # frames are resolved one after the other
        faults = {place: UnknownNameError(kind, name, valid) for of, place, name in uses if of == kind}
        out += [f"{place}: {fault.what}" for place, fault in faults.items()]
        out.append(next(iter(faults.values())).choice)
    return out


def _known(file: MechanismFile, parts: Sequence[ImportedModel]) -> dict[str, list[str]]:
    """Return the valid names of each kind in a file."""
    sources = list(zip((s.prefix for s in file.source), parts, strict=True))
    joints = [prefix + n for prefix, part in sources for n in joint_names(part.model)]
    joints += [body.name for body in file.body if body.joint != "fixed"]
    frames = [prefix + n for prefix, part in sources for n in frame_names(part.model)[1:]]
    named = [part.prefixed(prefix) for prefix, part in sources]
    closures = [c.name for part in named for c in (*part.closures, *mimic_couplings(part.mimics, {}, joints)[0])]
    return {
        "joint": joints,
        "frame": [WORLD, *frames, *(x.name for part in named for x in part.frames), *_names(file.body, file.frame)],
        "closure": [*closures, *_names(file.closure)],
        "motor": [motor.name for part in named for motor in part.motors],
    }


def _names(*tables: Iterable[Any]) -> list[str]:
    return [x.name for table in tables for x in table]


def _uses(data: Any, path: str = "") -> Iterator[tuple[str, str, str]]:
    """Yield kind, place and name of each reference in a file."""
    for key, value in _entries(data):
        label = value.get("name") or key if isinstance(value, dict) else key
        here = f"{path}.{label}" if path else str(label)
        kind = _kind_named_by(key, data)
        if kind and isinstance(value, str):
            yield kind, here, value
        elif kind and isinstance(value, tuple) and all(isinstance(name, str) for name in value):
            yield from ((kind, f"{here}.{i}", name) for i, name in enumerate(value))
        elif key in TABLES and isinstance(value, dict):
            yield from ((TABLES[key], f"{here}.{name}", name) for name in value)
        else:
            yield from _uses(value, here)


def _entries(data: Any) -> Iterable[tuple[Any, Any]]:
    if isinstance(data, dict):
        return data.items()
    return enumerate(data) if isinstance(data, list | tuple) else ()


def _kind_named_by(key: Any, data: Any) -> str | None:
    """Return the kind of what a key refers to by name; None for other keys, and for a body's kind of joint."""
    return None if key == "joint" and "parent" in data else SAYS.get(str(key))
