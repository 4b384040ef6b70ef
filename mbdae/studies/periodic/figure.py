"""Figures of periodic motions: one period in the phase plane, multipliers, and both over a parameter."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ...mechanism.tree.coordinate_units import coordinate_units
from ...solution.signals import units as signal_units
from ...system import Array
from ...units import displayed, quantity, unit_name
from ..figures import COLOURS, WIDTH, empty_figure, escaped, fixed_layout

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .branch import Branch
    from .result import PeriodicMotion

SHORT = {
    "fold": "fold",
    "doubling": "period doubling",
    "neimark-sacker": "Neimark-Sacker",
    "branch": "branch point",
    "grazing": "grazing",
}


@fixed_layout
def motion(found: "PeriodicMotion") -> "Figure":
    """Draw one period in the phase planes of the joints of one coordinate, and the multipliers at the unit circle."""
    figure = empty_figure(WIDTH, 3.2)
    columns, units, _ = found.to_columns()
    joints = [name[2:] for name in columns if name.startswith("q.") and f"v.{name[2:]}" in columns][: len(COLOURS)]
    *left, right = figure.subplots(1, 2 if joints else 1, squeeze=False)[0]
    for axes in left:
        _phase_planes(axes, columns, units, joints)
    _unit_circle(right, found.multipliers)
    figure.suptitle(escaped(f"{found.mechanism.title}: T = {quantity(found.T, 's')}, {found.stability}"), fontsize=9)
    return figure


def _phase_planes(axes: "Axes", columns: Mapping[str, Array], units: Mapping[str, str], joints: list[str]) -> None:
    breaks = np.flatnonzero(np.diff(columns["t"]) == 0) + 1
    for k, joint in enumerate(joints):
        for i, (q, v) in enumerate(zip(*(np.split(columns[f"{x}.{joint}"], breaks) for x in "qv"), strict=True)):
            shown = (displayed(x, units[f"{letter}.{joint}"])[0] for letter, x in (("q", q), ("v", v)))
            axes.plot(*shown, color=COLOURS[k], label=escaped(joint) if i == 0 else None)
    for letter, label, word in (("q", axes.set_xlabel, "coordinate"), ("v", axes.set_ylabel, "velocity")):
        kinds = dict.fromkeys(unit_name(units[f"{letter}.{joint}"]) for joint in joints)
        label(f"{word} ({', '.join(kinds)})")
    axes.legend(loc="best", fontsize=6)


@fixed_layout
def branch(found: "Branch", signal: str) -> "Figure":
    """Draw extrema of a signal, the magnitudes of the multipliers against the parameter, and their paths."""
    figure = empty_figure(WIDTH, 2.6)
    amplitude, magnitude, plane = figure.subplots(1, 3)
    mech = found.points[0].motion.mechanism
    signal = signal or next(iter(coordinate_units(mech)))
    unit = signal_units(mech).get(signal, "")
    values, unit_of_parameter = displayed(found.values, found.unit)
    for x in found.amplitudes(signal):
        amplitude.plot(values, displayed(x, unit)[0], color=COLOURS[0])
    amplitude.set_ylabel(escaped(f"{signal} ({unit_name(unit)})" if unit else signal))
    sizes = np.sort(np.abs(found.multipliers), axis=1)[:, ::-1]
    for k in range(sizes.shape[1]):
        magnitude.plot(values, sizes[:, k], color=COLOURS[k % len(COLOURS)])
    magnitude.axhline(1, color="black", linewidth=0.7)
    magnitude.set_ylabel("magnitude of multipliers")
    for axes in (amplitude, magnitude):
        axes.set_xlabel(escaped(f"{found.name} ({unit_of_parameter})" if unit_of_parameter else found.name))
        for b in found.bifurcations:
            axes.axvline(displayed(b.value, found.unit)[0], color="0.5", linestyle=":", linewidth=0.9)
    for b in found.bifurcations:
        at = displayed(b.value, found.unit)[0], 0.02
        magnitude.annotate(SHORT[b.kind], at, rotation=90, fontsize=6, ha="right")
    _unit_circle(plane, found.multipliers.ravel())
    figure.suptitle(escaped(mech.title), fontsize=9)
    return figure


def _unit_circle(axes: "Axes", multipliers: np.ndarray) -> None:
    phi = np.linspace(0, 2 * np.pi, 181)
    axes.plot(np.cos(phi), np.sin(phi), color="0.5", linewidth=0.8)
    stable = np.abs(multipliers) <= 1
    for chosen, colour in ((stable, COLOURS[0]), (~stable, COLOURS[1])):
        axes.plot(multipliers[chosen].real, multipliers[chosen].imag, ".", color=colour, markersize=3.5)
    axes.set_aspect("equal", "datalim")
    axes.set_xlabel("Re $\\mu$")
    axes.set_ylabel("Im $\\mu$")
