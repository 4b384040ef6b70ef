"""Shared parts of the sub-commands: options, tables, progress, exit codes."""

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


class TimeSpan(click.ParamType):
    """A number, or two with a comma."""

    name = "end|start,end"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """Read them."""
        try:
            times = tuple(float(text) for text in value.split(","))
        except ValueError:
            times = ()
        if len(times) not in (1, 2):
            self.fail(f"expected an end in s, or start,end, got {value!r}", param, ctx)
        return times


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
t_span_option = click.option(
    "-t", "--t-span", type=TimeSpan(), help="End time in s, or start,end; from 0 to the model's own when left out."
)
t_option = click.option("-t", "t", type=float, default=0.0, show_default=True, help="Time in s, for drivers.")
q_option = click.option(
    "--q", "q", multiple=True, help="Search from joint=value, in rad or m; else from the start."
)
v_option = click.option("--v", "v", multiple=True, help="A constant speed, joint=value, in rad/s or m/s.")
hold_option = click.option("--hold", multiple=True, help="A joint to lock where it starts.")
from_option = click.option("--from", "first", type=float, help="Start of the span, in rad or m; with --to.")
to_option = click.option("--to", "last", type=float, help="End of the span.")
methods_option = click.option(
    "-m", "--method", "methods", multiple=True, help="A method; several times for several.",
    shell_complete=methods_completed,
)  # fmt: skip
plot_option = click.option("--plot", type=click.Path(dir_okay=False), help="Draw a figure as .png, .svg or .pdf.")
table_option = click.option(
    "-o", "--output", type=click.Path(dir_okay=False), help="Save as a table .csv, all as .json, or in LaTeX as .tex."
)
PICTURES, PAGES, TABLES = (".png", ".svg", ".pdf"), (".html",), TABLE_SUFFIXES


def run_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options of a run that `simulate` takes, except the method."""
    for option in (project_option, formulation_option, step_option, atol_option, rtol_option, t_span_option):
        command = option(command)
    return command


def replay_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add display options of a replay: traces, arrows, the camera, the speed."""
    for option in (
        click.option("--closures", is_flag=True, help="Mark the closures, also those that are closed."),
        click.option("--follow", help="A joint whose body the camera follows."),
        click.option("--camera", help="front, top, side or 3d.  [default: as the motion wants]"),
        click.option("--arrows", "every", is_flag=True, help="Draw the forces of all closures."),
        click.option("--arrow", "arrows", multiple=True, help="A closure or joint whose force is drawn."),
        click.option("--trace", "traces", multiple=True, help="A frame whose path is drawn."),
        speed_option,
    ):
        command = option(command)
    return command


def panels(plots: tuple[str, ...]) -> list[tuple[str, ...]] | None:
    """Return the plots of a replay: signals, those with commas on common axes."""
    return [tuple(entry.split(",")) for entry in plots] or None


def writable(*paths: tuple[str | None, tuple[str, ...]]) -> list[str]:
    """Check files to be written before anything is computed; return those that are given.

    Raises:
        InputError: for an invalid suffix, or a folder that does not exist.
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


def span(mech: "Problem", t_span: tuple[float, ...] | None) -> tuple[float, float]:
    """The time span of an option: from 0 to an end or to the model's own, or from a start to an end.

    Raises:
        InputError: for an end alone that is not positive, or an empty span.
    """
    from ..integrate.span import checked_span

    start, *ends = t_span or (mech.duration,)
    return checked_span((start, *ends)) if ends else checked_span(start, end=True)


def span_of(first: float | None, last: float | None) -> tuple[float, float] | None:
    """The span of ``--from`` and ``--to``; None without both.

    Raises:
        InputError: for one of them without the other.
    """
    if (first is None) != (last is None):
        raise InputError("give both --from and --to, or none")
    return None if first is None or last is None else (first, last)


def simulate(
    mech: "Problem",
    *,
    method: str | None,
    t_span: tuple[float, ...] | None,
    rtol: float | None,
    step: float | None,
    **options: Any,
) -> "Solution":
    """Run a model from its start with a progress bar; None settings are those of its file, or the defaults.

    Raises:
        InputError: for tolerances together with a fixed step, and as for `mbdae.solve`.
    """
    from ..integrate.settings import completed
    from ..integrate.solve import solve

    if step is not None and (rtol is not None or options.get("atol") is not None):
        raise InputError("give --step for steps of one size, or --rtol and --atol for steps under control, not both")
    given = {"method": method, "rtol": rtol, "step": step, **options}
    with bar(str(completed(mech, given)["method"]), 1.0) as tell:
        return solve(mech, span(mech, t_span), progress=tell, **given)


def finish(sol: "Solution") -> None:
    """Exit 1, with the reason on stderr, if a run did not come to its end."""
    if not sol.success:
        click.echo(printable(f"mbdae: {sol.status}: {sol.message}"), err=True)
        sys.exit(FAILED)


def stopped(what: str) -> NoReturn:
    """Exit 1 after the user stopped a study, reporting on stderr whether partial results exist."""
    click.echo(printable(f"mbdae: stopped by the user {what}"), err=True)
    sys.exit(FAILED)


def emit(data: Any, text: str, as_json: bool) -> None:
    """Print a result as one JSON document, numbers that are not finite as null, or as text."""
    from ..tabular import finite

    click.echo(json.dumps(finite(data), allow_nan=False) if as_json else printable(text))


def show(rows: list[dict[str, Any]], as_json: bool) -> None:
    """Print rows as a table, or as JSON; on narrow screens words are wrapped, except in the first column."""
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
    """Return names of an option given several times, or once with commas; numbers belong to the name before."""
    return [text for value in values for text in re.split(r",(?=[A-Za-z])", value) if text]


def numbers(values: tuple[str, ...], kind: Any, name: str) -> list[Any] | None:
    """Return numbers of an option given several times, or once with commas; None when left out.

    Raises:
        InputError: naming the option.
    """
    try:
        return [kind(text) for value in values for text in value.split(",")] or None
    except ValueError:
        raise InputError(f"{name} takes numbers, got {', '.join(values)}") from None


def values_by_name(texts: tuple[str, ...], option: str) -> dict[str, Any]:
    """Return numbers of an option ``name=value`` given several times; several numbers with commas are a list.

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
