"""The table of a sweep: a row for each run, as columns, as text, and in a file."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...data_types import JsonObject
from ...errors import STATUS, SUCCESS, InputError, UnknownNameError
from ...integrate.run.core_runs import COUNTS
from ...tabular import Columns, Tabular, align_columns
from ...units import displayed, unit_name
from .plan import Runs, names
from .results_file import MORE, Results, Row, read, write
from .sweep_run import FAILURES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Sweep"]

STATE = {"status": "text", "message": "text", "t": "float", **dict.fromkeys(COUNTS, "int"), "backend": "text"}
MAX_ROWS = 12  # largest number of rows in the text


@dataclass
class Sweep(Tabular):
    """The runs of a sweep, in the order of their numbers.

    Attributes:
        results: columns by name: number ``run``, parameters, ``seed``, ``status``, ``message``, end time ``t`` in s,
            counts of work, ``backend``, and outputs of the runs. Outputs of an incomplete run are None. Results of
            functions are tables ``more``.
        meta: manifest, names of parameters, of scalar outputs and of signals, and units where they are known.
        seconds: wall time of each run of this call, by number; not a column of the table, which is reproducible bit for
            bit.
        path: path of the file, if any.
    """

    results: Results
    meta: dict[str, Any] = field(repr=False)
    seconds: dict[int, float] = field(default_factory=dict, repr=False)
    path: Path | None = None

    @cached_property
    def rows(self) -> list[Row]:
        """The results of each run as a table."""
        return [dict(zip(self.results, row, strict=True)) for row in zip(*self.results.values(), strict=True)]

    @property
    def kinds(self) -> dict[str, str]:
        """Names and kinds of the columns, without results of functions."""
        return self.meta["kinds"]

    @property
    def parameters(self) -> list[str]:
        """Names of the parameters."""
        return self.meta["parameters"]

    @property
    def outputs(self) -> list[str]:
        """Names of the scalar outputs, results of functions last."""
        return [*self.meta["outputs"], *sorted({name for more in self.results[MORE] for name in more})]

    @property
    def samples(self) -> list[str]:
        """Names of the sampled signals."""
        return self.meta["samples"]

    @property
    def names(self) -> list[str]:
        """Names of all columns."""
        return list(dict.fromkeys([*self.kinds, *self.outputs]))

    @property
    def total(self) -> int:
        """Number of requested runs."""
        return self.meta["manifest"]["runs"]

    @property
    def complete(self) -> bool:
        """Whether every run has its row."""
        return len(self) == self.total

    @property
    def failed(self) -> list[Row]:
        """Rows of failed or incomplete runs."""
        return [row for row in self.rows if row["status"] not in SUCCESS]

    def __len__(self) -> int:
        return len(self.results["run"])

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a column as an array, (n,), or (n, times) for a signal; nan for missing values.

        Raises:
            UnknownNameError: for a column that does not exist.
        """
        if name not in self.names:
            raise UnknownNameError("column", name, self.names)
        if name not in self.results:
            values: Sequence[Any] = [more.get(name) for more in self.results[MORE]]
        else:
            values = self.results[name]
        if name in self.samples:
            return _padded(values)
        kind = self.kinds.get(name, "float")
        if kind == "float" or (kind == "int" and None in values):
            return np.array([np.nan if x is None else x for x in values], float)
        return np.array(values, object if kind in ("text", "floats") else None)

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        names = self.names
        rows = [{name: _json_value(_value(row, name)) for name in names} for row in self.rows]
        about = {key: self.meta[key] for key in ("manifest", "parameters", "samples")}
        return {"complete": self.complete, **about, "outputs": self.outputs, "rows": rows}

    def to_columns(self) -> Columns:
        """Return all columns by name, sampled signals as (n, times); units are those of parameters and signals."""
        return Columns({name: self[name] for name in self.names}, {"t": "s"} | self.meta.get("units", {}))

    def cells(self) -> list[list[str]]:
        """Return parameters, status and outputs of all runs."""
        names = ["run", *self.parameters, "status", *self.outputs]
        body = ([_text(_value(row, name), self._unit(name)) for name in names] for row in self.rows)
        return [[self._column_heading(name) for name in names], *body]

    def save(self, path: str | Path) -> None:
        """Write the table as .parquet, atomically and reproducibly, or as .csv, .json, .tex.

        Raises:
            InputError: for .parquet without pyarrow, for another suffix, or an unwritable path.
        """
        if Path(path).suffix != ".parquet":
            super().save(path)
            return
        write(Path(path), self.results, self.kinds, self.meta)

    def plot(self, path: str | Path | None = None, output: str | None = None) -> "Figure":
        """Draw a result of all runs over each parameter; saved if a path is given.

        Raises:
            UnknownNameError: for a column that does not exist.
            InputError: for another format, an unwritable path, or nothing to draw.
        """
        from .. import figures
        from .figure import spread

        return figures.save_if_path(spread(self, output), path)

    @classmethod
    def load(cls, path: str | Path) -> "Sweep":
        """Read the file of a sweep, also of an incomplete one.

        Raises:
            InputError: for a missing or damaged file, or one without a sweep.
        """
        return cls(*read(Path(path)), path=Path(path))

    def __str__(self) -> str:
        counts = Counter(self.results.get("status", ()))
        statuses = ", ".join(f"{n} {status}" for status, n in counts.most_common())
        remaining = "" if self.complete else f"; stopped, {self.total - len(self)} remain"
        headers, *body = self.cells()
        lines = [f"sweep of {self.meta['manifest']['model']}: {len(self)} runs, {statuses or 'none'}{remaining}", ""]
        lines += align_columns([headers, *body[:MAX_ROWS]])
        if len(self) > MAX_ROWS:
            lines.append(f"... and {len(self) - MAX_ROWS} more")
        if len(self) > 1 and self.outputs:
            lines += [
                "",
                *align_columns([["", "mean", "std", "min", "max"], *(self._summary(n) for n in self.outputs)]),
            ]
        for status in dict.fromkeys(row["status"] for row in self.failed):
            row = next(r for r in self.rows if r["status"] == status)
            reason = FAILURES.get(status) or STATUS.get(status, "")
            lines.append(f"{status}: {reason}, for instance run {row['run']}: {row['message']}")
        return "\n".join(lines)

    def _unit(self, name: str) -> str:
        return self.meta.get("units", {}).get(name, "")

    def _column_heading(self, name: str) -> str:
        unit = self._unit(name)
        return f"{name} ({unit_name(unit)})" if unit else name

    def _summary(self, name: str) -> list[str]:
        x = self[name]
        x, heading = displayed(x[np.isfinite(x)], self._unit(name))[0], self._column_heading(name)
        if not len(x):
            return [heading, "-", "-", "-", "-"]
        spread = x.std(ddof=1) if len(x) > 1 else 0.0
        return [heading, *(f"{v:.6g}" for v in (x.mean(), spread, x.min(), x.max()))]


