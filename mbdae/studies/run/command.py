"""The sub-command ``run``."""

from typing import Any

import click

from ...cli.options import (
    PAGES,
    PICTURES,
    as_json,
    backend_option,
    emit,
    finish,
    method_option,
    run_options,
    simulate,
    speed_option,
    writable,
)
from ...mechanism import load
from ..drift.drift import drift as measure_drift


@click.command()
@click.argument("model")
@method_option
@run_options
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
        from ..replay.replay import animate

        animate(sol, html, speed=speed)
    if plot:
        from .. import figures
        from .figure import motion

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
