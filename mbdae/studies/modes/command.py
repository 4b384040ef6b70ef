"""The sub-commands ``modes``, ``root-locus`` and ``linearize``."""

import sys
from typing import Any

import click

from ...cli.model import ChosenModel, model_argument
from ...cli.options import FAILED, PAGES, PICTURES, as_json, emit, listed, plot_option, writable
from ..statics.command import state, state_options


@click.command()
@model_argument
@state_options
@click.option("--html", type=click.Path(dir_okay=False), help="Write a replay of the modes as one HTML page.")
@plot_option
@as_json
def modes(
    model: ChosenModel,
    q: tuple[str, ...],
    v: tuple[str, ...],
    hold: tuple[str, ...],
    html: str | None,
    plot: str | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Find eigenvalues, damping and shapes of small motions around an equilibrium or a steady motion.

    The start of the model is taken where it is steady, else the equilibrium that is found from there. Exit 1 where a
    motion grows.
    """
    from .modes import modes as study

    written = writable((html, PAGES), (plot, PICTURES))
    found = study(model.load(), **state(q, v, hold), **options)
    if html:
        found.animate(html)
    if plot:
        found.plot(plot)
    emit({**found.to_dict(), "written": written}, str(found), as_json)
    if not found.stable:
        sys.exit(FAILED)


@click.command()
@model_argument
@click.argument("over", metavar="NAME=FIRST:LAST:NUMBER")
@state_options
@plot_option
@as_json
def root_locus(
    model: ChosenModel,
    over: str,
    q: tuple[str, ...],
    v: tuple[str, ...],
    hold: tuple[str, ...],
    plot: str | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Follow eigenvalues over a parameter of a model, or over a speed v.JOINT: spin=150:250:21, v.shaft=4:8:9."""
    from .root_locus import read_range
    from .root_locus import root_locus as study

    written = writable((plot, PICTURES))
    name, values = read_range(over)
    found = study(model.name, name, values, start=model.start, **state(q, v, hold), **options)
    if plot:
        found.plot(plot)
    emit({**found.to_dict(), "written": written}, str(found), as_json)


@click.command()
@model_argument
@click.option("--inputs", multiple=True, help="A joint, a force with a signal, or frame.x; several times for several.")
@click.option("--outputs", multiple=True, help="q.joint, v.joint, s.state or position.frame.x.  [default: all q and v]")
@state_options
@plot_option
@as_json
def linearize(
    model: ChosenModel,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    q: tuple[str, ...],
    v: tuple[str, ...],
    hold: tuple[str, ...],
    plot: str | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Linearise a model with inputs and outputs: gain and phase over the frequency; with --json A, B, C and D, too."""
    import numpy as np

    from .linear_system import linearize as study

    written = writable((plot, PICTURES))
    system = study(model.load(), inputs=listed(inputs), outputs=listed(outputs), **state(q, v, hold), **options)
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
    emit({**data, "written": written}, "\n".join(lines), as_json)
