"""Context of errors in a mechanism file: the file, the key path, and all unknown names at once."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeAlias

from ....errors import MbdaeError, UnknownNameError, printable
from ...imported_model import ImportedModel, mimic_couplings
from ...tree.frames import WORLD, frame_names, joint_names
from .schema import MechanismFile

REFERENCES = {"parent": "frame", "frame": "frame", "frames": "frame", "joint": "joint", "joints": "joint"}
REFERENCES |= {"closure": "closure"}  # keys whose values are names
TABLES = {"motor": "motor"} | dict.fromkeys(("lock", "joint_type", "q", "v", "guess", "guess_v"), "joint")

Known: TypeAlias = dict[str, list[str]]  # valid names of each kind


@contextmanager
def with_error_context(path: str, file: MechanismFile, models: Sequence[ImportedModel]) -> Iterator[None]:
    """Add the path of a file to errors, and report all unknown names together; no effect without a path.

    Args:
        path: path of the file.
        file: its contents.
        models: the imported models of its sources.
    """
    try:
        yield
    except MbdaeError as e:
        if path:
            unknown = _unknown(e, file, models) if isinstance(e, UnknownNameError) else []
            e.args = (printable(f"{path}: {'; '.join(unknown) or e}"),)
        raise


def _unknown(e: UnknownNameError, file: MechanismFile, models: Sequence[ImportedModel]) -> list[str]:
    """Return messages on all unknown names, by kind, with the valid names of each kind."""
    known, out = _known(file, models), list[str]()
    references = _invalid_references(e, file, known)
    for kind in dict.fromkeys(kind for kind, *_ in references):
        valid = e.valid if kind == e.kind != "frame" else known[kind]  # frames are resolved successively
        faults = {location: UnknownNameError(kind, name, valid) for of, location, name in references if of == kind}
        out += [f"{location}: {_fault(fault, file, known)}" for location, fault in faults.items()]
        out.append(next(iter(faults.values())).choice)
    return out


def _invalid_references(e: UnknownNameError, file: MechanismFile, known: Known) -> list[tuple[str, str, str]]:
    """Return kind, path and name of each reference to an unknown name, or to a joint that is locked."""
    references = [x for x in _references(file.model_dump()) if x[2] not in known[x[0]] or x[::2] == (e.kind, e.name)]
    return [x for x in references if x[2] not in known["joint"] or not x[1].startswith("lock.")]


def _fault(fault: UnknownNameError, file: MechanismFile, known: Known) -> str:
    is_locked = fault.kind == "joint" and fault.name in file.lock and fault.name in known["joint"]
    return f"joint {fault.name!r} is locked" if is_locked else fault.what


def _known(file: MechanismFile, models: Sequence[ImportedModel]) -> Known:
    """Return the valid names of each kind in a file."""
    sources = list(zip((s.prefix for s in file.source), models, strict=True))
    joints = [prefix + n for prefix, m in sources for n in joint_names(m.model)]
    joints += [body.name for body in file.body if body.joint != "fixed"]
    frames = [prefix + n for prefix, m in sources for n in frame_names(m.model)[1:]]
    named = [m.prefixed(prefix) for prefix, m in sources]
    closures = [c.name for m in named for c in (*m.closures, *mimic_couplings(m.mimics, {}, joints)[0])]
    return {
        "joint": joints,
        "frame": [WORLD, *frames, *(x.name for m in named for x in m.frames), *_names(file.body, file.frame)],
        "closure": [*closures, *_names(file.closure)],
        "motor": [motor.name for m in named for motor in m.motors],
    }


def _names(*tables: Iterable[Any]) -> list[str]:
    return [x.name for table in tables for x in table]


def _references(data: object, path: str = "") -> Iterator[tuple[str, str, str]]:
    """Yield kind, path and name of each reference in a file."""
    for key, value in _entries(data):
        label = value.get("name") or key if isinstance(value, dict) else key
        location = f"{path}.{label}" if path else str(label)
        kind = _kind_named_by(key, data)
        if kind and isinstance(value, str):
            yield kind, location, value
        elif kind and isinstance(value, tuple) and all(isinstance(name, str) for name in value):
            yield from ((kind, f"{location}.{i}", name) for i, name in enumerate(value))
        elif key in TABLES and isinstance(value, dict):
            yield from ((TABLES[key], f"{location}.{name}", name) for name in value)
        else:
            yield from _references(value, location)


def _entries(data: object) -> Iterable[tuple[Any, Any]]:
    if isinstance(data, dict):
        return data.items()
    return enumerate(data) if isinstance(data, list | tuple) else ()


def _kind_named_by(key: Any, data: Any) -> str | None:
    """Return the kind of object whose name is the value of a key; None for other keys, and for joint of a body."""
    return None if key == "joint" and "parent" in data else REFERENCES.get(str(key))