def column_kinds(plan: Sequence[Runs], numbers: Sequence[str], samples: Sequence[str]) -> dict[str, str]:
    """Return names and kinds of the columns of a sweep.

    Raises:
        InputError: for a parameter with the name of another column, or with values of several kinds.
    """
    fixed = {"run": "int", "seed": "int", **STATE}
    swept = {n: _kind(n, [*chain.from_iterable(runs.columns.get(n, ()) for runs in plan)]) for n in names(plan)}
    for name in swept:
        if name in fixed or name == MORE:
            raise InputError(f"parameter {name!r} has the name of another column of the table: rename it")
    outputs = {**dict.fromkeys(numbers, "float"), **dict.fromkeys(samples, "floats")}
    return {"run": "int", **swept, "seed": "int", **STATE, **outputs}


def _kind(name: str, values: Sequence[object]) -> str:
    kinds = {type(x) for x in values}
    if int in kinds and max(abs(x) for x in values if isinstance(x, int)) >= 2**63:
        raise InputError(f"parameter {name!r} takes whole numbers of 64 bits")
    if kinds <= {int, float}:
        return "int" if kinds == {int} else "float"
    if len(kinds) > 1:
        raise InputError(f"parameter {name!r} takes values of one kind, got {', '.join(map(repr, values[:4]))}")
    return {bool: "bool", str: "text", list: "floats"}[kinds.pop()]


def _padded(values: Sequence[Any]) -> np.ndarray:
    """Return a signal of n runs, (n, times); nan for runs without it."""
    width = max((len(x) for x in values if x is not None), default=0)
    return np.array([np.full(width, np.nan) if x is None else x for x in values]).reshape(len(values), width)


def _value(row: Row, name: str) -> Any:
    """Return the value of a column or of a function result; None if missing."""
    return row[name] if name in row else row[MORE].get(name)


def _text(value: object, unit: str) -> str:
    if value is None:
        return "-"
    number = isinstance(value, float) or (unit and isinstance(value, int))
    return f"{displayed(value, unit)[0]:.6g}" if number else str(value)


def _json_value(value: object) -> Any:
    if isinstance(value, np.ndarray | list):
        return [_json_value(x) for x in np.asarray(value).tolist()]
    return None if isinstance(value, float) and not np.isfinite(value) else value
