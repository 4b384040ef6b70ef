"""The sub-command ``modes``."""

import sys
from typing import Any

import click

from ...cli.options import FAILED, PAGES, PICTURES, as_json, emit, listed, plot_option, values_by_name, writable
from ...errors import InputError
from ...mechanism import load
from .modes import modes as find_modes
from .root_locus import read_range, root_locus


@click.command()
@click.argument("model")
@click.option("--at", "at", multiple=True, help="Search the equilibrium from joint=value, in rad or m.")
@click.option("--speed", "speed", multiple=True, help="A constant speed, joint=value, in rad/s or m/s.")
@click.option("--hold", "hold", multiple=True, help="A joint that stands still.")
@click.option("-t", "--time", "t", type=float, default=0.0, show_default=True, help="Time in s, for drivers.")
@click.option("--html", type=click.Path(dir_okay=False), help="Write a replay of the modes as one HTML page.")
@click.option("--over", help="A root locus: parameter=first:last:number, or v.joint=first:last:number for a speed.")
@plot_option
@as_json
def modes(
    model: str,
    at: tuple[str, ...],
    speed: tuple[str, ...],
    hold: tuple[str, ...],
    html: str | None,
    over: str | None,
    plot: str | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Find eigenvalues, damping and shapes of small motions around an equilibrium or a steady motion.

    The start of the model is taken where it is steady, else the equilibrium that is found from there. With --over the
    eigenvalues are followed over a parameter of the model or over a speed.
    """
    written = writable((html, PAGES), (plot, PICTURES))
    given: dict[str, Any] = {"q": values_by_name(at, "--at") or None, "v": values_by_name(speed, "--speed") or None}
    given |= options | {"hold": listed(hold)}
    if over:
        if html:
            raise InputError("a root locus has a figure, --plot, and no page")
        locus = root_locus(model, *read_range(over), **given)
        if plot:
            locus.plot(plot)
        emit({**locus.to_dict(), "written": written}, str(locus), as_json)
        return
    found = find_modes(load(model), **given)
    if html:
        found.animate(html)
    if plot:
        from .. import figures
        from .figure import roots

        figures.save(roots(found), plot)
    emit({**found.to_dict(), "written": written}, str(found), as_json)
    if not found.stable:
        sys.exit(FAILED)
