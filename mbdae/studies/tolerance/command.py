"""The sub-command ``tolerance``."""

from typing import Any

import click

from ...cli.model import ChosenModel
from ...cli.output import PLOT, TABLE
from ...cli.study_command import Result, Study, study_command


@study_command(
    "drive signal parameter clearance turns hold points sigmas second_order",
    TABLE,
    PLOT,
    shared="from to units",
    types={"points": click.IntRange(min=2)},
)
def tolerance(study: Study, model: ChosenModel, **options: Any) -> Result:
    """Find how tolerances and clearances move a mechanism. Worst case, statistics, contributions, bands of paths."""
    return study(model.load(), **options)
