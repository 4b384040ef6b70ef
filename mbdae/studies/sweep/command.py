"""The sub-command ``sweep``: a file of TOML, a table of runs."""

import sys
from pathlib import Path
from typing import Any

import click

from ...cli.options import FAILED, PICTURES, TABLES, as_json, bar, emit, stopped, writable

KEPT = ".parquet"


@click.command()
@click.argument("file", type=click.Path(dir_okay=False), metavar="FILE.toml")
@click.option(
    "-o", "--output", type=click.Path(dir_okay=False), help="Save as .csv, .json or .tex; .parquet keeps each run."
)
@click.option("--workers", type=int, help="Threads or processes; one for each processor when left out.")
@click.option(
    "--executor",
    type=click.Choice(["threads", "processes"]),
    help="Threads when left out, with the core; else processes.",
)
@click.option("--fresh", is_flag=True, help="Do not go on from the file, write it anew.")
@click.option("--plot", type=click.Path(dir_okay=False), help="Draw the first output as .png, .svg or .pdf.")
@as_json
def sweep(file: str, output: str | None, fresh: bool, plot: str | None, as_json: bool, **chosen: Any) -> None:
    """Run a model for many values of its parameters, as a file of TOML says: a grid, a list or a random sample.

    Runs that fail are rows with a status. Ctrl-C writes what is finished; a .parquet file, which takes pyarrow, keeps
    each run, and the same command goes on from there.
    """
    from .sweep import sweep as study
    from .toml_file import read_sweep

    written = writable((output, (KEPT, *TABLES)), (plot, PICTURES))
    path = output if output and Path(output).suffix == KEPT else None
    arguments = {**read_sweep(file), **{key: value for key, value in chosen.items() if value is not None}}
    with bar("sweep", 1.0) as tell:
        result = study(**arguments, path=path, fresh=fresh, progress=tell)
    wrote = written if result.complete else [output] if output and not path and len(result) else []
    if output in wrote and not path:
        result.save(output)
    if plot and result.complete:
        result.plot(plot)
    emit({**result.to_dict(), "written": wrote}, "\n".join([str(result), *(f"wrote {p}" for p in wrote)]), as_json)
    if not result.complete:
        kept = f"; {path}.part keeps what is finished, the same command goes on from there" if path else ""
        stopped(f"after {len(result)} of {result.total} runs{kept}")
    if result.failed:
        click.echo(f"mbdae: {len(result.failed)} of {result.total} runs failed, see their status", err=True)
        sys.exit(FAILED if len(result.failed) == len(result) else 0)
