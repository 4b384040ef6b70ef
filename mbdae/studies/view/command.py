"""The sub-command ``view``."""

import sys
from pathlib import Path

import click

from ...cli.options import PAGES, as_json, emit, writable
from ...mechanism import load


@click.command()
@click.argument("model")
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="The page to write.  [default: MODEL.html]")
@as_json
def view(model: str, output: str | None, as_json: bool) -> None:
    """Write one page on which a model is moved by sliders, with its limits and dead points; open it on a terminal."""
    from .view import view as study

    path = output or f"{Path(model).parent.name if Path(model).stem == 'mechanism' else Path(model).stem}.html"
    written = writable((path, PAGES))
    found = study(load(model))
    found.save(path)
    emit({**found.to_dict(), "written": written}, f"{found}\nwrote {path}", as_json)
    if not output and not as_json and sys.stdout.isatty():
        click.launch(path)
