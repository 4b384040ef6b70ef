"""Figures of modes: roots in the complex plane, root loci, Campbell diagrams and frequency responses."""

from typing import TYPE_CHECKING

import numpy as np

from ..figures import (
    COLOURS,
    WIDTH,
    curve_style,
    empty_figure,
    escaped,
    fixed_layout,
    legend_right,
    logarithmic,
    positive,
)
from .linear_system import LinearSystem
from .modes import Modes
from .root_locus import RootLocus

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ORDERS = (1, 2, 3)  # multiples of the speed in a Campbell diagram


@fixed_layout
def roots(modes: Modes) -> "Figure":
    """Draw the eigenvalues in the complex plane, and the shape of each mode."""
    figure = empty_figure(WIDTH, 3.2)
    left, right = figure.subplots(1, 2)
    _plane(left, modes.eigenvalues)
    for i, shape in enumerate(modes.shapes[:6]):
        if shape.any():
            style = curve_style(i) | {"linestyle": "-"}
            right.plot(shape.real / np.abs(shape).max(), marker="o", label=escaped(modes.describe(i)), **style)
    right.set_xlabel("velocity component")
    right.set_ylabel("shape (largest component 1)")
    right.legend(loc="best", fontsize=6)
    figure.suptitle(escaped(modes.mechanism.title), fontsize=9)
    return figure


@fixed_layout
def locus(found: RootLocus, campbell: bool) -> "Figure":
    """Draw real parts and frequencies over the parameter, and the roots in the complex plane."""
    figure = empty_figure(WIDTH, 5.2)
    axes = figure.subplots(2, 2)
    (real, plane), (hertz, unused) = axes
    unused.set_visible(False)
    for k, root in enumerate(found.eigenvalues.T):
        colour = {"color": COLOURS[k % len(COLOURS)]}
        real.plot(found.values, root.real, **colour)
        hertz.plot(found.values, np.abs(root.imag) / (2 * np.pi), **colour)
        plane.plot(root.real, root.imag, ".", markersize=2.5, **colour)
    real.axhline(0, color="black", linewidth=0.7)
    plane.axvline(0, color="black", linewidth=0.7)
    for x in found.changes:
        real.axvline(x, color="0.5", linestyle=":", linewidth=0.9)
    if campbell:
        top = hertz.get_ylim()[1]
        for n in ORDERS:
            hertz.plot(found.values, n * np.abs(found.values) / (2 * np.pi), color="0.6", linestyle="--", linewidth=0.8)
        hertz.set_ylim(0, top)
    real.set_ylabel("Re (1/s)")
    hertz.set_ylabel("|Im| / 2$\\pi$ (Hz)")
    for ax in (real, hertz):
        ax.set_xlabel(escaped(found.name))
    plane.set_xlabel("Re (1/s)")
    plane.set_ylabel("Im (1/s)")
    figure.suptitle(escaped(found.model), fontsize=9)
    return figure


@fixed_layout
def frequency_response(system: LinearSystem, hertz: np.ndarray) -> "Figure":
    """Draw gain and phase of each output over the frequency, for each input."""
    figure = empty_figure(WIDTH, 4.4)
    gain, phase = figure.subplots(2, 1, sharex=True)
    H = system.response(2 * np.pi * hertz)
    k = 0
    for i, output in enumerate(system.outputs):
        for j, name in enumerate(system.inputs):
            label = escaped(f"{output} / {name}")
            gain.plot(hertz, positive(np.abs(H[:, i, j])), label=label, **curve_style(k))
            phase.plot(hertz, np.degrees(np.unwrap(np.angle(H[:, i, j]))), **curve_style(k))
            k += 1
    for axis in (gain.xaxis, gain.yaxis):
        logarithmic(axis)
    gain.set_ylabel("gain")
    phase.set_ylabel("phase (degrees)")
    phase.set_xlabel("frequency (Hz)")
    legend_right(gain)
    figure.suptitle(escaped(system.title), fontsize=9)
    return figure


def _plane(ax: "Axes", roots: np.ndarray) -> None:
    stable = roots.real <= 0
    ax.plot(roots[stable].real, roots[stable].imag, "x", color=COLOURS[0])
    ax.plot(roots[~stable].real, roots[~stable].imag, "x", color=COLOURS[1])
    ax.axvline(0, color="black", linewidth=0.7)
    ax.set_xlabel("Re (1/s)")
    ax.set_ylabel("Im (1/s)")
