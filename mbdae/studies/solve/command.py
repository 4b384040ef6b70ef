"""The sub-command ``solve``."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from ...cli.model import ChosenModel, problem_argument
from ...cli.options import REPLAY, RUN
from ...cli.output import PAGES, PICTURES, VIDEOS, exit_unless_successful, output_file
from ...cli.runs import simulate
from ...cli.study_command import Output, Study, command
from ...cli.values import panels, split_names
from ...errors import InputError
from ...units import listed_times

if TYPE_CHECKING:
    from ...solution.solution import Problem, Solution

REPLAYS = ("html", "video", "glb")
REPLAY_ARGUMENTS = ("speed", "plots", "traces", "arrows", "every", "camera", "follow", "closures", "deformation")
FILES = (
    output_file("-o", "--output", suffixes=(".npz", ".csv"), help="Save the solution as .npz, or as a .csv table."),
    output_file("--html", suffixes=PAGES, help="Write a replay as one HTML page."),
    output_file("--video", suffixes=VIDEOS, help="Write a replay as .mp4 or .gif; needs Chromium."),
    output_file("--glb", suffixes=(".glb",), help="Write a replay as a .glb scene for slides and Blender."),
    output_file("--plot", suffixes=PICTURES, help="Draw the run as .png, .svg, .pdf or .pgf."),
)
MORE = (
    click.option("--event", "events", multiple=True, help="Level crossing to list: 'q.slider = 0.3', 'v.crank'."),
    click.option("--until", multiple=True, help="End the run at a level crossing: 'force.wrist pin > 100'."),
    click.option("--plots", multiple=True,
                 help="Signal in the replay, or several on common axes: q.crank,q.rod."),
    click.option("--signal", "signals", multiple=True,
                 help="Print extrema, mean and RMS of signals, and plot them: force.crank, power.motor, q."),
)  # fmt: skip


@command("", *FILES, shared=f"method {RUN} backend {REPLAY} units", subject=problem_argument, more=MORE)
def solve(
    study: Study,
    out: Output,
    model: ChosenModel,
    events: tuple[str, ...],
    until: tuple[str, ...],
    signals: tuple[str, ...],
    **options: Any,
) -> None:
    """Simulate a model, and save, replay or plot the motion.

    Events are signals of `mbdae solve MODEL -o run.csv`, or force, torque and effort of closures and drivers by name,
    with = for both directions, > for rising and < for falling through a number; a signal alone means its zeros.
    """
    from ...integrate.events.event import Event

    replay = {name: options.pop(name) for name in REPLAY_ARGUMENTS}
    mech = _problem(model, out, replay)
    names = _signals(mech, signals, out.paths["plot"])
    monitored = [*events, *(Event(text, terminal=True) for text in until)]
    sol = simulate(mech, events=monitored, **options)
    _write(sol, out, names, replay)
    data, lines = _summary(sol, events, until)
    if names and mech is sol.mechanism:
        extremes = sol.statistics(names)
        data["signals"] = extremes.to_dict()
        lines.append(str(extremes))
    out.emit(data, "\n".join(lines))
    exit_unless_successful(sol)


def _problem(model: ChosenModel, out: Output, replay: dict[str, Any]) -> "Problem":
    """Return the problem of a run; a replay needs a mechanism."""
    from ...mechanism import Mechanism

    requested = any(replay[name] for name in REPLAY_ARGUMENTS[1:])
    if requested and not (out.paths["html"] or out.paths["video"]):
        options = "--plots, --trace, --arrows, --camera, --follow, --closures and --deformation"
        raise InputError(f"{options} need a replay: --html run.html, or --video run.mp4")
    found = model.problem()
    if any(out.paths[name] for name in REPLAYS) and not isinstance(found, Mechanism):
        raise InputError(f"{found.title!r} has no bodies to replay: --plot run.png draws y and z over time")
    return found


def _signals(problem: "Problem", signals: tuple[str, ...], plot: str | None) -> tuple[str, ...]:
    """Return the names of signals; those of textbook problems are only drawn."""
    from ...mechanism import Mechanism
    from ...solution.signals import find

    if isinstance(problem, Mechanism):
        return tuple(find(problem, split_names(signals)))
    if signals and not plot:
        raise InputError(f"{problem.title!r} has no bodies: --signal names what --plot run.png draws, y and z")
    return tuple(split_names(signals))


def _write(sol: "Solution", out: Output, names: tuple[str, ...], replay: dict[str, Any]) -> None:
    """Write the run, its replays and its figure."""
    if out.paths["output"]:
        sol.save(out.paths["output"])
    for path in filter(None, (out.paths[name] for name in REPLAYS)):
        from ..replay.replay import animate

        shown = {key: x for key, x in replay.items() if key != "every"}
        arrows = replay["every"] or replay["arrows"]
        animate(sol, path, **{**shown, "plots": panels(replay["plots"]), "arrows": arrows})
    if out.paths["plot"]:
        sol.plot(names, path=out.paths["plot"])


def _summary(sol: "Solution", events: Sequence[str], until: Sequence[str]) -> tuple[dict[str, Any], list[str]]:
    """Return JSON data and lines of text on a run: status, drift, events, singular configurations, impacts."""
    from ..drift.drift import drift

    found = drift(sol)
    times = {text: sol.events[i][0] for i, text in enumerate([*events, *until])}
    data = {
        "status": sol.status,
        "message": sol.message,
        "t": float(sol.t[-1]),
        "stats": sol.stats,
        "drift": found.to_dict(),
        "events": {text: t.tolist() for text, t in times.items()},
        "singular": [x.to_dict() for x in sol.singular],
        "impacts": [x._asdict() for x in sol.impacts],
    }
    listed = [text for text, t in times.items() if text not in until or t.tolist() != [sol.t[-1]]]  # not in str(sol)
    lines = [str(sol), str(found), *(f"  {text}: {listed_times(times[text])}" for text in listed)]
    lines += [f"  singular configuration: {x}" for x in sol.singular]
    return data, lines
