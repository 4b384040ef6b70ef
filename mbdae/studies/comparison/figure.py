"""Work-precision diagrams of a comparison."""

from typing import TYPE_CHECKING

import numpy as np

from ...units import displayed, quantity, unit_name
from ..figures import WIDTH, empty_figure, escaped, fixed_layout, line_style, logarithmic
from .comparison import Comparison
from .run_result import RunResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SYMBOLS = {"lam": r"\lambda"}


@fixed_layout
def work_precision(result: Comparison, of: str | None = None) -> "Figure":
    """Draw errors over linear solves and over wall time; errors below the uncertainty are drawn as bounds.

    A bound is an arrow down at the upper edge of the grey band, not connected by a line.
    """
    name = result.quantity(of)
    unit = result.unit(name)
    figure = empty_figure(WIDTH, 3.5)
    axes = figure.subplots(1, 2, sharey=True)
    time = f"wall time, {result.meta.get('backend', 'unknown')} back end ({unit_name('s')})"
    for ax, work, label in zip(axes, ("solves", "seconds"), ("linear solves", time), strict=True):
        logarithmic(ax.xaxis)
        logarithmic(ax.yaxis)
        for method in result.methods:
            _curve(ax, result, result.of(method), work, name)
        ax.set_xlabel(label)
    symbol, label = SYMBOLS.get(name, name), f" ({unit_name(unit)})" if unit else ""
    axes[0].set_ylabel(rf"max $|{symbol} - {symbol}_\mathrm{{ref}}|${label}")
    if any(p.success and not result.known(p, name) for p in result.points):
        floor, high = displayed(result.floor(name), unit)[0], axes[0].get_ylim()[1]
        for ax in axes:
            ax.axhspan(floor / 10, floor, color="0.88", lw=0)
            ax.set_ylim(floor / 10, high)
        axes[0].text(
            0.02, 0.02, "below the accuracy of the reference", transform=axes[0].transAxes, fontsize=7, color="0.35"
        )
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    t0, t1 = result.t_span
    span = f"{displayed(t0, 's')[0]:g} to {quantity(t1, 's', 'g')}"
    figure.suptitle(escaped(f"{result.title}, {span}\n{result.computed_by}"), fontsize=9)
    return figure


def _curve(ax: "Axes", result: Comparison, points: list[RunResult], work: str, name: str) -> None:
    """Draw the known errors of a method as a line, unknown errors as bounds."""
    points = [p for p in points if getattr(p, work) is not None]
    if not points:
        return
    style = line_style(points[0].method)
    work_unit, unit = "s" if work == "seconds" else "", result.unit(name)
    known = [
        (displayed(getattr(p, work), work_unit)[0], displayed(p.errors[name], unit)[0])
        for p in points
        if result.known(p, name)
    ]
    ax.plot(*zip(*known, strict=True) if known else ([], []), **style, label=points[0].method)
    below = [displayed(getattr(p, work), work_unit)[0] for p in points if not result.known(p, name)]
    if below:
        edge = np.full(len(below), displayed(result.floor(name), unit)[0])
        ax.errorbar(below, edge, yerr=0.6 * edge, uplims=True, capsize=1.5, **{**style, "linestyle": "none"}, lw=0.7)
