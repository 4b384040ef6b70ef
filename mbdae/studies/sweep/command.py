"""The sub-command ``sweep``: a file of TOML, a table of runs."""

import sys
from typing import Any

import click

from ...cli.options import FAILED, PICTURES, RTOL, as_json, bar, emit, writable


@click.command()
@click.argument("file", type=click.Path(dir_okay=False), metavar="FILE.toml")
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="Keep the runs here, .parquet; takes pyarrow.")
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

    Runs that fail are rows with a status. Ctrl-C keeps what is finished; with -o the same command goes on from there.
    """
    from .plan import swept
    from .sweep import sweep as study
    from .toml_file import read_sweep

    written = writable((output, (".parquet",)), (plot, PICTURES))
    arguments = {**read_sweep(file), **{key: value for key, value in chosen.items() if value is not None}}
    said = {*arguments, *(name.removeprefix("solve.") for name in swept(arguments["parameters"]))}
    if not said & {"rtol", "step"}:
        arguments["rtol"] = RTOL
    with bar("sweep", 1.0) as tell:
        result = study(**arguments, path=output, fresh=fresh, progress=tell)
    if plot and result.complete:
        result.plot(plot)
    wrote = written if result.complete else []
    emit({**result.to_dict(), "written": wrote}, "\n".join([str(result), *(f"wrote {p}" for p in wrote)]), as_json)
    if not result.complete:
        kept = f"; {output}.part keeps what is finished, the same command goes on from there" if output else ""
        click.echo(f"mbdae: stopped by the user after {len(result)} of {result.total} runs{kept}", err=True)
        sys.exit(FAILED)
    if result.failed:
        click.echo(f"mbdae: {len(result.failed)} of {result.total} runs failed, see their status", err=True)
        sys.exit(FAILED if len(result.failed) == len(result) else 0)
