"""The sub-commands ``order``, ``check-gradients`` and ``methods``: observed and claimed orders."""

import sys
from typing import TYPE_CHECKING, Any

import click

from ...cli.completion import completed
from ...cli.completion import methods as method_names
from ...cli.model import ChosenModel, problem_argument
from ...cli.options import SHARED, methods_option
from ...cli.output import FAILED, HOLDS, PLOT, TABLE, UNDECIDED, emit, print_table
from ...cli.study_command import Result, Study, study_command
from ...errors import InputError
from ...progress import progress_bar

if TYPE_CHECKING:
    from .result import OrderStudy

METHODS_OR_ALL = methods_option("A method; several times for several; all when left out.")


def _exit_code(study: "OrderStudy") -> int:
    return FAILED if study.refuted else HOLDS if study.holds else UNDECIDED


def _missing(study: "OrderStudy") -> str:
    done, missing = len(study.orders), study.missing
    return f"after {done} of {done + len(missing)} methods; {', '.join(missing)} remain" if missing else ""


OUTCOME: dict[str, Any] = {"exit_code": _exit_code, "missing": _missing}


@study_command("T steps", TABLE, PLOT, shared="units", subject=problem_argument, more=[METHODS_OR_ALL], **OUTCOME)
def order(study: Study, model: ChosenModel, **options: Any) -> Result:
    """Measure the orders of methods on a model. Exit 1 if one is below its claim, 3 if one cannot be estimated.

    For up to three methods it shows step sizes, errors, and the rates between them. Ctrl-C shows the finished
    methods.
    """
    problem = model.problem()
    with progress_bar("order", None) as report_progress:
        return study(problem, progress=report_progress, **options)


@study_command("parameter T steps", TABLE, PLOT, shared="units", more=[METHODS_OR_ALL], **OUTCOME)
def check_gradients(study: Study, model: ChosenModel, **options: Any) -> Result:
    """Compare tangents of runs with difference quotients. Orders of derivatives are measured, too; exits as `order`."""
    if model.textbook:
        raise InputError(f"check-gradients takes a mechanism, {model.name!r} is a textbook problem")
    mech = model.load()
    with progress_bar("gradients", None) as report_progress:
        return study(mech, progress=report_progress, **options)


@click.command()
@click.option("--check", is_flag=True, help="Verify the claimed orders by index-2 trees.")
@click.argument("names", nargs=-1, shell_complete=completed(method_names))
@SHARED["json"]
def methods(check: bool, names: tuple[str, ...], as_json: bool) -> None:
    """List the methods, or check their order conditions. The check is exact."""
    from ...methods import METHODS, method
    from ...methods.method_table import summary
    from ...methods.order.claims import check_claims

    chosen = [method(n) for n in names or METHODS]
    if check:
        reports = [check_claims(m) for m in chosen]
        emit([r.to_dict() for r in reports], "\n\n".join(str(r) for r in reports), as_json)
        sys.exit(HOLDS if all(r.holds for r in reports) else FAILED)
    print_table([summary(m) for m in chosen], as_json)
