"""Figures of modes: roots in the complex plane, root loci, Campbell diagrams and frequency responses."""

from typing import TYPE_CHECKING

import numpy as np

from ...units import common_unit, displayed
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
from ..statics.equilibrium import velocity_labels
from .linear_system import LinearSystem
from .modes import Modes
from .root_locus import RootLocus

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_TICKS = 16  # number of coordinates labelled on an axis
ORDERS = (1, 2, 3)  # multiples of the speed in a Campbell diagram


@fixed_layout
def roots(modes: Modes) -> "Figure":
    """Draw the eigenvalues in the complex plane, and the shape of each mode."""
    figure = empty_figure(WIDTH, 3.2)
    left, right = figure.subplots(1, 2)
    _plane(left, modes.eigenvalues)
    units = ""
    for i in range(min(6, len(modes.roots))):
        shape, names = modes.displayed_shape(i)
        units = common_unit(names)
        if shape.any():
            style = curve_style(i) | {"linestyle": "-"}
            right.plot(shape.real, marker="o", label=escaped(modes.describe(i)), **style)
    labels = velocity_labels(modes.mechanism, np.arange(modes.mechanism.nv))
    shown = range(0, len(labels), -(-len(labels) // MAX_TICKS) or 1)
    right.set_xticks(list(shown), [escaped(labels[i]) for i in shown], rotation=45, ha="right")
    right.set_ylabel(f"shape ({units}; largest component 1)" if "," in units else "shape (largest component 1)")
    right.legend(loc="best", fontsize=6)
    figure.suptitle(escaped(modes.mechanism.title), fontsize=9)
    return figure


@fixed_layout
def locus(found: RootLocus, campbell: bool) -> "Figure":
    """Draw real parts and frequencies against the parameter, and the roots in the complex plane."""
    figure = empty_figure(WIDTH, 5.2)
    axes = figure.subplots(2, 2)
    (real, plane), (hertz, unused) = axes
    unused.set_visible(False)
    (roots, rate_unit), (values, unit) = displayed(found.eigenvalues, "1/s"), displayed(found.values, found.unit)
    for k, root in enumerate(roots.T):
        colour = {"color": COLOURS[k % len(COLOURS)]}
        real.plot(values, root.real, **colour)
        hertz.plot(values, np.abs(found.eigenvalues[:, k].imag) / (2 * np.pi), **colour)
        plane.plot(root.real, root.imag, ".", markersize=2.5, **colour)
    real.axhline(0, color="black", linewidth=0.7)
    plane.axvline(0, color="black", linewidth=0.7)
    for x in found.changes:
        real.axvline(displayed(x, found.unit)[0], color="0.5", linestyle=":", linewidth=0.9)
    if campbell:
        top = hertz.get_ylim()[1]
        for n in ORDERS:
            hertz.plot(values, n * np.abs(found.values) / (2 * np.pi), color="0.6", linestyle="--", linewidth=0.8)
        hertz.set_ylim(0, top)
    real.set_ylabel(f"Re ({rate_unit})")
    hertz.set_ylabel("|Im| / 2$\\pi$ (Hz)")
    for ax in (real, hertz):
        ax.set_xlabel(escaped(f"{found.name} ({unit})" if unit else found.name))
    plane.set_xlabel(f"Re ({rate_unit})")
    plane.set_ylabel(f"Im ({rate_unit})")
    figure.suptitle(escaped(found.model), fontsize=9)
    return figure


@fixed_layout
def frequency_response(system: LinearSystem, hertz: np.ndarray) -> "Figure":
    """Draw gain and phase of each output against the frequency, for each input."""
    figure = empty_figure(WIDTH, 4.4)
    gain, phase = figure.subplots(2, 1, sharex=True)
    H = system.response(2 * np.pi * hertz)
    k = 0
    for i, output in enumerate(system.outputs):
        for j, name in enumerate(system.inputs):
            label = escaped(f"{output} / {name}")
            size, unit = displayed(np.abs(H[:, i, j]), system.units[i][j])
            label += f" ({unit})" if unit else ""
            gain.plot(hertz, positive(size), label=label, **curve_style(k))
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
    stable, (roots, unit) = roots.real <= 0, displayed(roots, "1/s")
    ax.plot(roots[stable].real, roots[stable].imag, "x", color=COLOURS[0])
    ax.plot(roots[~stable].real, roots[~stable].imag, "x", color=COLOURS[1])
    ax.axvline(0, color="black", linewidth=0.7)
    ax.set_xlabel(f"Re ({unit})")
    ax.set_ylabel(f"Im ({unit})")
