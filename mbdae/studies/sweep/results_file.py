"""The file of a sweep: an Arrow stream of finished runs, which is replaced by a Parquet file when all are finished.

Each run is appended to the stream ``runs.parquet.part`` as a record batch; runs that finish together are written at
once. All finished runs are readable after a crash. The same sweep resumes from it; an incomplete last batch is removed.
"""

import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import chain, repeat
from pathlib import Path
from types import ModuleType
from typing import Any

from ...errors import InputError
from ...file_io import atomic_write

PART, SUFFIX = ".part", ".parquet"
META = b"mbdae.sweep"
MORE = "more"  # results of functions, whose names are unknown until all runs are finished
Row = dict[str, Any]  # numbers, texts, arrays and lists, by column: `Kinds` has their types
Results = dict[str, Sequence[Any]]  # of k runs: columns, k values each
Kinds = Mapping[str, str]  # name of a column: int, float, text, bool or floats


class SweepFile:
    """File that stores each run of a sweep when it is finished.

    Args:
        path: path of the final Parquet file.
        kinds: kinds of the columns, by name.
        meta: JSON data; its ``"manifest"`` identifies the sweep.
        fresh: replace an existing file without reading it.

    Attributes:
        results: results of the runs that the file contains.

    Raises:
        InputError: without pyarrow; for a file that has another content, is in use, or cannot be written.
    """

    def __init__(self, path: Path, kinds: Kinds, meta: Mapping[str, Any], fresh: bool) -> None:
        if path.suffix != SUFFIX:
            raise InputError(f"the file of a sweep ends in {SUFFIX}, got {str(path)!r}")
        self.path, self.kinds, self.meta = path, kinds, meta
        self.schema = _schema({**kinds, MORE: MORE}, meta)
        self.results = results_of([])
        self.part = path.with_name(path.name + PART)
        self._file: int | None = None
        self._replace_old = fresh and path.exists()  # removed after the first run
        if not fresh and path.exists():
            self.results, found = read(path)
            self._require_same_sweep(found)
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
            self.results, found, end = _stream(content, self.part)
            self._require_same_sweep(found)
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
        different = [key for key in expected if expected[key] != stored.get(key)]
        if different:
            self.close()
            raise InputError(
                f"{self.path} has another sweep, with other {' and '.join(different)}: give another file, or delete it"
            )

    def append(self, results: Results) -> None:
        """Append finished runs, each as a record batch."""
        more = [list(x.items()) for x in results[MORE]]
        batch = arrow().RecordBatch.from_pydict({**results, MORE: more}, self.schema)
        if self._file is None:
            return
        data = memoryview(b"".join(batch.slice(i, 1).serialize() for i in range(len(more))))
        try:
            while data:
                data = data[os.write(self._file, data) :]
            if self._replace_old:
                self.path.unlink(missing_ok=True)
        except OSError as e:
            raise InputError(f"cannot write {self.part}, finished runs are stored: {e.strerror}") from None

    def finish(self, results: Results) -> None:
        """Write the Parquet file of all runs, and remove the stream."""
        if self._file is not None:
            write(self.path, results, self.kinds, self.meta)
            self.part.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the stream."""
        if self._file is not None:
            os.close(self._file)
            self._file = None


def results_of(rows: Sequence[Row]) -> Results:
    """Return the results of runs as columns; without runs, two empty ones."""
    return {name: [row[name] for row in rows] for name in rows[0]} if rows else {"run": [], MORE: []}


def join_results(parts: Sequence[Results]) -> Results:
    """Return the results of several parts in the order of their runs."""
    parts = sorted((part for part in parts if len(part["run"])), key=lambda part: part["run"][0])
    out: Results = {name: [*chain.from_iterable(x[name] for x in parts)] for name in (*parts, results_of([]))[0]}
    run = out["run"]
    if run == sorted(run):
        return out
    order = sorted(range(len(run)), key=run.__getitem__)
    return {name: [x[k] for k in order] for name, x in out.items()}


def write(path: Path, results: Results, kinds: Kinds, meta: Mapping[str, Any]) -> None:
    """Write results as Parquet, atomically; the same results give the same bytes.

    Raises:
        InputError: without pyarrow, or for an unwritable path.
    """
    pa, more = arrow(), results[MORE]
    names = sorted({name for x in more for name in x})
    columns = {**results, **{name: [x.get(name) for x in more] for name in names}}
    table = pa.Table.from_pydict(columns, _schema({**kinds, **dict.fromkeys(names, "float")}, meta))
    with atomic_write(path) as temporary:
        pa.parquet.write_table(table.combine_chunks(), temporary)


def read(path: Path) -> tuple[Results, dict[str, Any]]:
    """Read the results and the metadata of a sweep's file, or of its stream if that is incomplete.

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
    columns = table.to_pydict()
    more = {name: columns.pop(name) for name in list(columns) if name not in meta["kinds"]}
    by_run = zip(*more.values(), strict=True) if more else repeat((), table.num_rows)
    columns[MORE] = [{name: x for name, x in zip(more, row, strict=True) if x is not None} for row in by_run]
    return columns, meta


def _stream(content: bytes, path: Path) -> tuple[Results, dict[str, Any], int]:
    """Return the results in a stream, its metadata, and the end of its last complete batch."""
    pa, parts = arrow(), []
    source = pa.BufferReader(content)
    try:
        reader = pa.ipc.open_stream(source)
        end = source.tell()
        meta = _meta(reader.schema, path)
    except (OSError, ValueError, pa.ArrowException):
        raise InputError(f"{path} is not a file of a sweep, or damaged") from None
    with suppress(StopIteration, OSError, ValueError, pa.ArrowException):
        while True:
            part = reader.read_next_batch().to_pydict()
            parts.append({**part, MORE: [*map(dict, part[MORE])]})
            end = source.tell()
    return join_results(parts), meta, end


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
