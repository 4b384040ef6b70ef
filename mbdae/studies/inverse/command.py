"""The sub-command ``inverse-dynamics``."""

from typing import Any

import click

from ...cli.model import ChosenModel
from ...cli.options import options_of
from ...cli.output import PLOT, TABLE
from ...cli.study_command import Result, Study, study_command
from ...errors import InputError

MOTION = (
    click.argument("motion", required=False, metavar="[RUN.npz|TABLE.csv|.parquet]"),
    click.option("--drive", help="Instead of a motion: a joint driven at constant speed through one revolution."),
    click.option(
        "--points", type=click.IntRange(min=3), default=361, show_default=True, help="Number of poses along the curve."
    ),
    *options_of("mbdae.studies.kinematics", "kinematics", "hold", {}),
)


@study_command("speed actuator weight", TABLE, PLOT, shared="from to units", more=MOTION)
def inverse_dynamics(study: Study, model: ChosenModel, motion: str | None, drive: str | None, **options: Any) -> Result:
    """Compute the actuator efforts of a motion. It is a saved run, a table of q(t), or a drive at constant speed."""
    from ..kinematics.kinematics import kinematics

    curve = {name: options.pop(name) for name in ("span", "hold", "points")}
    speed = options["speed"]
    if (motion is None) == (drive is None):
        raise InputError("give a motion (RUN.npz, TABLE.csv or TABLE.parquet), or --drive and --speed")
    if motion and (speed is not None or curve["span"] or curve["hold"]):
        raise InputError("--speed, --from, --to and --hold need --drive")
    mech = model.load()
    if drive is None:
        return study(mech, motion, **options)
    if speed is None:
        raise InputError(f"give --speed, the constant speed of {drive!r}")
    return study(mech, kinematics(mech, drive, **curve), **options)
