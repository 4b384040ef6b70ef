"""The sub-command ``inverse-dynamics``."""

from typing import Any

import click

from ...cli.model import ChosenModel, model_argument
from ...cli.options import (
    PICTURES,
    TABLES,
    as_json,
    emit,
    from_option,
    listed,
    plot_option,
    span_of,
    table_option,
    to_option,
    writable,
)
from ...errors import InputError
from ..kinematics.command import held


@click.command()
@model_argument
@click.argument("motion", required=False, metavar="[RUN.npz|TABLE.csv]")
@click.option("--drive", help="Instead of a motion: a joint that turns at constant speed, through one turn.")
@click.option("--speed", type=float, help="Its speed in rad/s or m/s.")
@from_option
@to_option
@click.option("--hold", multiple=True, help="A joint that stands still while the drive turns, or joint=value.")
@click.option("--points", type=click.IntRange(min=3), default=361, show_default=True, help="Poses of the drive.")
@click.option(
    "-a", "--actuator", "actuators", multiple=True, help="A joint or driver that acts; several times for several."
)
@click.option("--weight", "weights", multiple=True, help="actuator=weight, for more actuators than degrees of freedom.")
@table_option
@plot_option
@as_json
def inverse_dynamics(
    model: ChosenModel,
    motion: str | None,
    drive: str | None,
    speed: float | None,
    first: float | None,
    last: float | None,
    hold: tuple[str, ...],
    points: int,
    actuators: tuple[str, ...],
    weights: tuple[str, ...],
    output: str | None,
    plot: str | None,
    as_json: bool,
) -> None:
    """Tell what actuators must give for a motion: a saved run, a table of q(t), or a drive at constant speed."""
    from ..kinematics.kinematics import kinematics
    from .inverse import inverse_dynamics as study

    written = writable((output, TABLES), (plot, PICTURES))
    if (motion is None) == (drive is None):
        raise InputError("give a motion (RUN.npz or TABLE.csv), or --drive and --speed")
    span = span_of(first, last)
    if motion and (speed is not None or span or hold):
        raise InputError("--speed, --from, --to and --hold go with --drive")
    mech = model.load()
    prescribed: Any = motion
    if drive is not None:
        if speed is None:
            raise InputError(f"give --speed, at which {drive!r} turns")
        prescribed = kinematics(mech, drive, span=span, hold=held(hold), points=points)
    found = study(mech, prescribed, listed(actuators) or None, speed=speed, weights=_weights(weights))
    if output:
        found.save(output)
    if plot:
        found.plot(plot)
    lines = [str(found), *(f"wrote {p}" for p in written)]
    emit({**found.to_dict(), "written": written}, "\n".join(lines), as_json)


def _weights(values: tuple[str, ...]) -> dict[str, float]:
    try:
        return {name: float(value) for name, _, value in (text.partition("=") for text in listed(values))}
    except ValueError:
        raise InputError(f"--weight takes actuator=number, got {', '.join(values)}") from None
