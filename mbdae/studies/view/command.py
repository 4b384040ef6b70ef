"""Sub-command ``view``."""

import sys
from pathlib import Path

import click

from ...cli.model import ChosenModel, model_argument
from ...cli.options import PAGES, as_json, emit, writable


@click.command()
@model_argument
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="The page to write.  [default: MODEL.html]")
@as_json
def view(model: ChosenModel, output: str | None, as_json: bool) -> None:
    """Write one page on which a model is moved by sliders, with its limits and dead points; open it on a terminal."""
    from .view import view as study

    file = Path(model.name)
    path = output or f"{file.parent.name if file.stem == 'mechanism' else file.stem}.html"
    written = writable((path, PAGES))
    found = study(model.load())
    found.save(path)
    emit({**found.to_dict(), "written": written}, f"{found}\nwrote {path}", as_json)
    if not output and not as_json and sys.stdout.isatty():
        click.launch(path)
