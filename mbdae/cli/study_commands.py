"""The sub-commands that study a model: order, drift, compare, report."""

import re
import sys
from typing import Any

import click

from ..errors import InputError
from ..mechanism import load
from ..solution.solution import Solution
from ..studies.drift.drift import drift as measure_drift
from ..studies.drift.drift import history
from ..studies.order.order import check_order
from ..studies.variant import variants
from ..textbook.hessenberg import TEXTBOOK
from .options import (
    FAILED,
    HOLDS,
    PAGES,
    PICTURES,
    RTOL,
    UNJUDGED,
    as_json,
    atol_option,
    backend_option,
    bar,
    emit,
    finish,
    formulation_option,
    project_option,
    rtol_option,
    simulate,
    span,
    step_option,
    time_option,
    writable,
)

several = click.option("-m", "--method", "names", multiple=True, help="A method; several times for several.")
plot_option = click.option("--plot", type=click.Path(dir_okay=False), help="Draw a figure as .png, .svg or .pdf.")


def listed(values: tuple[str, ...]) -> list[str]:
    """Names of an option that is given several times, or once with commas; numbers belong to the name before."""
    return [text for value in values for text in re.split(r",(?=[A-Za-z])", value) if text]


def numbers(values: tuple[str, ...], kind: Any, name: str) -> list[Any] | None:
    """Numbers of an option that is given several times, or once with commas; None when it is left out.

    Raises:
        InputError: naming the option.
    """
    try:
        return [kind(text) for value in values for text in value.split(",")] or None
    except ValueError:
        raise InputError(f"{name} takes numbers, got {', '.join(values)}") from None


@click.command()
@click.argument("model")
@click.option("-m", "--method", "names", multiple=True, help="A method; several times for several; all when left out.")
@click.option("-t", "--time", "T", type=float, help="End time in s; the model's own when left out.")
@click.option("--steps", type=int, help="Coarsest number of steps, at least ten.")
@plot_option
@as_json
def order(
    model: str, names: tuple[str, ...], T: float | None, steps: int | None, plot: str | None, as_json: bool
) -> None:
    """Measure the orders of methods on a model: exit 1 when one misses its claim, 3 when one cannot be judged."""
    writable((plot, PICTURES))
    problem = TEXTBOOK[model]() if model in TEXTBOOK else load(model)
    with bar("order", None) as tell:
        study = check_order(problem, listed(names) or None, T=T, steps=steps, progress=tell)
    if plot:
        study.plot(plot)
    emit(study.to_dict(), str(study), as_json)
    sys.exit(FAILED if study.refuted else HOLDS if study.holds else UNJUDGED)


