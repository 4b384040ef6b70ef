"""Sub-command ``report``."""

from typing import Any

import click

from ...cli.model import ChosenModel, model_argument
from ...cli.options import (
    PAGES,
    as_json,
    bar,
    emit,
    listed,
    methods_option,
    rtol_option,
    span,
    stopped,
    t_span_option,
    writable,
)


@click.command()
@model_argument
@click.option("-o", "--output", required=True, type=click.Path(dir_okay=False), help="The HTML page to write.")
@methods_option
@t_span_option
@rtol_option
@click.option("--repeats", type=int, default=3, show_default=True, help="Runs for the median of the wall time.")
@click.option("--workers", type=int, default=1, show_default=True, help="Processes of the comparison.")
@as_json
def report(
    model: ChosenModel,
    output: str,
    methods: tuple[str, ...],
    t_span: tuple[float, ...] | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Write one page on a model: card, run with replay, drift, orders and comparison, with all that repeats it.

    Ctrl-C writes what is finished.
    """
    from .report import report as study

    written = writable((output, PAGES))
    mech = model.load()
    with bar("report", 1.0) as tell:
        result = study(mech, span(mech, t_span), methods=listed(methods) or None, progress=tell, **options)
    try:
        result.save(output)
    except KeyboardInterrupt:
        emit({**result.to_dict(), "written": []}, str(result), as_json)
        stopped(f"before {output} was written")
    emit({**result.to_dict(), "written": written}, f"{result}\n\nwrote {output}", as_json)
    if result.missing:
        stopped(result.without)
