"""Output of commands: exit codes, text and JSON, tables, files."""

import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

import click

from ..data_types import Json
from ..errors import InputError, printable
from ..file_io import PICTURE_SUFFIXES, TABLE_SUFFIXES, VIDEO_SUFFIXES, find_latex

if TYPE_CHECKING:
    from ..solution.solution import Solution

HOLDS, FAILED, USAGE, UNDECIDED = 0, 1, 2, 3  # exit codes: success or claim holds, failed or refuted, usage, undecided
PICTURES, PAGES = PICTURE_SUFFIXES, (".html",)
TABLES, VIDEOS = TABLE_SUFFIXES, VIDEO_SUFFIXES


class OutputFile(NamedTuple):
    """A file that a command writes.

    Attributes:
        option: decorator with the option of its path.
        name: argument with the path.
        suffixes: valid suffixes.
        write: called with the result, the path and the other options of the command.
    """

    option: Callable[..., Any]
    name: str
    suffixes: tuple[str, ...]
    write: Callable[[Any, str, Mapping[str, Any]], Any]


def _save(result: Any, path: str, options: Mapping[str, Any]) -> None:
    result.save(path)


def output_file(
    *names: str,
    help: str,
    suffixes: tuple[str, ...] = TABLES,
    write: Callable[[Any, str, Mapping[str, Any]], Any] = _save,
    **settings: Any,
) -> OutputFile:
    """Return a file that a command writes, with the option of its path."""
    path = click.Path(dir_okay=False)
    option = click.option(*names, type=path, help=help, multiple=True, callback=_given_once, **settings)
    return OutputFile(option, names[-1].lstrip("-"), suffixes, write)


def _given_once(context: click.Context, option: click.Parameter, paths: tuple[str, ...]) -> str | None:
    """Return the only path of an option; click itself would silently take the last of several."""
    if len(paths) > 1:
        raise click.BadParameter(f"one file, got {', '.join(paths)}", context, option)
    return paths[0] if paths else None


TABLE = output_file("-o", "--output", help="Save as a table .csv, all as .json, or in LaTeX as .tex.")
PLOT = output_file(
    "--plot",
    help="Draw a figure as .png, .svg, .pdf or .pgf.",
    suffixes=PICTURES,
    write=lambda result, path, options: result.plot(path),
)


def writable(*paths: tuple[str | None, tuple[str, ...]]) -> list[str]:
    """Check output files before the computation; return the given paths.

    Raises:
        InputError: for an invalid suffix, a folder that does not exist, or a .pgf figure without LaTeX.
    """
    given = [(path, suffixes) for path, suffixes in paths if path]
    for path, suffixes in given:
        if Path(path).suffix not in suffixes:
            raise InputError(f"{path!r} must end in {' or '.join(suffixes)}")
        folder = Path(path).resolve().parent
        if not folder.is_dir():
            raise InputError(f"cannot write {path}: no such folder")
        if not os.access(folder, os.W_OK):
            raise InputError(f"cannot write {path}: the folder is read-only")
        if Path(path).suffix == ".pgf":
            find_latex()
    return [path for path, _ in given]


def exit_unless_successful(sol: "Solution") -> None:
    """Exit with code 1, and the reason on stderr, if a run was not successful."""
    if not sol.success:
        click.echo(printable(f"mbdae: {sol.status}: {sol.message}"), err=True)
        sys.exit(FAILED)


def exit_interrupted(what: str) -> NoReturn:
    """Exit with code 1 after the user stopped a study; print on stderr ``what`` is missing."""
    click.echo(printable(f"mbdae: stopped by the user {what}"), err=True)
    sys.exit(FAILED)


def emit(data: Json, text: str, as_json: bool) -> None:
    """Print a result as text, or as one JSON document with null for numbers that are not finite."""
    from ..tabular import finite

    click.echo(json.dumps(finite(data), allow_nan=False) if as_json else printable(text))


def print_table(rows: Sequence[Mapping[str, Json]], as_json: bool) -> None:
    """Print rows as a table, or as JSON; on narrow screens text is wrapped, except in the first column."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    if as_json:
        emit(rows, "", as_json)
        return
    table = Table(box=None, pad_edge=False, header_style="bold")
    for key in rows[0]:
        cells = [row[key] for row in rows]
        is_text = all(v is None or isinstance(v, str) for v in cells)
        width = max(len(str(v)) for v in [key, *cells]) if not is_text or not table.columns else None
        table.add_column(key, justify="left" if is_text else "right", min_width=width, no_wrap=width is not None)
    for row in rows:
        table.add_row(*("-" if v is None else Text(printable(str(v))) for v in row.values()))
    screen = sys.stdout.isatty()
    Console(width=None if screen else 1000, highlight=False, force_terminal=screen).print(table)
