"""Parameters of many runs as columns: a value for each run, by name."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import Any

from ..data_types import Columns

Indices = Sequence[int]


def pick(values: Sequence[Any], which: Indices | slice) -> Sequence[Any]:
    """Return some of the values, by indices or a slice."""
    return values[which] if isinstance(which, slice) else [values[i] for i in which]


def pick_rows(columns: Columns, which: Indices | slice) -> dict[str, Sequence[Any]]:
    """Return the columns of some of the runs."""
    return {name: pick(values, which) for name, values in columns.items()}


def row(columns: Columns, i: int) -> dict[str, Any]:
    """Return the values of run i by name."""
    return {name: values[i] for name, values in columns.items()}


def equal_rows(columns: Columns, names: Iterable[str], n: int) -> list[Indices]:
    """Return the indices of runs with equal values of the named parameters, for n runs."""
    chosen = [columns[name] for name in names]
    if not chosen:
        return [range(n)] if n else []
    found = defaultdict[str, list[int]](list)
    for i, values in enumerate(zip(*chosen, strict=True)):
        found[repr(values)].append(i)  # 1, 1.0 and True differ
    return [*found.values()]
