"""Checks before MuJoCo reads an MJCF file: files must be on allowed paths, and counts must be limited.

MuJoCo does not check file names and counts, so both are checked first. The text is searched, not parsed: this finds all
attributes, and possibly text that is not an attribute, for instance in comments.
"""

import os
import re
from html import unescape
from math import prod
from pathlib import Path
from typing import NamedTuple

from ....errors import InputError
from ...allowed_paths import AllowedPaths, access_error

ATTRIBUTE = re.compile(rb"""([A-Za-z_]\w*)\s*=\s*("[^"]*"|'[^']*')""")
FOLDERS = ("meshdir", "texturedir", "assetdir")
MAX_COUNTS = {
    **dict.fromkeys(("count", "nkey", "nrow", "ncol"), 10_000),
    **dict.fromkeys(("width", "height"), 8_192),
    "gridsize": 144,
}
MAX_USER = 10_000  # largest value of ``nuser_body`` and similar attributes
NUMBER = re.compile(r"\d+(?:\.\d*)?(?:[eE]\+?\d+)?")
MAX_FOLDERS = 32  # folders of meshes and textures
REPLICATE = re.compile(rb"<replicate\b[^>]*>|</replicate\s*>")


class XmlFiles(NamedTuple):
    """XML files of a model.

    Attributes:
        main: file of the model.
        texts: contents of this file and of the files it names.
        by_name: file by the name used in the model.
    """

    main: Path
    texts: dict[Path, bytes]
    by_name: dict[str, Path]


def check_files(path: Path, allowed: AllowedPaths) -> XmlFiles:
    """Check the files that an MJCF file names, and return its XML files.

    Raises:
        InputError: for a file that is not allowed, or a number that is too large.
    """
    folders, names, counts = {""}, set[tuple[Path, str]](), dict[Path, float]()
    waiting, files = [path.resolve()], XmlFiles(path.resolve(), {}, {})
    while waiting:
        for file in waiting:
            found = file.read_bytes()
            files.texts[file], counts[file] = found, _replicated(found)
            for key, value in _attributes(found):
                _require_count(key, value, path.name)
                if key.startswith("file"):
                    names.add((file.parent, value))
                elif key in FOLDERS:
                    folders.add(value)
        if len(folders) > MAX_FOLDERS:
            raise InputError(f"{path.name} names more than {MAX_FOLDERS} folders of meshes and textures")
        candidates = {(base, n): _found(n, {base, files.main.parent}, folders, allowed) for base, n in names}
        files.by_name.update({n: found[0] for (_, n), found in candidates.items() if found})
        undecided = sorted({f for found in candidates.values() for f in found} - counts.keys())
        waiting = [f for f in undecided if _is_text(f)]
    if (copies := prod(counts.values())) > MAX_COUNTS["count"]:
        raise InputError(f"{path.name} replicates bodies {copies:.0f} times, beyond {MAX_COUNTS['count']}")
    return files


def _attributes(text: bytes) -> list[tuple[str, str]]:
    """Return names and values of attributes, both as written and with escapes resolved."""
    pairs = [(key.decode(), os.fsdecode(value[1:-1])) for key, value in ATTRIBUTE.findall(text)]
    return [*pairs, *((key, unescape(value)) for key, value in pairs if "&" in value)]


def _found(name: str, bases: set[Path], folders: set[str], allowed: AllowedPaths) -> list[Path]:
    """Return all files that MuJoCo may find for a name, possibly without its folders."""
    path = name.rpartition("://")[2]
    out = []
    for candidate in (base / folder / n for base in bases for folder in folders for n in {path, Path(path).name}):
        try:
            file = candidate.resolve()
            if file.is_dir() or not file.exists():
                continue
        except (OSError, ValueError, RuntimeError):  # not a path
            continue
        if not allowed.allows(file):
            raise access_error(name, file, allowed.root)
        if not file.is_file():
            raise InputError(f"{name!r} is not a regular file: {file}")
        out.append(file)
    return out


def _is_text(file: Path) -> bool:
    """Return whether a file is XML."""
    with file.open("rb") as stream:
        return stream.read(200).lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<")


def _require_count(key: str, value: str, name: str) -> None:
    largest = MAX_USER if key.startswith("nuser") else MAX_COUNTS.get(key)
    if largest is not None and _product(value) > largest:
        raise InputError(f"{name}: {key} = {value[:40]!r} is beyond {largest}")


def _product(value: str) -> float:
    """Return the product of the numbers above 1 in an attribute."""
    return prod(x for x in map(float, NUMBER.findall(value)) if x > 1)


def _replicated(text: bytes) -> float:
    """Return the number of copies made by replications, multiplied if nested; at least 1."""
    tags, nested = REPLICATE.findall(text), [(1.0, 0.0)]  # copies at each level, and of the replications inside
    for tag in [*tags, *[b"</"] * len(tags)]:  # tags may not be closed
        if tag.startswith(b"</") and len(nested) > 1:
            copies, inside = nested.pop()
            nested[-1] = nested[-1][0], nested[-1][1] + max(copies, inside)
        elif not tag.startswith(b"</") and not tag.endswith(b"/>"):
            nested.append((nested[-1][0] * _product(dict(_attributes(tag)).get("count", "")), 0.0))
    return max(nested[0])
