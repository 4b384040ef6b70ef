"""What the sub-commands share: options, tables, progress, exit codes."""

import json
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from ..backend import BACKENDS
from ..errors import InputError, printable
from ..file_io import TABLE_SUFFIXES
from ..integrate.defaults import DEFAULTS
from ..progress import progress_bar as bar
from .completion import FORMULATIONS, completed, methods

if TYPE_CHECKING:
    from ..solution.solution import Problem, Solution

HOLDS, FAILED, USAGE, UNJUDGED = 0, 1, 2, 3  # exit codes: holds, failed or refuted, wrong usage, cannot be judged
as_json = click.option("--json", "as_json", is_flag=True, help="Print one JSON document.")
methods_completed = completed(methods)
method_option = click.option(
    "-m", "--method", help=f"A name of `mbdae methods`; the model's own, or {DEFAULTS['method']}.",
    shell_complete=methods_completed,
)  # fmt: skip
rtol_option = click.option("--rtol", type=float, help=f"Relative tolerance; the model's own, or {DEFAULTS['rtol']:g}.")
atol_option = click.option("--atol", type=float, help="Absolute tolerance; 0.01 rtol when left out.")
step_option = click.option("--step", type=float, help="Fixed step in s, instead of tolerances.")
formulation_option = click.option(
    "--formulation",
    shell_complete=completed(lambda: FORMULATIONS, files=False),
    help="index2; ggl: positions of closures kept too; index1: accelerations, -m dop853, or scipy's RK45, ...",
)
project_option = click.option(
    "--project/--no-project", default=None, help="Bring the state back to the closures after each step, or not."
)
backend_option = click.option(
    "--backend", type=click.Choice(BACKENDS), default="auto", show_default=True, help="The compiled core, or Python."
)
SPEEDS = click.FloatRange(min=0, min_open=True)
speed_option = click.option("--speed", type=SPEEDS, help="Replay at this speed.  [default: 1, slower if short]")
time_option = click.option("-t", "--time", "end", type=float, help="End time in s; the model's own when left out.")
methods_option = click.option(
    "-m", "--method", "names", multiple=True, help="A method; several times for several.",
    shell_complete=methods_completed,
)  # fmt: skip
plot_option = click.option("--plot", type=click.Path(dir_okay=False), help="Draw a figure as .png, .svg or .pdf.")
table_option = click.option(
    "-o", "--output", type=click.Path(dir_okay=False), help="Save as a table .csv, all as .json, or in LaTeX as .tex."
)
PICTURES, PAGES, TABLES = (".png", ".svg", ".pdf"), (".html",), TABLE_SUFFIXES


