"""Sub-commands ``info`` and ``models``."""

import json
from typing import Any

import click

from ... import backend
from ...cli.completion import completed, problems
from ...cli.model import chosen_model, set_option, start_option
from ...cli.options import SHARED
from ...cli.output import emit, print_table
from ...discovery import MODEL_LIST, models_directory, robots_directory
from ...errors import InputError


@click.command()
@click.argument("model", required=False, shell_complete=completed(problems))
@start_option
@set_option
@SHARED["units"]
@SHARED["json"]
def info(model: str | None, start_values: tuple[str, ...], settings: tuple[str, ...], as_json: bool) -> None:
    """Show versions and the back end, or a model's card.

    The card has sizes, joints, closures, degrees of freedom, start, and what is not modelled; for a textbook problem
    its equations.
    """
    from .info import info as study

    found = study(chosen_model(model, start_values, settings).problem() if model else None)
    core = backend.status()
    emit({**found.to_dict(), "backend": core}, f"{found}\nback end: {core}" if model else str(found), as_json)


@click.command()
@click.option("--textbook", is_flag=True, help="List textbook problems instead, for solve, order and drift.")
@SHARED["json"]
def models(textbook: bool, as_json: bool) -> None:
    """List the models that come with mbdae."""
    if textbook:
        from ...textbook.problems import TEXTBOOK

        problems = [(name, make()) for name, make in TEXTBOOK.items()]
        print_table([{"name": n, "title": p.title, "ny": len(p.y0), "nz": len(p.z0)} for n, p in problems], as_json)
        return
    listed = json.loads((models_directory() / MODEL_LIST).read_text("utf-8"))
    print_table([_row(**model, complete=as_json) for model in listed], as_json)


def _row(
    name: str, title: str, sizes: dict[str, int], parameters: dict[str, str], robots: bool, complete: bool
) -> dict[str, Any]:
    """Return the title and sizes of a model, or why it is not installed; valid values if ``complete``."""
    try:
        if robots:
            robots_directory()
    except InputError as e:
        return {"name": name, "title": str(e)} | dict.fromkeys((*sizes, "parameters"))
    words = "; ".join(f"{name}: {values}" for name, values in parameters.items()) if complete else ", ".join(parameters)
    return {"name": name, "title": title, **sizes, "parameters": words or None}
