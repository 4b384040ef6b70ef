"""The sub-commands ``order``, ``check-gradients`` and ``methods``: observed and claimed orders."""

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NoReturn

import click

from ...cli.model import ChosenModel, model_argument, problem_argument
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


METHODS_OR_ALL = click.option("-m", "--method", "methods", multiple=True, shell_complete=methods_completed,
                              help="A method; several times for several; all when left out.")  # fmt: skip
END = click.option("-t", "--T", "T", type=float, help="End time in s; the model's own when left out.")
STEPS = click.option("--steps", type=int, help="Coarsest number of steps, at least ten.")


def study_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Methods, end, steps and files of an order study."""
    for option in (as_json, plot_option, table_option, STEPS, END, METHODS_OR_ALL):
        command = option(command)
    return command


@click.command()
@problem_argument
@study_options
def order(
    model: ChosenModel, methods: tuple[str, ...], output: str | None, plot: str | None, as_json: bool, **options: Any
) -> None:
    """Measure the orders of methods on a model: exit 1 when one misses its claim, 3 when one cannot be judged.

    For up to three methods it shows step sizes, errors, and the rates between them. Ctrl-C keeps the methods that are
    finished.
    """
    from .order import order as study

    written = writable((output, TABLES), (plot, PICTURES))
    problem = model.problem()
    with bar("order", None) as tell:
        found = study(problem, listed(methods) or None, progress=tell, **options)
    _finish(found, output, plot, written, as_json)


@click.command()
@model_argument
@click.option("-p", "--parameter", help="Derivatives by this parameter; by a velocity of the start when left out.")
@study_options
def check_gradients(
    model: ChosenModel, methods: tuple[str, ...], output: str | None, plot: str | None, as_json: bool, **options: Any
) -> None:
    """Compare tangents of runs with difference quotients, and measure the orders of derivatives; exits as `order`."""
    from .gradients import check_gradients as study

    written = writable((output, TABLES), (plot, PICTURES))
    if model.textbook:
        raise InputError(f"gradients are those of mechanisms, {model.name!r} is a textbook problem")
    mech = model.load()
    with bar("gradients", None) as tell:
        found = study(mech, listed(methods) or None, progress=tell, **options)
    _finish(found, output, plot, written, as_json)


def _finish(study: "OrderStudy", output: str | None, plot: str | None, written: list[str], as_json: bool) -> NoReturn:
    """Write and print a study, and exit as it was judged."""
    if plot:
        study.plot(plot)
    if output:
        study.save(output)
    emit({**study.to_dict(), "written": written}, "\n".join([str(study), *(f"wrote {p}" for p in written)]), as_json)
    if study.missing:
        done, left = len(study.orders), ", ".join(study.missing)
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
