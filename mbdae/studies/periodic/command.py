"""The sub-commands ``periodic`` and ``periodic-branch``."""

from typing import TYPE_CHECKING, Any

import click

from ...cli.model import ChosenModel
from ...cli.output import FAILED, HOLDS, PAGES, PLOT, TABLE, UNDECIDED, output_file
from ...cli.study_command import Result, Study, study_command
from ...errors import InputError

if TYPE_CHECKING:
    from ...mechanism import Mechanism
    from ...solution.solution import Solution

CODES = {"stable": HOLDS, "unstable": FAILED, "neutral": UNDECIDED, "doubtful": UNDECIDED}
PAGE = output_file(
    "--html",
    suffixes=PAGES,
    help="Write a replay of one period as one HTML page.",
    write=lambda found, path, given: found.animate(path),
)
OPTIONS = "T q v section symmetry exchange segments rtol"
OVER = click.argument("over", metavar="NAME=FIRST:LAST")


@study_command(OPTIONS, TABLE, PLOT, PAGE, shared="method units", exit_code=lambda found: CODES[found.stability])
def periodic(study: Study, model: ChosenModel, **options: Any) -> Result:
    """Find a periodic motion of a model and its stability. MODEL is also a run.npz that has nearly settled.

    Exit code 0 stable, 1 unstable or none found, 3 neutral or doubtful.
    """
    return study(_model_or_run(model), **_specified(options))


@study_command(OPTIONS, TABLE, PLOT, shared="method units", more=[OVER])
def periodic_branch(study: Study, model: ChosenModel, over: str, **options: Any) -> Result:
    """Follow a periodic motion over a parameter. Locates folds, doublings, Neimark-Sacker points, grazing."""
    name, first, last = _range(over)
    return study(model.name, name, first, last, start=model.start, **_specified(options))


def _specified(options: dict[str, Any]) -> dict[str, Any]:
    """Return the options that were specified."""
    return {name: x for name, x in options.items() if x is not None}


def _model_or_run(model: ChosenModel) -> "Mechanism | Solution":
    """Return the mechanism, or the run of a file.

    Raises:
        InputError: for start values of a run.
    """
    from ...solution.solution import Solution

    if not model.name.endswith(".npz"):
        return model.load()
    if model.start:
        raise InputError("--start is for models: a stored run has a start")
    return Solution.load(model.name)


def _range(text: str) -> tuple[str, float, float]:
    """Read ``name=first:last``.

    Raises:
        InputError: for anything else.
    """
    name, _, rest = text.partition("=")
    try:
        first, last = (float(x) for x in rest.split(":"))
    except ValueError:
        raise InputError(f"the range is name=first:last, got {text!r}") from None
    return name, first, last
