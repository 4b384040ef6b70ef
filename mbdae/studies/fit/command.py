"""Sub-command ``fit``."""

import sys
from typing import Any

import click

from ...cli.model import ChosenModel, model_argument
from ...cli.options import (
    FAILED,
    PAGES,
    PICTURES,
    TABLES,
    UNJUDGED,
    as_json,
    bar,
    emit,
    method_option,
    plot_option,
    rtol_option,
    step_option,
    table_option,
    writable,
)
from ...errors import InputError


@click.command()
@model_argument
@click.argument("data", nargs=-1, required=True, metavar="DATA.csv|.parquet...")
@click.option("-p", "--parameter", "given", multiple=True, required=True, metavar="NAME=LOW:HIGH",
              help="A parameter and its bounds; or NAME=START:LOW:HIGH. Several times for several.")  # fmt: skip
@click.option("-s", "--signal", "signals", multiple=True, help="A column that counts; all when left out.")
@click.option("--sigma", multiple=True, metavar="X|SIGNAL=X", help="Noise level of all signals, or of one.")
@method_option
@rtol_option
@step_option
@click.option("--starts", type=click.IntRange(min=1), default=1, help="Searches, from starts within the bounds.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of the places of other starts.")
@click.option("--html", type=click.Path(dir_okay=False), help="Write one page: signals, residuals, values.")
@table_option
@plot_option
@as_json
def fit(
    model: ChosenModel,
    data: tuple[str, ...],
    given: tuple[str, ...],
    signals: tuple[str, ...],
    sigma: tuple[str, ...],
    method: str | None,
    rtol: float | None,
    step: float | None,
    starts: int,
    seed: int,
    output: str | None,
    html: str | None,
    plot: str | None,
    as_json: bool,
) -> None:
    """Find numbers of a model from measured signals, columns of CSV or Parquet files named as those of `mbdae solve`.

    Exit 1: residuals are no noise, or the search did not end; 3: the data do not tell every parameter.
    """
    from .fit import fit as study

    if step is not None and rtol is not None:
        raise InputError("give --step for steps of one size, or --rtol for steps under control, not both")
    written = writable((output, TABLES), (html, PAGES), (plot, PICTURES))
    said = {"method": method, "step": step, "rtol": rtol}
    settings: dict[str, Any] = {name: x for name, x in said.items() if x is not None}
    parameters: dict[str, tuple[float, ...]] = {}
    for name, bounds in map(_bounds, given):
        if name in parameters:
            raise InputError(f"parameter {name!r} is named twice")
        parameters[name] = bounds
    with bar("fit", None) as tell:
        found = study(model.source, parameters, list(data), signals=signals, sigma=_levels(sigma),
                      starts=starts, seed=seed, progress=tell, **settings)  # fmt: skip
    for path in (output, html):
        if path:
            found.save(path)
    if plot:
        found.plot(plot)
    emit({**found.to_dict(), "written": written}, "\n".join([str(found), *(f"wrote {p}" for p in written)]), as_json)
    if found.refuted or not found.converged:
        sys.exit(FAILED)
    if found.untold:
        sys.exit(UNJUDGED)


def _bounds(text: str) -> tuple[str, tuple[float, ...]]:
    name, equals, bounds = text.rpartition("=")
    try:
        numbers = tuple(float(x) for x in bounds.split(":"))
    except ValueError:
        numbers = ()
    if not equals or len(numbers) not in (2, 3):
        raise InputError(f"-p takes NAME=LOW:HIGH or NAME=START:LOW:HIGH, got {text!r}")
    return name, numbers


def _levels(texts: tuple[str, ...]) -> float | dict[str, float] | None:
    try:
        if len(texts) == 1 and "=" not in texts[0]:
            return float(texts[0])
        pairs = [text.rpartition("=") for text in texts]
        levels = {name: float(x) for name, equals, x in pairs if equals}
    except ValueError:
        levels = {}
    if len(levels) < len(texts):
        raise InputError(f"--sigma takes a number, or SIGNAL=NUMBER for each signal, got {', '.join(texts)}")
    return levels or None
