"""Sub-command ``drift``."""

import sys
from typing import TYPE_CHECKING, Any

import click

from ...cli.completion import completed, problems
from ...cli.model import chosen_model, set_option, start_option
from ...cli.options import RUN
from ...cli.output import FAILED, PLOT, TABLE, emit, exit_unless_successful
from ...cli.runs import simulate
from ...cli.study_command import Output, Study, command
from ...errors import InputError

if TYPE_CHECKING:
    from ...solution.solution import Solution
    from .drift import Drift

TARGETS = click.argument(
    "targets", nargs=-1, required=True, metavar="MODEL|RUN.npz...", shell_complete=completed(problems)
)
LIMIT = click.option(
    "--max", "limit", type=float, help="Limit of |g|, |G v| and the relative energy error; exit 1 when exceeded."
)


@command(
    "long_time", TABLE, PLOT, shared=f"methods {RUN} units", subject=TARGETS, more=[start_option, set_option, LIMIT]
)
def drift(
    study: Study, out: Output, targets: tuple[str, ...], limit: float | None, long_time: bool | None, **options: Any
) -> None:
    """Measure the drift of runs, or of saved solutions. --json prints one object, or a list of them for several runs.

    A method's name may follow a formulation and a colon: -m pherk5 -m ggl:pherk5 -m index1:dop853.
    """
    output = out.paths["output"]
    if output and len(targets) * max(1, len(options["methods"] or ())) > 1:
        raise InputError("-o writes the drift of one run")
    if limit is not None and not limit > 0:
        raise InputError(f"--max must be positive, got {limit}")
    sols = _solutions(targets, **options)
    found = [study(sol, long_time=bool(long_time)) for sol in sols]
    if out.paths["plot"]:
        _draw(found, out.paths["plot"])
    if output:
        found[0].save(output)
    data = [{**f.to_dict(), "written": out.written} for f in found]
    emit(data[0] if len(data) == 1 else data, "\n".join(map(str, found)), out.as_json)
    if limit is not None:
        _exit_above(limit, [f.largest for f in found])
    for sol in sols:
        exit_unless_successful(sol)


def _exit_above(limit: float, values: list[float]) -> None:
    if above := [x for x in values if not x <= limit]:
        click.echo(f"mbdae: |g|, |G v| or the relative energy error is {max(above):.3g}, above {limit:g}", err=True)
        sys.exit(FAILED)


def _draw(found: "list[Drift]", path: str) -> None:
    from .. import figures
    from .figure import drifts

    figures.save(drifts([f.history for f in found]), path)


def _solutions(
    targets: tuple[str, ...], start_values: tuple[str, ...], settings: tuple[str, ...], **options: Any
) -> list["Solution"]:
    """Return saved runs, and runs of models by each method.

    Raises:
        InputError: for options of a run when all runs are saved ones.
    """
    from ...solution.solution import Solution

    given = start_values or settings or any(value is not None for value in options.values())
    if given and all(target.endswith(".npz") for target in targets):
        raise InputError("a saved run has its method, time and tolerances: options of a run need a model")
    runs = _runs(options.pop("methods"), options.pop("formulation"), options.pop("project"))
    sols = []
    for target in targets:
        if target.endswith(".npz"):
            sols.append(Solution.load(target))
        else:
            problem = chosen_model(target, start_values, settings).problem()
            sols += [simulate(problem, **run, **options) for run in runs]
    return sols


def _runs(methods: list[str] | None, formulation: str | None, project: bool | None) -> list[dict[str, Any]]:
    """Return settings of a run for each method; the model's if neither method nor formulation is given."""
    from ..method_variant import variants

    if project and formulation not in (None, "index2"):
        raise InputError(f"give --project or --formulation {formulation}, not both")
    if not (methods or formulation or project):
        return [{"method": None, "project": project}]
    return [v.arguments() for v in variants(methods or ["pherk6"], ["project" if project else formulation or "index2"])]
