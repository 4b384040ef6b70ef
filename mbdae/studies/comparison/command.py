"""Sub-command ``compare``."""

from typing import Any

import click

from ...cli.completion import COMPARED, completed
from ...cli.model import ChosenModel, model_argument
from ...cli.options import (
    PICTURES,
    TABLES,
    as_json,
    backend_option,
    bar,
    emit,
    listed,
    methods_option,
    numbers,
    plot_option,
    span,
    stopped,
    t_span_option,
    writable,
)
from ...errors import InputError, UnknownNameError


@click.command()
@model_argument
@methods_option
@click.option("--formulation", "formulations", multiple=True, help="For methods without one: index2, project, ggl.",
              shell_complete=completed(lambda: COMPARED, files=False))  # fmt: skip
@t_span_option
@click.option("--rtol", multiple=True, help="Relative tolerances, 1e-3 to 1e-10 when left out: --rtol 1e-4,1e-6.")
@click.option("--steps", multiple=True, help="Numbers of fixed steps, instead of tolerances.")
@click.option("--repeats", type=int, default=3, show_default=True, help="Runs for the median of the wall time.")
@click.option("--workers", type=int, default=1, show_default=True, help="Processes; times are still taken one by one.")
@click.option("--quantity", help="To be drawn: q, v or lam; y or z of a textbook problem.  [default: q or y]")
@click.option(
    "-o",
    "--output",
    "outputs",
    type=click.Path(dir_okay=False),
    multiple=True,
    help="Keep the runs here, .csv or .json, and go on from there; or write the table in LaTeX, .tex. Twice for both.",
)
@click.option("--fresh", is_flag=True, help="Do not resume from the file, replace it.")
@backend_option
@plot_option
@as_json
def compare(
    model: ChosenModel,
    methods: tuple[str, ...],
    formulations: tuple[str, ...],
    t_span: tuple[float, ...] | None,
    rtol: tuple[str, ...],
    steps: tuple[str, ...],
    quantity: str | None,
    outputs: tuple[str, ...],
    fresh: bool,
    plot: str | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Compare methods on a model: errors, drift, work and time, and which method is best for an accuracy.

    A method's name may follow a formulation and a colon: -m pherk5 -m ggl:pherk5 -m project:herk5 -m index1:dop853
    -m baumgarte=20,20:RK45. Ctrl-C keeps what is finished; with -o the same command goes on from there.
    """
    from .compare import compare as study
    from .comparison import OF_TEXTBOOK, QUANTITIES

    written = writable(*((path, TABLES) for path in outputs), (plot, PICTURES))
    tables, files = ([p for p in outputs if p.endswith(".tex") is tex] for tex in (True, False))
    output = files[0] if files else None
    if len(files) > 1:
        raise InputError(f"the runs are kept in one file, got {' and '.join(files)}")
    problem = model.problem()
    known = OF_TEXTBOOK if model.textbook else tuple(QUANTITIES)
    if quantity is not None and quantity not in known:
        raise UnknownNameError("quantity", quantity, known)
    with bar("compare", 1.0) as tell:
        result = study(
            problem,
            span(problem, t_span),
            methods=listed(methods) or None,
            formulations=listed(formulations) or None,
            rtol=numbers(rtol, float, "--rtol"),
            steps=numbers(steps, int, "--steps"),
            progress=tell,
            path=output,
            fresh=fresh,
            **options,
        )
    for path in tables if result.points else ():
        result.save(path)
    if plot and result.points:
        result.plot(plot, quantity)
    wrote = written if result.points else []
    emit({**result.to_dict(), "written": wrote}, "\n".join([str(result), *(f"wrote {p}" for p in wrote)]), as_json)
    if not result.complete:
        kept = f"; {output} keeps what is finished, the same command goes on from there" if output else ""
        done, asked = len(result.points), result.asked
        stopped((f"after {done} of {asked} runs" if done < asked else "before all times were taken") + kept)
