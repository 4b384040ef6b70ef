"""Measurements: tables of times and signals, from CSV and Parquet files or as arrays."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...errors import InputError
from ...system import Array
from ..data_files import read_columns
from ..sensitivity.cost import real

TIME = "t"
LARGEST_VALUE = 1e150  # sums of whose squares are finite


class Recording(NamedTuple):
    """Measurements of one run.

    Attributes:
        name: name of the file or index of the table, for messages.
        t: times in s, strictly increasing, (n,).
        columns: signals at these times, (n,) each, nan for missing values.
        units: units of columns and of t, if the heading of a file has them.
    """

    name: str
    t: Array
    columns: dict[str, Array]
    units: Mapping[str, str] = {}


def read_recordings(data: object, signals: Sequence[str] = ()) -> list[Recording]:
    """Read data: a table or a file, or a list of them, one for each run.

    Args:
        data: tables ``{"t": ..., signal: ...}`` of equal length, or paths of CSV or Parquet files with such columns.
        signals: names of the signals to use; all when left out.

    Raises:
        InputError: for an invalid table; names the file and the error.
    """
    tables = data if isinstance(data, Sequence) and not isinstance(data, str) else [data]
    if not tables:
        raise InputError("a fit needs data: a table of t and signals, or a CSV or Parquet file")
    return [_read_recording(x, f"data {i + 1}", signals) for i, x in enumerate(tables)]


def _read_recording(data: object, name: str, signals: Sequence[str]) -> Recording:
    units: Mapping[str, str] = {}
    if isinstance(data, str | Path):
        name, (data, units, _) = str(data), read_columns(data)
    found = Recording(name, *_columns(data, name, signals), units)
    _check_times(found)
    _check_values(found)
    return found


def _columns(data: object, name: str, signals: Sequence[str]) -> tuple[Array, dict[str, Array]]:
    """Return the times of a table and the requested signals."""
    if not isinstance(data, Mapping):
        raise InputError(f"{name}: expected a table of t and signals, or the path of a file, got {data!r:.60}")
    try:
        columns = {str(key): real(x) for key, x in data.items()}
    except (TypeError, ValueError) as e:
        raise InputError(f"{name}: not a table of numbers: {e}") from None
    if TIME not in columns:
        raise InputError(f"{name}: there is no column {TIME!r} of times, only {', '.join(columns) or 'nothing'}")
    t = columns.pop(TIME)
    if missing := [signal for signal in signals if signal not in columns]:
        raise InputError(f"{name}: there is no column {missing[0]!r}, only {', '.join(columns)}")
    return t, {key: x for key, x in columns.items() if not signals or key in signals}


def _check_times(found: Recording) -> None:
    name, t = found.name, found.t
    if t.ndim != 1 or any(x.shape != t.shape for x in found.columns.values()) or not found.columns:
        raise InputError(f"{name}: expected a column t and signals of its length")
    increasing = np.append(np.diff(t) > 0, True) & np.isfinite(t)
    if not increasing.all():
        pair = t[(i := int(increasing.argmin())) : i + 2]
        impact = ", as at an impact" if len(pair) == 2 and pair[0] == pair[1] else ""
        raise InputError(f"{name}: times must increase, got {', then '.join(f'{x:.9g}' for x in pair)}{impact}")


def _check_values(found: Recording) -> None:
    name, columns = found.name, found.columns
    for key, x in columns.items():
        if np.isinf(x).any():
            raise InputError(f"{name}: column {key!r} has an infinite value")
        if (np.abs(x) > LARGEST_VALUE).any():
            raise InputError(f"{name}: column {key!r} has a value beyond {LARGEST_VALUE:g}, whose square may overflow")
    if not any(np.isfinite(x).any() for x in columns.values()):
        raise InputError(f"{name}: no signal has a value")
