"""Sub-command ``atlas``."""

from typing import Any

import click

from ...cli.completion import completed
from ...cli.output import exit_interrupted, output_file
from ...cli.study_command import Output, Study, command
from ...discovery import model_names
from ...progress import progress_bar

PAGE = output_file("-o", "--output", suffixes=(".html", ".json"), help="The HTML page to write; or a summary as .json.")
MODELS = click.argument("models", nargs=-1, metavar="[MODEL]...", shell_complete=completed(model_names))


@command(
    "rtol refinements data workers executor fresh",
    PAGE,
    shared="methods backend",
    subject=MODELS,
    types={"executor": click.Choice(["threads", "processes"])},
)
def atlas(study: Study, out: Output, models: tuple[str, ...], data: str | None, **options: Any) -> None:
    """Benchmark all methods on many models, on one page. All models that come with mbdae when none is named.

    The page works offline; models, families and errors are chosen in it, and each run has the command that repeats it.
    Ctrl-C writes the finished results; with --data they are stored, and the same command resumes from them.
    """
    with progress_bar("atlas", 1.0) as report_progress:
        result = study(models or None, data=data, progress=report_progress, **options)
    if result.runs and out.written:
        result.save(out.written[0])
    out.emit(result.to_dict(), str(result), out.written if result.runs else [])
    if not result.complete:
        resume = f"; {data} has the finished results, the same command resumes from them" if data else ""
        exit_interrupted(f"after {len(result.runs)} of {result.requested} pairs of a method and a model{resume}")
