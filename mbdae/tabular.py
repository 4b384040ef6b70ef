"""Presentation of results: as text and in notebooks, as columns in files, pandas and xarray, and as LaTeX tables."""

import csv
import json
import math
import re
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from markupsafe import escape

from .data_types import JsonObject
from .errors import InputError
from .file_io import TABLE_SUFFIXES, atomic_write
from .tolerances import SOLUTION_ROUNDING
from .units import ONE, displayed, displayed_units, si_value

if TYPE_CHECKING:
    import pandas
    import xarray

HEADING = re.compile(r"(.*\S) \[(.*)\]")  # heading of a column with a unit
SEPARATOR = re.compile(r"[;\t]")  # separators of other programs, instead of commas
POWER = re.compile(r"(<?)(-?[\d.]+)e([+-]?\d+)")
SPECIAL = {c: rf"\{c}" for c in "&%$#_{}"} | {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}"} | {
    "^": r"\textasciicircum{}", "|": "$|$", "<": "$<$", ">": "$>$"
}  # fmt: skip


class Columns(NamedTuple):
    """Named columns of equal length.

    Attributes:
        values: by name, (n,) each, or (n, k) where a row has several numbers.
        units: units of the columns that have one.
        over: the independent column; "" for row numbers.
    """

    values: Mapping[str, Any]
    units: Mapping[str, str] = {}
    over: str = ""

    def displayed(self) -> "Columns":
        """Return the columns in the units in which results are shown, see `mbdae.display_units`."""
        converted = {n: displayed(np.asarray(x), self.units[n]) for n, x in self.values.items() if n in self.units}
        units = {name: unit for name, (_, unit) in converted.items()}
        return Columns({**self.values, **{name: x for name, (x, _) in converted.items()}}, units, self.over)

    def write_csv(self, path: str | Path) -> None:
        """Write the columns as .csv; units other than SI are in the headings, ``"q.crank [deg]"``."""
        shown, with_units = self.displayed(), bool(displayed_units().chosen)
        headers = {name: f"{name} [{unit}]" for name, unit in shown.units.items() if unit and with_units}
        write_csv({headers.get(name, name): x for name, x in shown.values.items()}, path)