@click.command()
@click.argument("targets", nargs=-1, required=True, metavar="MODEL|RUN.npz...")
@several
@time_option
@rtol_option
@atol_option
@step_option
@formulation_option
@project_option
@click.option("--max", "limit", type=float, help="Exit 1 when |g|, |G v| or the relative energy error exceeds this.")
@plot_option
@as_json
def drift(
    targets: tuple[str, ...],
    names: tuple[str, ...],
    formulation: str,
    project: bool | None,
    limit: float | None,
    plot: str | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Measure the drift of runs of a model, or of saved solutions: a JSON object, or a list of them for several runs.

    Methods are names, or stand behind their formulation: -m pherk5 -m ggl:pherk5 -m index1:DOP853.
    """
    writable((plot, PICTURES))
    if limit is not None and not limit > 0:
        raise InputError(f"--max must be positive, got {limit}")
    given = any([names, formulation != "index2", *(value is not None for value in (project, *options.values()))])
    if given and all(target.endswith(".npz") for target in targets):
        raise InputError("a saved run has its method, time and tolerances: options of a run go with a model")
    if project and formulation != "index2":
        raise InputError(f"give --project or --formulation {formulation}, not both")
    sols = []
    chosen = variants(listed(names) or ["pherk6"], ["project" if project else formulation])
    for target in targets:
        if target.endswith(".npz"):
            sols.append(Solution.load(target))
        else:
            mech = load(target)
            sols += [simulate(mech, **v.arguments(), **options) for v in chosen]
    found = [measure_drift(sol) for sol in sols]
    if plot:
        from ..studies import figures
        from ..studies.figures_run import drifts

        figures.save(drifts([history(sol) for sol in sols]), plot)
    data = [f.to_dict() for f in found]
    emit(data[0] if len(data) == 1 else data, "\n".join(map(str, found)), as_json)
    if limit is not None and not max(max(f.g_max, f.Gv_max, f.energy_relative) for f in found) <= limit:
        sys.exit(FAILED)
    for sol in sols:
        finish(sol)


@click.command()
@click.argument("model")
@several
@click.option("--formulation", "formulations", multiple=True, help="For methods without one: index2, project, ggl.")
@time_option
@click.option("--rtol", multiple=True, help="Relative tolerances, 1e-3 to 1e-10 when left out: --rtol 1e-4,1e-6.")
@click.option("--steps", multiple=True, help="Numbers of fixed steps, instead of tolerances.")
@click.option("--repeats", type=int, default=3, show_default=True, help="Runs for the median of the wall time.")
@click.option("--workers", type=int, default=1, show_default=True, help="Processes; times are still taken one by one.")
@click.option("--quantity", type=click.Choice(["q", "v", "lam"]), default="q", show_default=True, help="To be drawn.")
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="Keep the runs here, .csv or .json.")
@click.option("--fresh", is_flag=True, help="Do not go on from the file, write it anew.")
@backend_option
@plot_option
@as_json
def compare(
    model: str,
    names: tuple[str, ...],
    formulations: tuple[str, ...],
    end: float | None,
    rtol: tuple[str, ...],
    steps: tuple[str, ...],
    quantity: Any,
    output: str | None,
    fresh: bool,
    plot: str | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Compare methods on a model: errors, drift, work and time, and which method is best for an accuracy.

    Methods are names, or stand behind their formulation: -m pherk5 -m ggl:pherk5 -m project:herk5 -m index1:DOP853
    -m baumgarte=20,20:RK45. Ctrl-C keeps what is finished; with -o the same command goes on from there.
    """
    from ..studies.comparison.compare import METHODS
    from ..studies.comparison.compare import compare as study

    written = writable((output, (".csv", ".json")), (plot, PICTURES))
    mech = load(model)
    with bar("compare", 1.0) as tell:
        result = study(
            mech,
            span(mech, end),
            methods=listed(names) or METHODS,
            formulations=listed(formulations) or None,
            rtol=numbers(rtol, float, "--rtol"),
            steps=numbers(steps, int, "--steps"),
            progress=tell,
            resume=output,
            fresh=fresh,
            **options,
        )
    if plot and result.points:
        result.plot(plot, quantity)
    wrote = written if result.points else []
    emit({**result.to_dict(), "written": wrote}, "\n".join([str(result), *(f"wrote {p}" for p in wrote)]), as_json)
    if not result.complete:
        click.echo("mbdae: stopped by the user" + (f"; {output} keeps what is finished" if output else ""), err=True)
        sys.exit(FAILED)


@click.command()
@click.argument("model")
@click.option("-o", "--output", required=True, type=click.Path(dir_okay=False), help="The HTML page to write.")
@several
@time_option
@rtol_option
@click.option("--repeats", type=int, default=3, show_default=True, help="Runs for the median of the wall time.")
@click.option("--workers", type=int, default=1, show_default=True, help="Processes of the comparison.")
@as_json
def report(model: str, output: str, names: tuple[str, ...], end: float | None, as_json: bool, **options: Any) -> None:
    """Write one page on a model: card, run with replay, drift, orders and comparison, with all that repeats it."""
    from ..studies.report.report import report as study

    written = writable((output, PAGES))
    mech = load(model)
    with bar("report", 1.0) as tell:
        options["rtol"] = RTOL if options["rtol"] is None else options["rtol"]
        result = study(mech, span(mech, end)[1], methods=listed(names) or None, progress=tell, **options)
    result.save(output)
    emit({**result.to_dict(), "written": written}, f"{result}\n\nwrote {output}", as_json)
