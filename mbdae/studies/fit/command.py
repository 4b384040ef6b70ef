"""Sub-command ``fit``."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import click

from ...cli.model import ChosenModel
from ...cli.output import FAILED, HOLDS, PAGES, PLOT, TABLE, UNDECIDED, output_file
from ...cli.study_command import Result, Study, study_command
from ...errors import InputError
from ...progress import progress_bar

if TYPE_CHECKING:
    from .result import Fit

DATA = (
    click.argument("data", nargs=-1, required=True, metavar="DATA.csv|.parquet..."),
    click.option("-p", "--parameter", "given", multiple=True, required=True, metavar="NAME=LOW:HIGH",
                 help="A parameter and its bounds; or NAME=START:LOW:HIGH. Several times for several."),
    click.option("--sigma", multiple=True, metavar="X|SIGNAL=X", help="Noise level of all signals, or of one."),
)  # fmt: skip
PAGE = output_file("--html", suffixes=PAGES, help="Write one page: signals, residuals, values.")


def _exit_code(result: "Fit") -> int:
    return FAILED if result.refuted or not result.converged else UNDECIDED if result.unidentifiable else HOLDS


@study_command(
    "signal starts seed",
    TABLE,
    PAGE,
    PLOT,
    shared="method rtol step units",
    more=DATA,
    types={"starts": click.IntRange(min=1), "seed": click.IntRange(min=0)},
    exit_code=_exit_code,
)
def fit(
    study: Study,
    model: ChosenModel,
    data: tuple[str, ...],
    given: tuple[str, ...],
    sigma: tuple[str, ...],
    **options: Any,
) -> Result:
    """Identify parameters of a model from measured signals.

    They are columns of CSV or Parquet files, named as by `mbdae solve`. Exit 1: residuals are not noise, or the search
    did not converge; 3: the data do not determine all parameters.
    """
    if options["step"] is not None and options["rtol"] is not None:
        raise InputError("give --step for a fixed step size, or --rtol for step-size control, not both")
    settings = {name: x for name, x in options.items() if x is not None}
    with progress_bar("fit", None) as report_progress:
        return study(
            model.source, _bounds(given), list(data), sigma=_levels(sigma), progress=report_progress, **settings
        )


def _bounds(texts: Iterable[str]) -> dict[str, tuple[float, ...]]:
    out: dict[str, tuple[float, ...]] = {}
    for text in texts:
        name, equals, bounds = text.rpartition("=")
        try:
            numbers = tuple(float(x) for x in bounds.split(":"))
        except ValueError:
            numbers = ()
        if not equals or len(numbers) not in (2, 3):
            raise InputError(f"-p takes NAME=LOW:HIGH or NAME=START:LOW:HIGH, got {text!r}")
        if name in out:
            raise InputError(f"parameter {name!r} is named twice")
        out[name] = numbers
    return out


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