class Tabular:
    """Base class of the results of studies: display in notebooks, tables in files.

    ``__str__`` describes a result, with a heading in the first line. A result may have a table of text (`cells`) and
    columns of numbers for further processing (`to_columns`).
    """

    def cells(self) -> list[list[str]]:
        """Return the table as text, headings first; empty if there is no table."""
        return []

    def remarks(self) -> list[str]:
        """Return lines of text below the table."""
        return []

    def to_columns(self) -> Columns:
        """Return named columns of equal length.

        Raises:
            InputError: for a result without columns.
        """
        raise InputError(f"{type(self).__name__} has no columns: see its to_dict()")

    def to_dict(self) -> JsonObject:
        """Return JSON data: the columns."""
        return {name: _as_list(x) for name, x in self.to_columns().values.items()}

    def to_pandas(self) -> "pandas.DataFrame":
        """Return the columns as a ``pandas.DataFrame``, units by column in ``attrs["units"]``.

        Raises:
            InputError: without pandas, or for a result without columns.
        """
        pandas, columns = optional_package("pandas"), self.to_columns().displayed()
        frame = pandas.DataFrame({n: list(x) if np.ndim(x) > 1 else x for n, x in columns.values.items()})
        frame.attrs |= {"title": self._heading(), "units": dict(columns.units)}
        return frame

    def to_xarray(self) -> "xarray.Dataset":
        """Return the columns as an ``xarray.Dataset`` over their independent column, with ``attrs["units"]``.

        Raises:
            InputError: without xarray, or for a result without columns.
        """
        xarray, columns = optional_package("xarray"), self.to_columns().displayed()
        dim = columns.over or "row"
        arrays = {}
        for name, x in columns.values.items():
            dims = (dim, "sample")[: max(1, np.ndim(x))]
            arrays[name] = (dims, np.asarray(x), {"units": columns.units[name]} if name in columns.units else {})
        coords = {dim: arrays.pop(dim)} if dim in arrays else {}
        return xarray.Dataset(arrays, coords, {"title": self._heading()})

    def to_latex(self) -> str:
        r"""Return the table as a LaTeX ``tabular``, for a document with ``\usepackage{booktabs}``.

        Raises:
            InputError: for a result without a table.
        """
        cells = self.cells()
        if not cells:
            raise InputError(f"{type(self).__name__} has no table for LaTeX")
        return latex(cells, self._heading())

    def save(self, path: str | Path) -> None:
        """Write the columns as .csv, all data as .json, or the table as .tex.

        Raises:
            InputError: for another suffix, a result without columns or table, or an unwritable path.
        """
        suffix = Path(path).suffix
        if suffix not in TABLE_SUFFIXES:
            raise InputError(f"{type(self).__name__} is saved as {' or '.join(TABLE_SUFFIXES)}, got {str(path)!r}")
        if suffix == ".csv":
            self.to_columns().write_csv(path)
            return
        text = self.to_latex() if suffix == ".tex" else json.dumps(finite(self.to_dict()), allow_nan=False)
        with atomic_write(path) as temporary:
            temporary.write_text(text, "utf-8")

    def _heading(self) -> str:
        return str(self).partition("\n")[0]

    def _repr_html_(self) -> str | None:
        """HTML representation in notebooks."""
        first, _, rest = str(self).partition("\n")
        cells = self.cells()
        cells[:1] = [["" if cell == first else cell for cell in row] for row in cells[:1]]  # the title is printed above
        body = table(cells) if cells else f"<pre>{escape(rest)}</pre>" if rest else ""
        below = "".join(f"<div>{escape(line)}</div>" for line in self.remarks()) if cells else ""
        return f"<div><strong>{escape(first)}</strong>{body}{below}</div>"


def optional_package(package: str) -> ModuleType:
    """Import an optional package.

    Raises:
        InputError: if it is not installed; the message names it.
    """
    try:
        return import_module(package)
    except ImportError:
        raise InputError(f"this needs the package {package!r}, which is not installed: pip install {package}") from None


def rounded_zero(x: float, scale: float = 1.0) -> float:
    """Return a number, or 0 if it is a rounding error relative to a scale in the same unit."""
    return 0.0 if abs(x) <= SOLUTION_ROUNDING * scale else float(x)


