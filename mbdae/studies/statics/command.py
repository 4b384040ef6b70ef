"""The sub-commands ``equilibrium``, ``equilibria`` and ``load-path``."""

import sys
from typing import Any

import click

from ...cli.model import ChosenModel
from ...cli.options import STATE
from ...cli.output import FAILED, HOLDS, PLOT, TABLE, UNDECIDED, emit
from ...cli.study_command import Output, Result, Study, command, study_command

CODES = {"stable": HOLDS, "rigid": HOLDS, "unstable": FAILED, "neutral": UNDECIDED, "singular": UNDECIDED}
FACTORS = (
    click.option("--from", "first", type=float, default=0.0, show_default=True, help="The first factor on the load."),
    click.option("--to", "last", type=float, default=1.0, show_default=True, help="The last factor."),
)


def _exit_code(found: Any) -> int:
    return UNDECIDED if found.warning else CODES[found.stability]


@study_command("find", TABLE, shared=f"{STATE} units", exit_code=_exit_code)
def equilibrium(study: Study, model: ChosenModel, **options: Any) -> Result:
    """Find an equilibrium or a steady motion of a model. Also computes its holding forces and its stability.

    Exit code 0 stable, 1 unstable or none found, 3 neutral, undecided, or flexible bodies bend too far.
    """
    return study(model.load(), **options)


@command("drive", shared="from to hold units")
def equilibria(study: Study, out: Output, model: ChosenModel, drive: str, **options: Any) -> None:
    """Find all equilibria over a joint. The mechanism has one degree of freedom; exit 1 if there is no equilibrium."""
    found = study(model.load(), drive, **options)
    text = "\n".join(map(str, found)) or f"no equilibrium over {drive}"
    emit([e.to_dict() for e in found], text, out.as_json)
    sys.exit(HOLDS if found else FAILED)


@study_command(
    "load",
    TABLE,
    PLOT,
    shared=f"{STATE} units",
    more=FACTORS,
    exit_code=lambda path: FAILED if not path.complete else UNDECIDED if path.warning else HOLDS,
)
def load_path(study: Study, model: ChosenModel, **options: Any) -> Result:
    """Trace an equilibrium while a force is scaled. Prints deflections over loads, snap-through, loss of stability."""
    return study(model.load(), **options)
