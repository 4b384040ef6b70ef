"""The sub-command ``sweep``: from a TOML file to a table of runs."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...cli.output import FAILED, PICTURES, TABLES, exit_interrupted, output_file
from ...cli.study_command import Output, Study, command
from ...progress import progress_bar as bar

if TYPE_CHECKING:
    from .table import Sweep

STORED = ".parquet"
TABLE = output_file(
    "-o", "--output", suffixes=(STORED, *TABLES), help="Save as .csv, .json or .tex; .parquet stores each run."
)
FIGURE = output_file("--plot", suffixes=PICTURES, help="Draw the first output as .png, .svg, .pdf or .pgf.")
FILE = click.argument("file", type=click.Path(dir_okay=False), metavar="FILE.toml")


@command(
    "workers executor fresh", TABLE, FIGURE, shared="units", subject=FILE,
    types={"executor": click.Choice(["threads", "processes"])},
)
def sweep(study: Study, out: Output, file: str, fresh: bool, **chosen: Any) -> None:
    """Run a model for many values of its parameters. They are a grid, a list or a random sample, from a TOML file.

    Failed runs are rows with a status. Ctrl-C writes the finished runs; a .parquet file, which needs pyarrow, stores
    each run, and the same command resumes from it.
    """
    from .toml_file import read_sweep

    output = out.paths["output"]
    path = output if output and Path(output).suffix == STORED else None
    arguments = read_sweep(file) | {key: value for key, value in chosen.items() if value is not None}
    with bar("sweep", 1.0) as report_progress:
        result = study(**arguments, path=path, fresh=fresh, progress=report_progress)
    if output and not path and (result.complete or len(result)):
        result.save(output)
    if not result.complete:
        out.emit(result.to_dict(), str(result), [output] if output and not path and len(result) else [])
        resume = f"; {path}.part has the finished runs, the same command resumes from them" if path else ""
        exit_interrupted(f"after {len(result)} of {result.total} runs{resume}")
    if out.paths["plot"]:
        result.plot(out.paths["plot"])
    out.emit(result.to_dict(), str(result))
    _finish(result)


def _finish(result: "Sweep") -> None:
    """Exit 1 if all runs failed, with a line on stderr if any did."""
    if result.failed:
        click.echo(f"mbdae: {len(result.failed)} of {result.total} runs failed, see their status", err=True)
        sys.exit(FAILED if len(result.failed) == len(result) else 0)
