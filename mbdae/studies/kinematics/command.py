"""The sub-commands ``kinematics`` and ``assembly-modes``."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import click

from ...cli.model import ChosenModel
from ...cli.output import PAGES, PLOT, TABLE, emit, output_file
from ...cli.study_command import Output, Result, Study, command, study_command


def _write_replay(result: Any, path: str, options: Mapping[str, Any]) -> None:
    from ..replay.replay import animate

    animate(result.run(), path, speed=options["speed"])


PAGE = output_file(
    "--html", suffixes=PAGES, write=_write_replay, help="Write a replay along the curve as one HTML page."
)


@study_command(
    "drive turns hold points output_joint branches",
    TABLE,
    PAGE,
    PLOT,
    shared="from to speed units",
    types={"points": click.IntRange(min=2)},
    more=[click.option("--toggles", is_flag=True, help="List the poses in which a joint reverses.")],
)
def kinematics(study: Study, model: ChosenModel, speed: float | None, toggles: bool, **options: Any) -> Result:
    """Trace the poses of a mechanism of one degree of freedom over an input, with rates, dead points and branches."""
    return replace(study(model.load(), **options), listed=toggles)


@command("drive at hold apart", shared="units")
def assembly_modes(study: Study, out: Output, model: ChosenModel, **options: Any) -> None:
    """Find the poses that satisfy the closures at one input."""
    found = study(model.load(), **options)
    emit(found.to_dict(), str(found), out.as_json)