def run_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options of a run that `simulate` takes, but for the method."""
    for option in (project_option, formulation_option, step_option, atol_option, rtol_option, time_option):
        command = option(command)
    return command


def replay_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """How a replay shows the motion: traces, arrows, the camera, the speed."""
    for option in (
        click.option("--closures", is_flag=True, help="Mark the closures, also those that are closed."),
        click.option("--follow", help="A joint whose body the camera follows."),
        click.option("--camera", help="front, top, side or 3d.  [default: as the motion wants]"),
        click.option("--arrows", "every", is_flag=True, help="Draw the forces of all closures."),
        click.option("--arrow", "arrow", multiple=True, help="A closure or joint whose force is drawn."),
        click.option("--trace", "traces", multiple=True, help="A frame whose path is drawn."),
        speed_option,
    ):
        command = option(command)
    return command


def panels(plots: tuple[str, ...]) -> list[tuple[str, ...]] | None:
    """Plots of a replay: signals, those with commas on common axes."""
    return [tuple(entry.split(",")) for entry in plots] or None


def writable(*paths: tuple[str | None, tuple[str, ...]]) -> list[str]:
    """Check files to be written before anything is computed; return those that are named.

    Raises:
        InputError: for a suffix that does not belong, or a folder that does not exist.
    """
    named = [(path, suffixes) for path, suffixes in paths if path]
    for path, suffixes in named:
        if Path(path).suffix not in suffixes:
            raise InputError(f"{path!r} must end in {' or '.join(suffixes)}")
        folder = Path(path).resolve().parent
        if not folder.is_dir():
            raise InputError(f"cannot write {path}: no such folder")
        if not os.access(folder, os.W_OK):
            raise InputError(f"cannot write {path}: the folder is read-only")
    return [path for path, _ in named]


def span(mech: "Problem", end: float | None) -> tuple[float, float]:
    """The time span from 0 to an end, or to the model's own.

    Raises:
        InputError: for an end that is not positive.
    """
    from ..integrate.span import checked_span

    return checked_span(mech.duration if end is None else end, end=True)


def simulate(
    mech: "Problem", *, method: str | None, end: float | None, rtol: float | None, step: float | None, **options: Any
) -> "Solution":
    """Run a model from its start with a progress bar; settings that are None are those of its file, or the defaults.

    Raises:
        InputError: for tolerances beside a fixed step, and as `mbdae.solve`.
    """
    from ..integrate.settings import completed
    from ..integrate.solve import solve

    if step is not None and (rtol is not None or options.get("atol") is not None):
        raise InputError("give --step for steps of one size, or --rtol and --atol for steps under control, not both")
    given = {"method": method, "rtol": rtol, "step": step, **options}
    with bar(str(completed(mech, given)["method"]), 1.0) as tell:
        return solve(mech, span(mech, end), progress=tell, **given)


def finish(sol: "Solution") -> None:
    """Exit 1, with the reason on stderr, when a run did not come to its end."""
    if not sol.success:
        click.echo(printable(f"mbdae: {sol.status}: {sol.message}"), err=True)
        sys.exit(FAILED)


def stopped(what: str) -> NoReturn:
    """Exit 1 where the user stopped a study, with what there is of it, or is not, on stderr."""
    click.echo(printable(f"mbdae: stopped by the user {what}"), err=True)
    sys.exit(FAILED)


def emit(data: Any, text: str, as_json: bool) -> None:
    """Print a result as one JSON document, numbers that are not finite as null, or as text."""
    from ..tabular import finite

    click.echo(json.dumps(finite(data), allow_nan=False) if as_json else printable(text))


def show(rows: list[dict[str, Any]], as_json: bool) -> None:
    """Print rows as a table, or as JSON; where the screen is narrow, words are wrapped, but for the first of a row."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    if as_json:
        emit(rows, "", as_json)
        return
    table = Table(box=None, pad_edge=False, header_style="bold")
    for key in rows[0]:
        cells = [row[key] for row in rows]
        words = all(v is None or isinstance(v, str) for v in cells)
        least = max(len(str(v)) for v in [key, *cells]) if not words or not table.columns else None
        table.add_column(key, justify="left" if words else "right", min_width=least, no_wrap=least is not None)
    for row in rows:
        table.add_row(*("-" if v is None else Text(printable(str(v))) for v in row.values()))
    screen = sys.stdout.isatty()
    Console(width=None if screen else 1000, highlight=False, force_terminal=screen).print(table)


def listed(values: tuple[str, ...]) -> list[str]:
    """Names of an option that is given several times, or once with commas; numbers belong to the name before."""
    return [text for value in values for text in re.split(r",(?=[A-Za-z])", value) if text]


def numbers(values: tuple[str, ...], kind: Any, name: str) -> list[Any] | None:
    """Numbers of an option that is given several times, or once with commas; None when it is left out.

    Raises:
        InputError: naming the option.
    """
    try:
        return [kind(text) for value in values for text in value.split(",")] or None
    except ValueError:
        raise InputError(f"{name} takes numbers, got {', '.join(values)}") from None


def values_by_name(texts: tuple[str, ...], option: str) -> dict[str, Any]:
    """Numbers of an option ``name=value`` that is given several times; several numbers with commas are a list.

    Raises:
        InputError: naming the option.
    """
    out: dict[str, Any] = {}
    for text in texts:
        name, _, value = text.partition("=")
        found = numbers((value,), float, f"{option} {name}") if value else None
        if not found:
            raise InputError(f"{option} takes name=value, got {text!r}")
        out[name] = found[0] if len(found) == 1 else found
    return out
