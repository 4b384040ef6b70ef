"""The sub-commands ``modes``, ``root-locus`` and ``linearize``."""

from typing import Any

import click

from ...cli.model import ChosenModel
from ...cli.options import STATE
from ...cli.output import FAILED, HOLDS, PAGES, PLOT, output_file
from ...cli.study_command import Output, Result, Study, command, study_command
from ...units import quantity

PAGE = output_file(
    "--html",
    suffixes=PAGES,
    help="Write a replay of the modes as one HTML page.",
    write=lambda found, path, given: found.animate(path),
)


@study_command("", PAGE, PLOT, shared=f"{STATE} units", exit_code=lambda found: HOLDS if found.stable else FAILED)
def modes(study: Study, model: ChosenModel, **options: Any) -> Result:
    """Compute eigenvalues, damping and shapes of vibrations. They are those around an equilibrium or a steady motion.

    The point is the model's start if that is steady, else the equilibrium found from there. Exit 1 if a mode grows.
    """
    return study(model.load(), **options)


@study_command("", PLOT, shared=f"{STATE} units", more=[click.argument("over", metavar="NAME=FIRST:LAST:NUMBER")])
def root_locus(study: Study, model: ChosenModel, over: str, **options: Any) -> Result:
    """Track eigenvalues over a parameter or a speed. For instance spin=150:250:21, or v.shaft=4:8:9."""
    from .root_locus import read_range

    return study(model.name, *read_range(over), start=model.start, **options)


@command("inputs outputs", PLOT, shared=f"{STATE} units")
def linearize(study: Study, out: Output, model: ChosenModel, **options: Any) -> None:
    """Linearize a model with inputs and outputs. Prints gain and phase over frequency; with --json also A, B, C, D."""
    import numpy as np

    system = study(model.load(), **options)
    hertz = system.band()
    H = system.response(2 * np.pi * hertz)
    if out.paths["plot"]:
        system.plot(out.paths["plot"], hertz)
    lines = [str(system)]
    for i, output in enumerate(system.outputs):
        for j, name in enumerate(system.inputs):
            gain = np.abs(H[:, i, j])
            k = int(gain.argmax())
            first, most, last = (quantity(gain[n], system.units[i][j], ".4g") for n in (0, k, -1))
            lines.append(f"  {output} / {name}: gain {first} at {hertz[0]:.4g} Hz, at most {most} at "
                         f"{hertz[k]:.4g} Hz, {last} at {hertz[-1]:.4g} Hz")  # fmt: skip
    data = {**system.to_dict(), "hertz": hertz.tolist(), "gain": np.abs(H).tolist(), "phase": np.angle(H).tolist()}
    out.emit(data, "\n".join(lines))
