"""The file of a sweep: an Arrow stream of finished runs, which is replaced by a Parquet file when all are finished.

Each run is appended to the stream ``runs.parquet.part`` as a record batch, those that finish together in one write, so
that all finished runs are readable after a crash. The same sweep resumes from it; an incomplete last batch is removed.
"""

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any

from ...errors import InputError
from ...file_io import atomic_write

PART, SUFFIX = ".part", ".parquet"
META = b"mbdae.sweep"
MORE = "more"  # results of functions, whose names are unknown until all runs are finished
Row = dict[str, Any]  # numbers, texts, arrays and lists, by column: `Kinds` has their types
Kinds = Mapping[str, str]  # name of a column: int, float, text, bool or floats


class SweepFile:
    """File that stores each run of a sweep when it is finished.

    Args:
        path: of the final Parquet file.
        kinds: the columns.
        meta: JSON data; its ``"manifest"`` identifies the sweep.
        fresh: replace an existing file without reading it.

    Attributes:
        rows: runs finished earlier, by number.

    Raises:
        InputError: without pyarrow; for a file of another sweep, another file, one in use, or an unwritable one.
    """

    def __init__(self, path: Path, kinds: Kinds, meta: Mapping[str, Any], fresh: bool) -> None:
        if path.suffix != SUFFIX:
            raise InputError(f"the file of a sweep ends in {SUFFIX}, got {str(path)!r}")
        self.path, self.kinds, self.meta = path, kinds, meta
        self.schema = _schema({**kinds, MORE: MORE}, meta)
        self.rows: dict[int, Row] = {}
        self.part = path.with_name(path.name + PART)
        self._file: int | None = None
        self._replace_old = fresh and path.exists()  # removed after the first run
        if not fresh and path.exists():
            rows, found = read(path)
            self._require_same_sweep(found)
            self.rows = {row["run"]: row for row in rows}
        else:
            self._open(fresh)

    def _open(self, fresh: bool) -> None:
        """Open the stream, read its batches, and remove an incomplete one."""
        try:
            self._file = os.open(self.part, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as e:
            raise InputError(f"cannot write {self.part}: {e.strerror}") from None
        self._lock()
        content = b"" if fresh else self.part.read_bytes()
        head = self.schema.serialize().to_pybytes()
        end = 0
        if len(content) >= len(head) or not head.startswith(content):
            rows, found, end = _stream(content, self.part)
            self._require_same_sweep(found)
            self.rows = {row["run"]: row for row in rows}
        os.ftruncate(self._file, end)
        os.lseek(self._file, end, os.SEEK_SET)
        if not end:
            os.write(self._file, head)

    def _lock(self) -> None:
        with suppress(ImportError):
            import fcntl

            try:
                fcntl.flock(self._file or 0, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                self.close()
                raise InputError(f"{self.part} is in use: another process computes this sweep") from None

    def _require_same_sweep(self, found: Mapping[str, Any]) -> None:
        expected, stored = self.meta["manifest"], found["manifest"]
        other = [key for key in expected if expected[key] != stored.get(key)]
        if other:
            self.close()
            raise InputError(
                f"{self.path} has another sweep, with other {' and '.join(other)}: give another file, or delete it"
            )

    def append(self, rows: Sequence[Row]) -> None:
        """Append finished runs, a record batch each."""
        batch = arrow().RecordBatch.from_pylist([{**row, MORE: list(row[MORE].items())} for row in rows], self.schema)
        if self._file is None:
            return
        data = memoryview(b"".join(batch.slice(i, 1).serialize() for i in range(len(rows))))
        try:
            while data:
                data = data[os.write(self._file, data) :]
            if self._replace_old:
                self.path.unlink(missing_ok=True)
        except OSError as e:
            raise InputError(f"cannot write {self.part}, finished runs are stored: {e.strerror}") from None

    def finish(self, rows: list[Row]) -> None:
        """Write the Parquet file of all runs, and remove the stream."""
        if self._file is not None:
            write(self.path, rows, self.kinds, self.meta)
            self.part.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the stream."""
        if self._file is not None:
            os.close(self._file)
            self._file = None


def write(path: Path, rows: Iterable[Row], kinds: Kinds, meta: Mapping[str, Any]) -> None:
    """Write rows as Parquet, atomically; the same rows give the same bytes.

    Raises:
        InputError: without pyarrow, or for an unwritable path.
    """
    pa, rows = arrow(), list(rows)
    more = sorted({name for row in rows for name in row[MORE]})
    table = pa.Table.from_pylist(
        [{**row, **row[MORE]} for row in rows], _schema({**kinds, **dict.fromkeys(more, "float")}, meta)
    )
    with atomic_write(path) as temporary:
        pa.parquet.write_table(table.combine_chunks(), temporary)


def read(path: Path) -> tuple[list[Row], dict[str, Any]]:
    """Read the rows and the metadata of a sweep's file, or of its stream if that is incomplete.

    Raises:
        InputError: without pyarrow, or for a missing or damaged file, or one without a sweep.
    """
    pa, part = arrow(), path.with_name(path.name + PART)
    if not path.exists() and part.exists():
        return _stream(part.read_bytes(), part)[:2]
    try:
        table = pa.parquet.read_table(path)
    except (OSError, ValueError, pa.ArrowException) as e:
        raise InputError(f"cannot read {path}: {' '.join(str(e).split())}") from None
    meta = _meta(table.schema, path)
    rows = table.to_pylist()
    for row in rows:
        more = {name: row.pop(name) for name in list(row) if name not in meta["kinds"]}
        row[MORE] = {name: x for name, x in more.items() if x is not None}
    return rows, meta


def _stream(content: bytes, path: Path) -> tuple[list[Row], dict[str, Any], int]:
    """Return the rows of a stream, its metadata, and the end of its last complete batch."""
    pa, rows = arrow(), []
    source = pa.BufferReader(content)
    try:
        reader = pa.ipc.open_stream(source)
        end = source.tell()
        meta = _meta(reader.schema, path)
    except (OSError, ValueError, pa.ArrowException):
        raise InputError(f"{path} is not a file of a sweep, or damaged") from None
    with suppress(StopIteration, OSError, ValueError, pa.ArrowException):
        while True:
            rows += reader.read_next_batch().to_pylist()
            end = source.tell()
    for row in rows:
        row[MORE] = dict(row[MORE])
    return rows, meta, end


def _meta(schema: Any, path: Path) -> dict[str, Any]:
    if META not in (schema.metadata or {}):
        raise InputError(f"{path} is not a file of a sweep")
    return json.loads(schema.metadata[META])


def _schema(kinds: Kinds, meta: Mapping[str, Any]) -> Any:
    pa = arrow()
    types = {
        "int": pa.int64(),
        "float": pa.float64(),
        "text": pa.string(),
        "bool": pa.bool_(),
        "floats": pa.list_(pa.float64()),
        MORE: pa.map_(pa.string(), pa.float64()),
    }
    return pa.schema([(name, types[kind]) for name, kind in kinds.items()], {META: json.dumps(meta).encode()})


def arrow() -> ModuleType:
    """Return the module pyarrow.

    Raises:
        InputError: if it is not installed.
    """
    try:
        import pyarrow.parquet
    except ImportError:
        raise InputError('the file of a sweep needs pyarrow: pip install "mbdae[sweep]"') from None
    return pyarrow
