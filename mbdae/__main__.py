"""The command line: every sub-command is thin, one public function stands behind it."""

import sys
import warnings
from pathlib import Path
from typing import Any

import click

from . import METHODS, Solution, backend, load, model_names
from .cli.interrupt import CODE, release
from .cli.options import (
    FAILED,
    HOLDS,
    PAGES,
    PICTURES,
    USAGE,
    as_json,
    atol_option,
    backend_option,
    bar,
    emit,
    finish,
    formulation_option,
    method_option,
    project_option,
    rtol_option,
    show,
    simulate,
    speed_option,
    step_option,
    time_option,
    writable,
)
from .cli.study_commands import compare, drift, order, report
from .cli.sweep_command import sweep
from .errors import InputError, MbdaeError, printable
from .methods.order.conditions import check_conditions
from .solution.archive import versions
from .studies.card.card import card
from .studies.drift.drift import drift as measure_drift


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="mbdae")
def cli() -> None:
    """Simulate constrained mechanisms, check the result, and replay it."""


@cli.command()
@as_json
def models(as_json: bool) -> None:
    """List the models that come with mbdae."""
    rows = [(name, load(name)) for name in model_names()]
    data = [
        {
            "name": n,
            "title": m.title,
            "nq": m.nq,
            "nv": m.nv,
            "ng": m.ng,
            "parameters": "; ".join(f"{p['name']}: {p['takes']}" for p in (m.source or {})["parameters"]) or None,
        }
        for n, m in rows
    ]
    show(data, as_json)


@cli.command()
@click.option("--check", is_flag=True, help="Prove the claimed orders on index-2 trees.")
@click.argument("names", nargs=-1)
@as_json
def methods(check: bool, names: tuple[str, ...], as_json: bool) -> None:
    """List the methods with their claims, or check their order conditions exactly."""
    from .methods import method

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


@cli.command()
@click.argument("model", required=False)
@as_json
def info(model: str | None, as_json: bool) -> None:
    """Show versions and the back end, or a model's card.

    The card has sizes, joints, closures, degrees of freedom, start, and what is not modelled.
    """
    if model:
        result = card(load(model))
        data, lines = result.to_dict(), [str(result)]
    else:
        data = {"versions": versions()}
        lines = [f"{name} {version}" for name, version in data["versions"].items()]
    emit({**data, "backend": backend.status()}, "\n".join([*lines, f"back end: {backend.status()}"]), as_json)


@cli.command()
@click.argument("model")
@method_option
@time_option
@rtol_option
@atol_option
@step_option
@formulation_option
@project_option
@backend_option
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="Save the solution as .npz, or as a .csv table.")
@click.option("--html", type=click.Path(dir_okay=False), help="Write a replay as one HTML page.")
@click.option("--plot", type=click.Path(dir_okay=False), help="Draw the run as .png, .svg or .pdf.")
@speed_option
@as_json
def run(
    model: str, output: str | None, html: str | None, plot: str | None, speed: float, as_json: bool, **options: Any
) -> None:
    """Simulate a model, and save, replay or plot the motion."""
    written = writable((output, (".npz", ".csv")), (html, PAGES), (plot, PICTURES))
    sol = simulate(load(model), **options)
    if output:
        sol.save(output)
    if html:
        from .studies.replay.replay import animate

        animate(sol, html, speed=speed)
    if plot:
        from .studies import figures
        from .studies.figures_run import motion

        figures.save(motion(sol), plot)
    found = measure_drift(sol)
    data = {
        "status": sol.status,
        "message": sol.message,
        "t": float(sol.t[-1]),
        "stats": sol.stats,
        "drift": found.to_dict(),
        "singular": [x.to_dict() for x in sol.singular],
    }
    s = sol.stats
    rejected = "-" if s["rejected"] is None else s["rejected"]
    lines = [
        f"{sol.status}: {sol.message}, t = {sol.t[-1]:g} s",
        f"  {s['steps']} steps, {rejected} rejected, {s['solves']} solves, {s['seconds']:.2f} s, {s['backend']}",
        str(found),
        *(f"  singular configuration: {x}" for x in sol.singular),
        *(f"wrote {p}" for p in written),
    ]
    emit({**data, "written": written}, "\n".join(lines), as_json)
    finish(sol)


@cli.command()
@click.argument("solutions", nargs=-1, required=True, metavar="RUN.npz [OTHER.npz...]")
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="The HTML page to write.")
@click.option("--video", type=click.Path(dir_okay=False), help="The video to write, .mp4 or .gif; takes Chromium.")
@speed_option
@click.option("--plot", "plots", multiple=True, help="A signal, q.crank, or several on common axes: q.crank,q.rod.")
@click.option("--trace", "traces", multiple=True, help="A frame whose path is drawn.")
@click.option("--arrow", "arrow", multiple=True, help="A closure whose force is drawn.")
@click.option("--arrows", "every", is_flag=True, help="Draw the forces of all closures.")
@as_json
def animate(
    solutions: tuple[str, ...],
    output: str | None,
    video: str | None,
    plots: tuple[str, ...],
    arrow: tuple[str, ...],
    every: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Write the replay of a saved solution as one HTML page or as a video; further solutions are shown as ghosts."""
    from .studies.replay.replay import VIDEO
    from .studies.replay.replay import animate as write

    written = writable((output, PAGES), (video, tuple(VIDEO)))
    if not written:
        raise InputError("animate writes a page, -o run.html, a video, --video run.mp4, or both")
    sol, *others = map(Solution.load, solutions)
    stems = [Path(name).stem for name in solutions[1:]]
    names = stems if len(set(stems)) == len(stems) else solutions[1:]
    chosen = [tuple(entry.split(",")) for entry in plots] or None
    with bar("animate", 1.0) as tell:
        for path in written:
            ghosts = dict(zip(names, others, strict=True))
            write(sol, path, plots=chosen, ghosts=ghosts, arrows=every or arrow, progress=tell, **options)
    emit({"written": written}, "\n".join(f"wrote {path}" for path in written), as_json)


for command in (order, drift, compare, report, sweep):
    cli.add_command(command)


def main() -> None:
    """Entry point: errors are one line on stderr; exit codes as in `mbdae.cli.options`, 130 for Ctrl-C."""
    release()
    warnings.showwarning = lambda message, *_: _say(f"warning: {message}")  # type: ignore[assignment]
    try:
        sys.exit(cli(standalone_mode=False) or HOLDS)
    except click.exceptions.NoArgsIsHelpError as e:
        click.echo(e.format_message())
        sys.exit(USAGE)
    except click.ClickException as e:
        _say(e.format_message())
        sys.exit(USAGE)
    except MbdaeError as e:
        _say(str(e))
        sys.exit(USAGE if isinstance(e, InputError) else FAILED)
    except MemoryError as e:
        _say(f"there is not enough memory: {e or 'std::bad_alloc'}")
        sys.exit(FAILED)
    except (click.exceptions.Abort, KeyboardInterrupt):
        _say("stopped by the user")
        sys.exit(CODE)


def _say(text: str) -> None:
    """Say one line on stderr; names from files may hold anything."""
    click.echo(printable(f"mbdae: {text}"), err=True)


if __name__ == "__main__":
    main()
