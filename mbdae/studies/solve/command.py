"""The sub-command ``solve``."""

from typing import TYPE_CHECKING, Any

import click

from ...cli.model import ChosenModel, problem_argument
from ...cli.options import (
    PAGES,
    PICTURES,
    as_json,
    backend_option,
    emit,
    finish,
    listed,
    method_option,
    panels,
    replay_options,
    run_options,
    simulate,
    writable,
)
from ...errors import InputError

if TYPE_CHECKING:
    from ...solution.solution import Solution

SHOWN = 5  # printed times of an event


@click.command()
@problem_argument
@method_option
@run_options
@backend_option
@click.option("--event", "events", multiple=True, help="List when a signal passes: 'q.slider = 0.3', 'v.crank'.")
@click.option("--until", multiple=True, help="The same, and end the run there: 'force.wrist pin > 100'.")
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="Save the solution as .npz, or as a .csv table.")
@click.option("--html", type=click.Path(dir_okay=False), help="Write a replay as one HTML page.")
@click.option("--video", type=click.Path(dir_okay=False), help="Write it as .mp4 or .gif; takes Chromium.")
@click.option("--glb", type=click.Path(dir_okay=False), help="Write it as a .glb scene for slides and Blender.")
@click.option("--plots", multiple=True, help="A signal in the replay, or several on common axes: q.crank,q.rod.")
@replay_options
@click.option("--plot", type=click.Path(dir_okay=False), help="Draw the run as .png, .svg or .pdf.")
@click.option("--signal", "signals", multiple=True,
              help="Print extrema, mean and RMS of these, and plot them: force.crank, power.motor, q.")  # fmt: skip
@as_json
def solve(
    model: ChosenModel,
    events: tuple[str, ...],
    until: tuple[str, ...],
    output: str | None,
    html: str | None,
    video: str | None,
    glb: str | None,
    plots: tuple[str, ...],
    plot: str | None,
    signals: tuple[str, ...],
    speed: float | None,
    traces: tuple[str, ...],
    arrows: tuple[str, ...],
    every: bool,
    camera: str | None,
    follow: str | None,
    closures: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Simulate a model, and save, replay or plot the motion.

    Events are signals of `mbdae solve MODEL -o run.csv`, or force, torque and effort of closures and drivers by name,
    with = for both directions, > for rising above, < for falling below a number; a signal alone means its zeros.
    """
    from ...integrate.events.event import Event
    from ...mechanism import Mechanism
    from ...solution.signals import find
    from ..drift.drift import drift as measure_drift
    from ..replay.video import VIDEO

    replays = (html, PAGES), (video, tuple(VIDEO)), (glb, (".glb",))
    written = writable((output, (".npz", ".csv")), *replays, (plot, PICTURES))
    if not (html or video) and (plots or traces or arrows or every or camera or follow or closures):
        wanted = "--plots, --trace, --arrows, --camera, --follow and --closures"
        raise InputError(f"{wanted} belong to a replay: --html run.html, or --video run.mp4")
    watched = [*events, *(Event(text, terminal=True) for text in until)]
    mech = model.problem()
    if (html or video or glb) and not isinstance(mech, Mechanism):
        raise InputError(f"{mech.title!r} has no bodies to replay: --plot run.png draws y and z over time")
    names = tuple(find(mech, listed(signals)) if isinstance(mech, Mechanism) else listed(signals))
    if names and not plot and not isinstance(mech, Mechanism):
        raise InputError(f"{mech.title!r} has no bodies: --signal names what --plot run.png draws, y and z")
    sol = simulate(mech, events=watched, **options)
    if output:
        sol.save(output)
    for path in filter(None, (html, video, glb)):
        from ..replay.replay import animate

        animate(sol, path, speed=speed, plots=panels(plots), traces=traces, arrows=every or arrows,
                camera=camera, follow=follow, closures=closures)  # fmt: skip
    if plot:
        sol.plot(names, path=plot)
    found = measure_drift(sol)
    extremes = sol.statistics(names) if names and isinstance(mech, Mechanism) else None
    data = {
        "status": sol.status,
        "message": sol.message,
        "t": float(sol.t[-1]),
        "stats": sol.stats,
        "drift": found.to_dict(),
        "events": {text: sol.events[i][0].tolist() for i, text in enumerate([*events, *until])},
        "singular": [x.to_dict() for x in sol.singular],
        "impacts": [x._asdict() for x in sol.impacts],
        **({"signals": extremes.to_dict()} if extremes else {}),
    }
    lines = [
        str(sol),
        str(found),
        *(f"  {text}: {_times(sol.events[i][0])}" for i, text in enumerate([*events, *until])),
        *(f"  singular configuration: {x}" for x in sol.singular),
        *([_impacts(sol)] if sol.impacts else []),
        *([str(extremes)] if extremes else []),
        *(f"wrote {p}" for p in written),
    ]
    emit({**data, "written": written}, "\n".join(lines), as_json)
    finish(sol)


def _impacts(sol: "Solution") -> str:
    """Return the impacts in words: participants, times, and energy loss."""
    names = ", ".join(dict.fromkeys(name for x in sol.impacts for name in x.where))
    times, loss = [x.t for x in sol.impacts], sum(x.loss for x in sol.impacts)
    return f"  impacts on {names}: {_times(times)}, {abs(loss):.4g} J {'lost' if loss >= 0 else 'added by drives'}"


def _times(times: Any) -> str:
    """Return the times of an event, the first of many."""
    some = ", ".join(f"{t:.9g}" for t in times[:SHOWN])
    return f"t = {some}{', ...' if len(times) > SHOWN else ''} s ({len(times)})" if len(times) else "never"
