"""Reader of a file format: the suffixes of its files, and the function that imports a model."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..allowed_paths import AllowedPaths
from ..imported_model import ImportedModel
from .body_tables import Source

KEY = {"key": "belongs to an MJCF source, not to {}"}


@dataclass(frozen=True)
class Reader:
    """Reader of the sources of one format.

    Attributes:
        name: name of the format, which is also the key of its records for ``restore``.
        suffixes: suffixes of its files.
        read: imports the model of a file; arguments are the file, the allowed paths of further files, and the options
            of its source.
        root: root element of its XML files, if it shares suffixes with another format.
        rejected: options of a source that the format does not support, with the message; ``{}`` is the file name.
        restore: reconstructs a model from the record of `ImportedModel` and the folders from which a saved run may read
            meshes, see `mbdae.mechanism.formats.sources.restored`; None if the record contains the tree.
    """

    name: str
    suffixes: tuple[str, ...]
    read: Callable[[Path, AllowedPaths, Source], ImportedModel]
    root: str = ""
    rejected: Mapping[str, str] = field(default_factory=lambda: {**KEY, "free_flyer": "does not belong to {}"})
    restore: Callable[[Mapping[str, Any], Sequence[Path] | None], ImportedModel] | None = None
