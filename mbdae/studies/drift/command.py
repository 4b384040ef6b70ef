"""Sub-command ``drift``."""

import sys
from typing import Any

import click

from ...cli.completion import completed, problems
from ...cli.model import chosen_model, set_option, start_option
from ...cli.options import (
    FAILED,
    PICTURES,
    TABLES,
    as_json,
    emit,
    finish,
    listed,
    methods_option,
    plot_option,
    run_options,
    simulate,
    table_option,
    writable,
)
from ...errors import InputError


@click.command()
@click.argument("targets", nargs=-1, required=True, metavar="MODEL|RUN.npz...", shell_complete=completed(problems))
@start_option
@set_option
@methods_option
@run_options
@click.option("--max", "limit", type=float, help="Exit 1 when |g|, |G v| or the relative energy error exceeds this.")
@table_option
@plot_option
@as_json
def drift(
    targets: tuple[str, ...],
    started: tuple[str, ...],
    chosen: tuple[str, ...],
    methods: tuple[str, ...],
    formulation: str | None,
    project: bool | None,
    limit: float | None,
    output: str | None,
    plot: str | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Measure the drift of runs of a model, or of saved solutions: a JSON object, or a list of them for several runs.

    A method's name may follow a formulation and a colon: -m pherk5 -m ggl:pherk5 -m index1:dop853.
    """
    from ...solution.solution import Solution
    from ..method_variant import variants
    from .drift import drift as measure_drift

    written = writable((output, TABLES), (plot, PICTURES))
    if output and len(targets) * max(1, len(listed(methods))) > 1:
        raise InputError("-o takes the drift of one run")
    if limit is not None and not limit > 0:
        raise InputError(f"--max must be positive, got {limit}")
    given = any([started, chosen, methods, *(value is not None for value in (formulation, project, *options.values()))])
    if given and all(target.endswith(".npz") for target in targets):
        raise InputError("a saved run has its method, time and tolerances: options of a run go with a model")
    if project and formulation not in (None, "index2"):
        raise InputError(f"give --project or --formulation {formulation}, not both")
    sols = []
    said = bool(methods or formulation or project)
    tried = variants(listed(methods) or ["pherk6"], ["project" if project else formulation or "index2"]) if said else ()
    for target in targets:
        if target.endswith(".npz"):
            sols.append(Solution.load(target))
        else:
            problem = chosen_model(target, started, chosen).problem()
            runs = [v.arguments() for v in tried] or [{"method": None, "project": project}]
            sols += [simulate(problem, **run, **options) for run in runs]
    found = [measure_drift(sol) for sol in sols]
    if plot:
        from .. import figures
        from .figure import drifts

        figures.save(drifts([f.history for f in found]), plot)
    if output:
        found[0].save(output)
    data = [{**f.to_dict(), "written": written} for f in found]
    emit(data[0] if len(data) == 1 else data, "\n".join(map(str, found)), as_json)
    if limit is not None and not all(f.largest <= limit for f in found):
        sys.exit(FAILED)
    for sol in sols:
        finish(sol)
