"""Source files of a mechanism: read by the reader of their format, and reconstructed from their records."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...errors import InputError
from ..allowed_paths import AllowedPaths
from ..imported_model import ImportedModel
from ..model_serialization import model_from_data
from ..scene.shapes import unpack
from .body_tables import Source
from .model_library import resolve
from .readers import READERS, SOURCES, reader_of


def read_source(source: Source, base: Path) -> ImportedModel:
    """Read a source file, relative to ``base``.

    Raises:
        InputError: for a missing or invalid file, or a file of an unsupported kind.
    """
    path = resolve(source.file, base)
    if path.suffix not in SOURCES:
        raise InputError(f"cannot read source {path.name}: expected {', '.join(SOURCES)}")
    reader = reader_of(path)
    for option, reason in reader.rejected.items():
        if getattr(source, option):
            raise InputError(f"{option} {reason.format(path.name)}")
    return reader.read(path, AllowedPaths.from_model_file(path, [base, *(base / p for p in source.packages)]), source)


def restored(record: Mapping[str, Any], meshes: Sequence[Path] | None = None) -> ImportedModel:
    """Reconstruct an imported model from its ``record``, with its tree and visuals.

    Args:
        record: the record of an imported model.
        meshes: folders from which a saved run may read meshes, besides installed packages; None for models of this
            process, which read them from their original locations.

    Raises:
        InputError: for a damaged record.
    """
    for reader in READERS:
        if reader.restore and reader.name in record:
            return reader.restore(record, meshes)
    model = model_from_data(record["model"])
    return ImportedModel(model, unpack(record["visuals"], model.njoints), dict(record).copy)
