"""The sub-command ``kinematics``."""

from typing import Any

import click

from ...cli.model import ChosenModel, model_argument
from ...cli.options import PAGES, PICTURES, TABLES, as_json, emit, listed, plot_option, speed_option, writable
from ...errors import InputError


@click.command()
@model_argument
@click.option("--drive", required=True, help="The input: a joint of one coordinate, or a driver of the model.")
@click.option("--from", "first", type=float, help="Where the input begins, in rad or m; the start when left out.")
@click.option("--to", "last", type=float, help="Where it ends; with --from.")
@click.option("--turns", type=float, default=1.0, show_default=True, help="Full turns, without --from and --to.")
@click.option("--hold", multiple=True, help="A joint that stands still, or joint=value; several times for several.")
@click.option("--points", type=click.IntRange(min=2), default=181, show_default=True, help="About how many poses.")
@click.option("--output-joint", "output", help="The joint of the transmission angle.")
@click.option("--branches", is_flag=True, help="Follow all branches from branch points on.")
@click.option("--modes", is_flag=True, help="List all assembly modes at the start of the input instead.")
@click.option("--apart", multiple=True, help="With --modes: joints by which modes are told apart.")
@click.option("-o", "--output", "path", type=click.Path(dir_okay=False), help="Save the table as .csv or .json.")
@click.option("--html", type=click.Path(dir_okay=False), help="Write a replay along the curve as one HTML page.")
@plot_option
@speed_option
@as_json
def kinematics(
    model: ChosenModel,
    drive: str,
    first: float | None,
    last: float | None,
    turns: float,
    hold: tuple[str, ...],
    points: int,
    output: str | None,
    branches: bool,
    modes: bool,
    apart: tuple[str, ...],
    path: str | None,
    html: str | None,
    plot: str | None,
    speed: float | None,
    as_json: bool,
) -> None:
    """Follow the poses of a mechanism with one freedom over an input: rates, dead points, branches, assembly modes."""
    from .assembly_modes import assembly_modes
    from .kinematics import kinematics as follow

    written = writable((path, TABLES), (html, PAGES), (plot, PICTURES))
    if last is not None and first is None and not modes:
        raise InputError("give --from and --to, or --turns")
    if modes and written:
        raise InputError("--modes lists poses at one value of the input: there is no curve to write")
    mech = model.load()
    if modes:
        listing = assembly_modes(mech, drive, first, hold=held(hold), apart=listed(apart))
        emit(listing.to_dict(), str(listing), as_json)
        return
    if (first is None) != (last is None):
        raise InputError("give both --from and --to, or --turns")
    span = None if first is None or last is None else (first, last)
    found = follow(
        mech, drive, span=span, turns=turns, hold=held(hold), points=points, output=output, branches=branches
    )
    if path:
        found.save(path)
    if html:
        from ..replay.replay import animate

        animate(found.run(), html, speed=speed)
    if plot:
        found.plot(plot)
    lines = [str(found), *(f"wrote {p}" for p in written)]
    emit({**found.to_dict(), "written": written}, "\n".join(lines), as_json)


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
