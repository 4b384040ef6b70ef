"""The sub-commands ``equilibrium``, ``equilibria`` and ``load-path``."""

import sys
from collections.abc import Callable
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
    from_option,
    hold_option,
    listed,
    plot_option,
    q_option,
    span_of,
    t_option,
    table_option,
    to_option,
    v_option,
    values_by_name,
    writable,
)

FIND = ("stable", "any")
CODES = {"stable": 0, "rigid": 0, "unstable": FAILED, "neutral": UNJUDGED, "singular": UNJUDGED}


def state_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Where an equilibrium is searched: q, v, locked joints, t."""
    for option in (t_option, hold_option, v_option, q_option):
        command = option(command)
    return command


@click.command()
@model_argument
@state_options
@click.option("--find", type=click.Choice(FIND), default="stable", show_default=True, help="Which equilibrium.")
@table_option
@as_json
def equilibrium(
    model: ChosenModel,
    q: tuple[str, ...],
    v: tuple[str, ...],
    hold: tuple[str, ...],
    output: str | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Find where a model rests or moves steadily, what holds it, and whether it is stable.

    Exit code 0 stable, 1 unstable or none found, 3 neutral or not to be judged.
    """
    from .equilibrium import equilibrium as study

    written = writable((output, TABLES))
    found = study(model.load(), **state(q, v, hold), **options)
    if output:
        found.save(output)
    emit(found.to_dict() | {"written": written}, "\n".join([str(found), *(f"wrote {p}" for p in written)]), as_json)
    sys.exit(CODES[found.stability])


@click.command()
@model_argument
@click.option("--drive", required=True, help="The joint over which the poses are followed.")
@from_option
@to_option
@hold_option
@as_json
def equilibria(
    model: ChosenModel, drive: str, first: float | None, last: float | None, hold: tuple[str, ...], as_json: bool
) -> None:
    """Find all equilibria of a mechanism with one degree of freedom over a joint: exit 1 where there is none."""
    from .equilibria import equilibria as study

    found = study(model.load(), drive, span=span_of(first, last), hold=listed(hold))
    emit([e.to_dict() for e in found], "\n".join(map(str, found)) or f"no equilibrium over {drive}", as_json)
    sys.exit(0 if found else FAILED)


@click.command()
@model_argument
@click.option("--load", required=True, help="A force, or gravity, that is scaled.")
@click.option("--from", "first", type=float, default=0.0, show_default=True, help="The first factor on the load.")
@click.option("--to", "last", type=float, default=1.0, show_default=True, help="The last factor.")
@state_options
@table_option
@plot_option
@as_json
def load_path(
    model: ChosenModel,
    load: str,
    first: float,
    last: float,
    q: tuple[str, ...],
    v: tuple[str, ...],
    hold: tuple[str, ...],
    output: str | None,
    plot: str | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Follow an equilibrium while a force is scaled: load-deflection curve, snap-through, loss of stability."""
    from .load_path import load_path as study

    written = writable((output, TABLES), (plot, PICTURES))
    path = study(model.load(), load, (first, last), **state(q, v, hold), **options)
    if output:
        path.save(output)
    if plot:
        path.plot(plot)
    emit(path.to_dict() | {"written": written}, "\n".join([str(path), *(f"wrote {p}" for p in written)]), as_json)
    if not path.complete:
        sys.exit(FAILED)


def state(q: tuple[str, ...], v: tuple[str, ...], hold: tuple[str, ...]) -> dict[str, Any]:
    """The arguments q, v and hold of options."""
    return {"q": values_by_name(q, "--q") or None, "v": values_by_name(v, "--v") or None, "hold": listed(hold)}
