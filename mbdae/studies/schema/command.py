"""Sub-command ``schema``."""

import json

import click

from ...cli.options import SHARED
from ...cli.output import emit


@click.command()
@click.argument("file", type=click.Choice(["mechanism", "sweep"]), default="mechanism")
@SHARED["json"]
def schema(file: str, as_json: bool) -> None:
    """Print the JSON Schema of mechanism files or sweep files. Editors use it for completion and validation.

    mbdae schema > mechanism.schema.json; then the first line of a file is: #:schema mechanism.schema.json
    """
    from .schema import schema as study

    found = study(file)
    emit(found, json.dumps(found, indent=1), as_json)
