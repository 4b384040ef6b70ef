"""The sub-command ``modes``."""

import sys
from typing import TYPE_CHECKING, Any

import click

from ...cli.model import ChosenModel, model_argument
from ...cli.options import FAILED, PAGES, PICTURES, as_json, emit, listed, plot_option, values_by_name, writable
from ...errors import InputError

if TYPE_CHECKING:
    from .linear_system import LinearSystem


@click.command()
@model_argument
@click.option("--at", "at", multiple=True, help="Search the equilibrium from joint=value, in rad or m.")
@click.option("--speed", "speed", multiple=True, help="A constant speed, joint=value, in rad/s or m/s.")
@click.option("--hold", "hold", multiple=True, help="A joint that stands still.")
@click.option("-t", "--time", "t", type=float, default=0.0, show_default=True, help="Time in s, for drivers.")
@click.option("--html", type=click.Path(dir_okay=False), help="Write a replay of the modes as one HTML page.")
@click.option("--over", help="A root locus: parameter=first:last:number, or v.joint=first:last:number for a speed.")
@click.option(
    "--response", nargs=2, multiple=True, metavar="INPUT OUTPUT", help="Frequency response: names as of linearize."
)
@plot_option
@as_json
def modes(
    model: ChosenModel,
    at: tuple[str, ...],
    speed: tuple[str, ...],
    hold: tuple[str, ...],
    html: str | None,
    over: str | None,
    response: tuple[tuple[str, str], ...],
    plot: str | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Find eigenvalues, damping and shapes of small motions around an equilibrium or a steady motion.

    The start of the model is taken where it is steady, else the equilibrium that is found from there. With --over the
    eigenvalues are followed over a parameter of the model or over a speed; with --response outputs answer to
    inputs: gain and phase over the frequency.
    """
    from .linear_system import linearize
    from .modes import modes as find_modes
    from .root_locus import read_range, root_locus

    written = writable((html, PAGES), (plot, PICTURES))
    given: dict[str, Any] = {"q": values_by_name(at, "--at") or None, "v": values_by_name(speed, "--speed") or None}
    given |= options | {"hold": listed(hold)}
    if ((over or response) and html) or (over and response):
        raise InputError("a root locus or a frequency response, one of them, has a figure, --plot, and no page")
    if response:
        _respond(linearize(model.load(), inputs=_once(response, 0), outputs=_once(response, 1), **given), plot, as_json)
        return
    if over:
        locus = root_locus(model.name, *read_range(over), start=model.start, **given)
        if plot:
            locus.plot(plot)
        emit({**locus.to_dict(), "written": written}, str(locus), as_json)
        return
    found = find_modes(model.load(), **given)
    if html:
        found.animate(html)
    if plot:
        found.plot(plot)
    emit({**found.to_dict(), "written": written}, str(found), as_json)
    if not found.stable:
        sys.exit(FAILED)


def _once(pairs: tuple[tuple[str, str], ...], side: int) -> list[str]:
    return list(dict.fromkeys(pair[side] for pair in pairs))


def _respond(system: "LinearSystem", plot: str | None, as_json: bool) -> None:
    import numpy as np

    hertz = system.band()
    H = system.response(2 * np.pi * hertz)
    if plot:
        system.plot(plot, hertz)
    lines = [str(system)]
    for i, output in enumerate(system.outputs):
        for j, name in enumerate(system.inputs):
            gain = np.abs(H[:, i, j])
            k = int(gain.argmax())
            lines.append(f"  {output} / {name}: gain {gain[0]:.4g} at {hertz[0]:.4g} Hz, at most {gain[k]:.4g} at "
                         f"{hertz[k]:.4g} Hz, {gain[-1]:.4g} at {hertz[-1]:.4g} Hz")  # fmt: skip
    data = {**system.to_dict(), "hertz": hertz.tolist(), "gain": np.abs(H).tolist(), "phase": np.angle(H).tolist()}
    emit({**data, "written": [plot] if plot else []}, "\n".join(lines), as_json)
