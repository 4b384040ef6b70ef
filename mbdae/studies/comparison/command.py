"""Sub-command ``compare``."""

from typing import TYPE_CHECKING, Any

import click

from ...cli.completion import COMPARED, completed
from ...cli.model import ChosenModel
from ...cli.options import multiple_option
from ...cli.output import PLOT, TABLES, exit_interrupted, writable
from ...cli.runs import span
from ...cli.study_command import Output, Study, command
from ...errors import InputError, UnknownNameError
from ...progress import progress_bar

if TYPE_CHECKING:
    from .comparison import Comparison

FORMULATIONS = multiple_option(
    "--formulation", "formulations", kind="Iterable[str]", help="For methods without one: index2, project, ggl.",
    shell_complete=completed(lambda: COMPARED, files=False),
)  # fmt: skip
FILES = click.option(
    "-o",
    "--output",
    "outputs",
    type=click.Path(dir_okay=False),
    multiple=True,
    help="File of the runs, .csv or .json, from which the command resumes; or the table as .tex. Twice for both.",
)
QUANTITY = click.option(
    "--quantity", help="Quantity to draw: q, v or lam; y or z of a textbook problem.  [default: q or y]"
)


@command(
    "rtol steps repeats workers fresh",
    PLOT,
    shared="methods t_span backend units",
    more=[FORMULATIONS, QUANTITY, FILES],
)
def compare(
    study: Study,
    out: Output,
    model: ChosenModel,
    t_span: tuple[float, ...] | None,
    quantity: str | None,
    outputs: tuple[str, ...],
    **options: Any,
) -> None:
    """Compare errors, drift, work and time of methods. Also reports the most efficient method for a given accuracy.

    A method's name may follow a formulation and a colon: -m pherk5 -m ggl:pherk5 -m project:herk5 -m index1:dop853
    -m baumgarte=20,20:RK45. -m all takes every method that suits the model, and names the others. After Ctrl-C finished
    runs are shown; with -o they are stored, and the same command resumes from them.
    """
    written = [*writable(*((path, TABLES) for path in outputs)), *out.written]
    tables, files = ([p for p in outputs if p.endswith(".tex") is tex] for tex in (True, False))
    if len(files) > 1:
        raise InputError(f"the runs are stored in one file, got {' and '.join(files)}")
    output = files[0] if files else None
    problem = model.problem()
    _check_quantity(quantity, model)
    with progress_bar("compare", 1.0) as report_progress:
        result = study(problem, span(problem, t_span), progress=report_progress, path=output, **options)
    if result.points:
        for path in tables:
            result.save(path)
        if out.paths["plot"]:
            result.plot(out.paths["plot"], quantity)
    out.emit(result.to_dict(), str(result), written if result.points else [])
    if not result.complete:
        exit_interrupted(_unfinished(result, output))


def _check_quantity(quantity: str | None, model: ChosenModel) -> None:
    from .comparison import QUANTITIES, TEXTBOOK_QUANTITIES

    known = TEXTBOOK_QUANTITIES if model.textbook else tuple(QUANTITIES)
    if quantity is not None and quantity not in known:
        raise UnknownNameError("quantity", quantity, known)


def _unfinished(result: "Comparison", output: str | None) -> str:
    resume = f"; {output} has the finished runs, the same command resumes from them" if output else ""
    done, requested = len(result.points), result.requested
    return (f"after {done} of {requested} runs" if done < requested else "before all times were measured") + resume
