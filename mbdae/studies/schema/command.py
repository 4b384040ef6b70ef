"""The sub-command ``schema``."""

import json

import click

from .json_schema import FILES, json_schema


@click.command()
@click.argument("file", type=click.Choice(list(FILES)), default="mechanism")
def schema(file: str) -> None:
    """Print the JSON Schema of mechanism files or of sweep files, by which editors complete and check them.

    mbdae schema > mechanism.schema.json; the first line of a file then says: #:schema mechanism.schema.json
    """
    click.echo(json.dumps(json_schema(file), indent=1))
