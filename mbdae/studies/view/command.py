"""Sub-command ``view``."""

import sys
from pathlib import Path

import click

from ...cli.model import ChosenModel
from ...cli.output import PAGES, output_file, writable
from ...cli.study_command import Output, Study, command

PAGE = output_file("-o", "--output", suffixes=PAGES, help="The page to write.  [default: MODEL.html]")


@command("", PAGE, shared="units")
def view(study: Study, out: Output, model: ChosenModel) -> None:
    """Write one page on which a model is moved by sliders. Shows its limits and dead points; opens it on a terminal."""
    file = Path(model.name)
    path = out.paths["output"] or f"{file.parent.name if file.stem == 'mechanism' else file.stem}.html"
    written = writable((path, PAGES))
    found = study(model.load())
    found.save(path)
    out.emit(found.to_dict(), str(found), written)
    if not out.written and not out.as_json and sys.stdout.isatty():
        click.launch(path)
