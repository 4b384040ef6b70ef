"""File format: the suffixes of its files, and the function that makes a tree of one."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..allowed_paths import AllowedPaths
from ..imported_model import ImportedModel
from .schema import Source

KEY = {"key": "belongs to an MJCF source, not to {}"}


@dataclass(frozen=True)
class Reader:
    """Reads the sources of one format.

    Attributes:
        name: of the format; the key by which a record is known that ``restore`` takes.
        suffixes: of its files.
        read: makes a part of a file, with the folders in which further files may be, and the options of its source.
        root: the first element of its XML files, where it shares suffixes with another format.
        refused: options of a source that it does not have, and what is said then; ``{}`` is the file's name.
        restore: makes a part again from the record of `ImportedModel`, and the folders from which a saved run may read
            meshes, see `mbdae.mechanism.formats.sources.restored`; None where the record is the tree itself.
    """

    name: str
    suffixes: tuple[str, ...]
    read: Callable[[Path, AllowedPaths, Source], ImportedModel]
    root: str = ""
    refused: Mapping[str, str] = field(default_factory=lambda: {**KEY, "free_flyer": "does not belong to {}"})
    restore: Callable[[Mapping[str, Any], Sequence[Path] | None], ImportedModel] | None = None
