"""Figure of deviations over the input, and of bands around paths."""

from typing import TYPE_CHECKING

import numpy as np

from ...units import displayed, unit_name
from ..figures import COLOURS, WIDTH, curve_style, empty_figure, escaped, fixed_layout, legend_right
from .deviations import PATH
from .result import Tolerance

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMN_WIDTH = 3.4  # in inches, of a journal
BAND = 0.06  # largest half-width of a magnified band, as a fraction of the extent of the path
CUTOFF = 20.0  # largest drawn deviation, in median worst cases: it grows without bound towards dead points
WORST, STATISTICAL = ("0.85", "worst case"), (COLOURS[0], "statistical")


@fixed_layout
def bands(found: Tolerance) -> "Figure":
    """Draw worst case, statistical deviation and the largest contributions against the input, and magnified bands."""
    m, paths = len(found.signals), found.paths()
    figure = empty_figure(WIDTH, 1.6 * m + 3.2 * len(paths) + 0.6)
    axes = figure.subplots(m + len(paths), 1, squeeze=False, height_ratios=[1.6] * m + [3.2] * len(paths))[:, 0]
    for i, (ax, name) in enumerate(zip(axes, found.signals, strict=False)):
        _deviations(ax, found, i, name)
    for ax, frame in zip(axes[m:], paths, strict=True):
        _path(ax, found, frame)
    figure.suptitle(escaped(f"Tolerances of {found.curve.mechanism.title} over {found.curve.drive}"), fontsize=9)
    return figure


@fixed_layout
def band(found: Tolerance, frame: str) -> "Figure":
    """Draw the path of a frame with its bands alone."""
    figure = empty_figure(COLUMN_WIDTH, 0.6 * COLUMN_WIDTH)
    _path(figure.subplots(), found, frame)
    return figure


def _deviations(ax: "Axes", found: Tolerance, m: int, name: str) -> None:
    """Draw the deviations of a signal, with its contributions."""
    worst, unit, input_unit = found.worst[m], found.units[name], found.curve.unit
    visible = np.where(worst > CUTOFF * np.nanmedian(worst), np.nan, 1.0)
    names, n_parameters = [*found.tolerances, *found.clearances], len(found.tolerances)
    largest = sorted(names.index(x.name) for x in found.contributions(name)[: len(COLOURS) - 1])
    for index, segment in enumerate(found.curve.monotonic_segments):
        u = displayed(found.curve.u[segment], input_unit)[0]
        for values, (colour, label), alpha in ((worst, WORST, 1.0), (found.statistical[m], STATISTICAL, 0.35)):
            shown = displayed((visible * values)[segment], unit)[0]
            ax.fill_between(u, -shown, shown, color=colour, alpha=alpha, lw=0, label=None if index else label)
        for i, k in enumerate(largest):
            derivatives = found.influences.derivatives[m, :, k] if k < n_parameters else found.magnitudes[m, :, k]
            shown = displayed((visible * derivatives * found.sizes[k])[segment], unit)[0]
            style = curve_style(1 + i)
            ax.plot(u, shown, label=None if index else escaped(names[k]), **style)
    for u, _ in found.curve.dead_points:
        ax.axvline(displayed(u, input_unit)[0], color="0.5", lw=0.7, ls=":")
    ax.set_ylabel(escaped(f"{name}\n({unit_name(unit)})"))
    ax.set_xlabel(escaped(f"{found.curve.drive} ({unit_name(input_unit)})"))
    legend_right(ax, labelspacing=0.3)


def _round_factor(x: float) -> float:
    """Return the largest of 1, 2 or 5 times a power of ten that is at most x."""
    power = 10.0 ** np.floor(np.log10(x))
    return float(power * max(k for k in (1, 2, 5) if k * power <= x))


def _path(ax: "Axes", found: Tolerance, frame: str) -> None:
    """Draw the path of a frame with magnified bands."""
    from matplotlib.collections import PolyCollection

    names = [name for name in found.signals if name.rpartition(".")[0] == PATH + frame]
    points, unit = displayed(np.array([found.influences.values[found.signals.index(name)] for name in names]).T, "m")
    worst, statistical, normals = found.band(frame)
    worst, statistical = (displayed(x, "m")[0] for x in (worst, statistical))
    worst = np.where(worst > CUTOFF * np.nanmedian(worst), np.nan, worst)
    factor = _round_factor(BAND * float(np.ptp(points, axis=0).max() / np.nanmax(worst)))
    for half, (colour, label), alpha in ((worst, WORST, 1.0), (statistical, STATISTICAL, 0.35)):
        width = factor * half[:, None] * normals
        outer, inner = points + width, points - width
        strips = np.stack([outer[:-1], outer[1:], inner[1:], inner[:-1]], axis=1)
        strips = strips[np.isfinite(strips).all(axis=(1, 2))]
        ax.add_collection(
            PolyCollection(list(strips), color=colour, alpha=alpha, lw=0, label=f"{label}, times {factor:g}")
        )
    ax.plot(*points.T, color="0.2", lw=0.8)
    ax.set_aspect("equal", "datalim")
    ax.set_xlabel(escaped(f"{names[0]} ({unit})"))
    ax.set_ylabel(escaped(f"{names[1]} ({unit})"))
    ax.legend(loc="best")
