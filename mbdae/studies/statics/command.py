"""The sub-command ``statics``."""

import sys
from typing import Any

import click

from ...cli.model import ChosenModel, model_argument
from ...cli.options import (
    FAILED,
    PICTURES,
    TABLES,
    UNJUDGED,
    as_json,
    emit,
    listed,
    plot_option,
    table_option,
    values_by_name,
    writable,
)
from ...errors import InputError

FIND = ("stable", "any")
CODES = {"stable": 0, "rigid": 0, "unstable": FAILED, "neutral": UNJUDGED, "singular": UNJUDGED}


@click.command()
@model_argument
@click.option("--at", "at", multiple=True, help="Start from joint=value, in rad or m; the model's start when left out.")
@click.option("--hold", "hold", multiple=True, help="A joint to be held where it starts; its torque is told.")
@click.option("--speed", "speed", multiple=True, help="A constant speed, joint=value, in rad/s or m/s.")
@click.option("-t", "--time", "t", type=float, default=0.0, show_default=True, help="Time in s, for drivers.")
@click.option("--find", type=click.Choice(FIND), default="stable", show_default=True, help="Which equilibrium.")
@click.option("--all", "drive", help="All equilibria of a mechanism with one freedom, over this joint.")
@click.option("--load", "load_name", help="A force, or gravity, that is scaled along a path of equilibria.")
@click.option("--to", "end", type=float, help="The last factor on the load, or value of --all.")
@click.option("--from", "begin", type=float, default=0.0, show_default=True, help="The first one.")
@table_option
@plot_option
@as_json
def statics(
    model: ChosenModel,
    at: tuple[str, ...],
    hold: tuple[str, ...],
    speed: tuple[str, ...],
    drive: str | None,
    load_name: str | None,
    begin: float,
    end: float | None,
    output: str | None,
    plot: str | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Find where a model rests or moves steadily, what holds it, and whether it is stable.

    Exit code 0 stable, 1 unstable or none found, 3 neutral or not to be judged. With --load and --to the equilibrium is
    followed while a force is scaled: load-deflection curve, snap-through, loss of stability.
    """
    from .equilibria import equilibria
    from .equilibrium import equilibrium
    from .load_path import load_path

    written = writable((output, TABLES), (plot, PICTURES))
    if drive is None and ((load_name is None) != (end is None) or (plot and end is None)):
        raise InputError("a path of equilibria takes --load and --to; --plot draws it")
    mech = model.load()
    start, speeds = values_by_name(at, "--at"), values_by_name(speed, "--speed")
    given: dict[str, Any] = {"q": start or None, "v": speeds or None, "hold": listed(hold), **options}
    if drive is not None:
        if start or speeds or load_name or written:
            raise InputError("--all takes a joint, its range with --from and --to, and --hold alone")
        every = equilibria(mech, drive, span=None if end is None else (begin, end), hold=listed(hold))
        text = "\n".join(map(str, every)) or f"no equilibrium over {drive}"
        emit([e.to_dict() for e in every], text, as_json)
        sys.exit(0 if every else FAILED)
    if load_name is None or end is None:
        found = equilibrium(mech, **given)
        if output:
            found.save(output)
        emit(found.to_dict() | {"written": written}, "\n".join([str(found), *(f"wrote {p}" for p in written)]), as_json)
        sys.exit(CODES[found.stability])
    given.pop("find")
    path = load_path(mech, load_name, (begin, end), **given)
    if output:
        path.save(output)
    if plot:
        path.plot(plot)
    emit(path.to_dict() | {"written": written}, "\n".join([str(path), *(f"wrote {p}" for p in written)]), as_json)
    if not path.complete:
        sys.exit(FAILED)
