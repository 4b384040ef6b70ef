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
    help="Keep the runs here, .csv or .json, and go on from there; or write the table in LaTeX, .tex. Twice for both.",
)
QUANTITY = click.option("--quantity", help="To be drawn: q, v or lam; y or z of a textbook problem.  [default: q or y]")


@command(
    "rtol steps repeats workers fresh",
    PLOT,
    shared="methods t_span backend",
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
    """Compare methods on a model: errors, drift, work and time, and which method is best for an accuracy.

    A method's name may follow a formulation and a colon: -m pherk5 -m ggl:pherk5 -m project:herk5 -m index1:dop853
    -m baumgarte=20,20:RK45. Ctrl-C keeps what is finished; with -o the same command goes on from there.
    """
    written = [*writable(*((path, TABLES) for path in outputs)), *out.written]
    tables, files = ([p for p in outputs if p.endswith(".tex") is tex] for tex in (True, False))
    if len(files) > 1:
        raise InputError(f"the runs are kept in one file, got {' and '.join(files)}")
    output = files[0] if files else None
    problem = model.problem()
    _check_quantity(quantity, model)
    with progress_bar("compare", 1.0) as tell:
        result = study(problem, span(problem, t_span), progress=tell, path=output, **options)
    if result.points:
        for path in tables:
            result.save(path)
        if out.paths["plot"]:
            result.plot(out.paths["plot"], quantity)
    out.emit(result.to_dict(), str(result), written if result.points else [])
    if not result.complete:
        exit_interrupted(_unfinished(result, output))


def _check_quantity(quantity: str | None, model: ChosenModel) -> None:
    from .comparison import OF_TEXTBOOK, QUANTITIES

    known = OF_TEXTBOOK if model.textbook else tuple(QUANTITIES)
    if quantity is not None and quantity not in known:
        raise UnknownNameError("quantity", quantity, known)


def _unfinished(result: "Comparison", output: str | None) -> str:
    kept = f"; {output} keeps what is finished, the same command goes on from there" if output else ""
    done, asked = len(result.points), result.requested
    return (f"after {done} of {asked} runs" if done < asked else "before all times were taken") + kept
