"""Measurements: tables of times and signals, from CSV and Parquet files or as arrays."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError
from ...system import Array
from ..sensitivity.cost import real
from ..sweep.results_file import arrow

TIME = "t"
LARGEST = 1e150  # value


class Recording(NamedTuple):
    """What was measured in one run.

    Attributes:
        name: for messages: a file, or a number.
        t: times in s, rising, (n,).
        columns: signals at these times, (n,) each, nan where nothing was measured.
    """

    name: str
    t: Array
    columns: dict[str, Array]


def records(data: Any, signals: Sequence[str] = ()) -> list[Recording]:
    """Read data: a table or a file, or a list of them, one for each run.

    Args:
        data: tables ``{"t": ..., signal: ...}`` of equal length, or paths of CSV or Parquet files with such columns.
        signals: those that count; all when left out.

    Raises:
        InputError: for a table that is none; names the file and what is wrong with it.
    """
    several = data if isinstance(data, Sequence) and not isinstance(data, str) else [data]
    if not several:
        raise InputError("a fit needs data: a table of t and signals, or a CSV or Parquet file")
    return [_record(x, f"data {i + 1}", signals) for i, x in enumerate(several)]


def _record(data: Any, name: str, signals: Sequence[str]) -> Recording:
    if isinstance(data, str | Path):
        name, data = str(data), _read(Path(data))
    if not isinstance(data, Mapping):
        raise InputError(f"{name}: expected a table of t and signals, or the path of a file, got {data!r:.60}")
    try:
        columns = {str(key): real(x) for key, x in data.items()}
    except (TypeError, ValueError) as e:
        raise InputError(f"{name}: not a table of numbers: {e}") from None
    if TIME not in columns:
        raise InputError(f"{name}: there is no column {TIME!r} of times, but {', '.join(columns) or 'nothing'}")
    t = columns.pop(TIME)
    for signal in signals:
        if signal not in columns:
            raise InputError(f"{name}: there is no column {signal!r}, but {', '.join(columns)}")
    columns = {key: x for key, x in columns.items() if not signals or key in signals}
    if t.ndim != 1 or any(x.shape != t.shape for x in columns.values()) or not columns:
        raise InputError(f"{name}: expected a column t and signals of its length")
    rises = np.append(np.diff(t) > 0, np.isfinite(t[-1:]))
    if not rises.all():
        pair = t[(i := int(rises.argmin())) : i + 2]
        impact = ", as at an impact" if len(pair) == 2 and pair[0] == pair[1] else ""
        raise InputError(f"{name}: times must rise, got {', then '.join(f'{x:.9g}' for x in pair)}{impact}")
    for key, x in columns.items():
        if np.isinf(x).any():
            raise InputError(f"{name}: column {key!r} has a value that is infinite")
        if (np.abs(x) > LARGEST).any():
            raise InputError(f"{name}: column {key!r} has a value beyond {LARGEST:g}, of which no square is known")
    if not any(np.isfinite(x).any() for x in columns.values()):
        raise InputError(f"{name}: no signal has a value")
    return Recording(name, t, columns)


def _read(path: Path) -> dict[str, Any]:
    try:
        if path.suffix == ".parquet":
            table = arrow().parquet.read_table(path)
            return {name: np.array(table[name].to_pylist(), float) for name in table.column_names}
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.reader(file))
    except InputError:
        raise
    except Exception as e:  # pyarrow has errors of its own
        raise InputError(f"{path} cannot be read: {' '.join(str(e).split())}") from None
    if not any(rows[1:]):
        raise InputError(f"{path}: expected a line of names and lines of numbers")
    head = [name.strip() for name in rows[0]]
    twice = [name for i, name in enumerate(head) if name in head[:i]]
    if twice:
        raise InputError(f"{path}: two columns are named {twice[0]!r}")
    for i, row in enumerate(rows[1:], 2):
        if row and len(row) != len(head):
            raise InputError(f"{path}, line {i}: {len(row)} values under {len(head)} names")
    try:
        body = np.array([[float(x) if x.strip() else np.nan for x in row] for row in rows[1:] if row]).T
    except ValueError as e:
        raise InputError(f"{path}: {e}") from None
    return dict(zip(head, body, strict=True))
