"""The sub-commands ``order`` and ``methods``: what is observed, and what is claimed."""

import sys
from typing import TYPE_CHECKING, Any

import click

from ...cli.model import ChosenModel, problem_argument
from ...cli.options import (
    FAILED,
    HOLDS,
    PICTURES,
    TABLES,
    UNJUDGED,
    as_json,
    bar,
    emit,
    listed,
    methods_completed,
    plot_option,
    show,
    stopped,
    table_option,
    writable,
)
from ...errors import InputError

if TYPE_CHECKING:
    from .result import OrderStudy


@click.command()
@problem_argument
@click.option("-m", "--method", "names", multiple=True, help="A method; several times for several; all when left out.",
              shell_complete=methods_completed)  # fmt: skip
@click.option("-t", "--time", "T", type=float, help="End time in s; the model's own when left out.")
@click.option("--steps", type=int, help="Coarsest number of steps, at least ten.")
@click.option("--gradients", is_flag=True, help="Of derivatives, and those beside difference quotients of runs.")
@click.option("-p", "--parameter", help="With --gradients: by this number; by a velocity of the start when left out.")
@table_option
@plot_option
@as_json
def order(
    model: ChosenModel,
    names: tuple[str, ...],
    T: float | None,
    steps: int | None,
    gradients: bool,
    parameter: str | None,
    output: str | None,
    plot: str | None,
    as_json: bool,
) -> None:
    """Measure the orders of methods on a model: exit 1 when one misses its claim, 3 when one cannot be judged.

    For up to three methods it shows step sizes, errors, and the rates between them. Ctrl-C keeps the methods that are
    finished.
    """
    from .gradients import check_gradients
    from .order import check_order

    if parameter is not None and not gradients:
        raise InputError("a parameter belongs to --gradients")
    written = writable((output, TABLES), (plot, PICTURES))
    if gradients and model.textbook:
        raise InputError(f"gradients are those of mechanisms, {model.name!r} is a textbook problem")
    problem = model.problem()
    with bar("order", None) as tell:
        options: dict[str, Any] = {"T": T, "steps": steps, "progress": tell}
        if gradients:
            study: OrderStudy = check_gradients(model.load(), listed(names) or None, parameter=parameter, **options)
        else:
            study = check_order(problem, listed(names) or None, **options)
    if plot:
        study.plot(plot)
    if output:
        study.save(output)
    emit({**study.to_dict(), "written": written}, "\n".join([str(study), *(f"wrote {p}" for p in written)]), as_json)
    if study.missing:
        done, left = len(study.slopes), ", ".join(study.missing)
        stopped(f"after {done} of {done + len(study.missing)} methods; {left} are left")
    sys.exit(FAILED if study.refuted else HOLDS if study.holds else UNJUDGED)


@click.command()
@click.option("--check", is_flag=True, help="Prove the claimed orders on index-2 trees.")
@click.argument("names", nargs=-1, shell_complete=methods_completed)
@as_json
def methods(check: bool, names: tuple[str, ...], as_json: bool) -> None:
    """List the methods with their claims, or check their order conditions exactly."""
    from ...methods import METHODS, method
    from ...methods.order.conditions import check_conditions

    chosen = [method(n) for n in names or METHODS]
    if check:
        reports = [check_conditions(m) for m in chosen]
        emit([r.to_dict() for r in reports], "\n\n".join(str(r) for r in reports), as_json)
        sys.exit(HOLDS if all(r.holds for r in reports) else FAILED)
    data = [
        {
            "name": m.name,
            "family": m.family,
            "order": m.order,
            "f linear in z": m.order_linear,
            "own lam": m.order_own,
            "embedded": m.order_embedded or None,
            "solves": m.solves,
            "title": m.title,
        }
        for m in chosen
    ]
    show(data, as_json)
