"""The sub-commands ``kinematics`` and ``assembly-modes``."""

from typing import Any

import click

from ...cli.model import ChosenModel, model_argument
from ...cli.options import (
    PAGES,
    PICTURES,
    TABLES,
    as_json,
    emit,
    from_option,
    listed,
    plot_option,
    span_of,
    speed_option,
    table_option,
    to_option,
    writable,
)
from ...errors import InputError

DRIVE = click.option("--drive", required=True, help="The input: a joint of one coordinate, or a driver of the model.")
HOLD = click.option("--hold", multiple=True, help="A joint to lock, or joint=value; several times for several.")


@click.command()
@model_argument
@DRIVE
@from_option
@to_option
@click.option("--turns", type=float, default=1.0, show_default=True, help="Full turns, without --from and --to.")
@HOLD
@click.option("--points", type=click.IntRange(min=2), default=181, show_default=True, help="About how many poses.")
@click.option("--output-joint", help="The joint of the transmission angle.")
@click.option("--branches", is_flag=True, help="Follow all branches from branch points on.")
@table_option
@click.option("--html", type=click.Path(dir_okay=False), help="Write a replay along the curve as one HTML page.")
@plot_option
@speed_option
@as_json
def kinematics(
    model: ChosenModel,
    drive: str,
    first: float | None,
    last: float | None,
    hold: tuple[str, ...],
    output: str | None,
    html: str | None,
    plot: str | None,
    speed: float | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Follow the poses of a mechanism with one degree of freedom over an input: rates, dead points, branches."""
    from .kinematics import kinematics as study

    written = writable((output, TABLES), (html, PAGES), (plot, PICTURES))
    found = study(model.load(), drive, span=span_of(first, last), hold=held(hold), **options)
    if output:
        found.save(output)
    if html:
        from ..replay.replay import animate

        animate(found.run(), html, speed=speed)
    if plot:
        found.plot(plot)
    lines = [str(found), *(f"wrote {p}" for p in written)]
    emit({**found.to_dict(), "written": written}, "\n".join(lines), as_json)


@click.command()
@model_argument
@DRIVE
@click.option("--at", type=float, help="Value of the input, in rad or m; the start when left out.")
@HOLD
@click.option("--apart", multiple=True, help="Joints that distinguish the modes.")
@as_json
def assembly_modes(
    model: ChosenModel, drive: str, at: float | None, hold: tuple[str, ...], apart: tuple[str, ...], as_json: bool
) -> None:
    """List all assembly modes at one value of the input: poses that the closures allow."""
    from .assembly_modes import assembly_modes as study

    found = study(model.load(), drive, at, hold=held(hold), apart=listed(apart))
    emit(found.to_dict(), str(found), as_json)


def held(values: tuple[str, ...]) -> dict[str, Any]:
    """Joints, and the values where they are held: None for where they are."""
    out: dict[str, Any] = {}
    for text in listed(values):
        name, given, value = text.partition("=")
        try:
            out[name] = float(value) if given else None
        except ValueError:
            raise InputError(f"--hold takes joint or joint=value, got {text!r}") from None
    return out