def align_columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return lines of aligned columns, the first left-aligned, all other columns right-aligned."""
    widths = [max(len(row[j]) for row in rows) for j in range(len(rows[0]))]
    padded = [[c.rjust(w) for c, w in zip(row, widths, strict=True)] for row in rows]
    return ["  ".join([row[0].ljust(widths[0]), *cells[1:]]).rstrip() for row, cells in zip(rows, padded, strict=True)]


def table(cells: Sequence[Sequence[str]]) -> str:
    """Return an HTML table, headings first; columns of text are left-aligned. Cells of type `Markup` are HTML."""
    texts = text_columns(cells[1:]) or [False] * len(cells[0])
    alignments = [' style="text-align: left"' if is_text else "" for is_text in texts]
    head, *body = (
        "".join(f"<{tag}{alignment}>{escape(c)}</{tag}>" for c, alignment in zip(row, alignments, strict=True))
        for tag, row in zip(["th", *len(cells[1:]) * ["td"]], cells, strict=True)
    )
    lines = "".join(f"<tr>{row}</tr>" for row in body)
    return f'<div class="wide"><table><tr>{head}</tr>{lines}</table></div>'


def text_columns(rows: Sequence[Sequence[str]]) -> list[bool]:
    """Return for each column whether a cell begins with a letter, so that it is text; empty without rows."""
    return [any(cell[:1].isalpha() for cell in column) for column in zip(*rows, strict=True)]


def latex(cells: Sequence[Sequence[str]], heading: str = "") -> str:
    """Return a LaTeX table, headings first, with powers of ten for numbers like 1.2e-05; the heading is a comment."""
    headers, *rows = ([_cell(c) for c in row] for row in cells)
    body = [" & ".join(row) + r" \\" for row in (headers, *rows)]
    above = [f"% {heading}", r"% \usepackage{booktabs}", rf"\begin{{tabular}}{{l{'r' * (len(headers) - 1)}}}"]
    return "\n".join([*above, r"\toprule", body[0], r"\midrule", *body[1:], r"\bottomrule", r"\end{tabular}", ""])


def _cell(text: str) -> str:
    match = POWER.fullmatch(text)
    if match:
        return rf"${match[1]}{match[2]} \times 10^{{{int(match[3])}}}$"
    return "".join(SPECIAL.get(c, c) for c in text)


def write_csv(columns: Mapping[str, Any], path: str | Path) -> None:
    """Write columns of equal length as comma-separated values; an (n, k) column is split into k columns, from 0."""
    flat: dict[str, Any] = {}
    for name, x in columns.items():
        flat |= {name: x} if np.ndim(x) < 2 else {f"{name}[{i}]": column for i, column in enumerate(np.asarray(x).T)}
    with atomic_write(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(flat)
        out.writerows(zip(*(_as_list(x) for x in flat.values()), strict=True))


def read_csv(path: str | Path) -> Columns:
    """Return the columns of comma-separated values below a line of names, (n,) each; nan for empty cells.

    A column with a unit in its heading, ``"q.crank [deg]"``, as `Columns.write_csv` writes it, is converted to SI, and
    the result has its unit in ``units``; other columns are not converted.

    Raises:
        InputError: for a file that cannot be read, a duplicate name, or a cell that is not a number.
    """
    rows = _lines(path)
    names, units = zip(*(_without_unit(name.strip()) for name in rows[0]), strict=True)
    if duplicates := [name for i, name in enumerate(names) if name in names[:i]]:
        raise InputError(f"{path}: two columns are named {duplicates[0]!r}")
    for i, row in enumerate(rows[1:], 2):
        if row and len(row) != len(names):
            raise InputError(f"{path}, line {i}: {len(row)} values under {len(names)} names")
    body = np.array([[_number(x, path, i) for x in row] for i, row in enumerate(rows[1:], 2) if row]).T
    values = {name: (si_value(unit) or ONE).apply(x) for name, unit, x in zip(names, units, body, strict=True)}
    return Columns(values, {name: unit for name, unit in zip(names, units, strict=True) if unit})


def _number(cell: str, path: str | Path, line: int) -> float:
    try:
        return float(cell) if cell.strip() else np.nan
    except ValueError:
        raise InputError(f"{path}, line {line}: {cell!r:.60} is not a number") from None


def _lines(path: str | Path) -> list[list[str]]:
    """Return the cells of all lines, names first."""
    try:
        with Path(path).open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.reader(file))
    except (OSError, ValueError, csv.Error) as e:
        raise InputError(f"{path} cannot be read: {e}") from None
    if not any(rows[1:]):
        raise InputError(f"{path}: expected a line of names and lines of numbers")
    if len(rows[0]) == 1 and SEPARATOR.search(rows[0][0]):
        raise InputError(f"{path}: cells are separated by commas, decimals by points, got the line {rows[0][0]!r:.60}")
    return rows


def _without_unit(heading: str) -> tuple[str, str]:
    """Return the name and the unit in the heading of a column; "" if it has no unit."""
    match = HEADING.fullmatch(heading)
    return (match[1], match[2]) if match and si_value(match[2]) else (heading, "")


def finite(data: object) -> Any:
    """Return data with None in place of numbers that are not finite, as in JSON."""
    if isinstance(data, dict):
        return {key: finite(x) for key, x in data.items()}
    if isinstance(data, list | tuple):
        return [finite(x) for x in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data


def _as_list(x: Any) -> list[Any]:
    return x.tolist() if isinstance(x, np.ndarray) else list(x)
