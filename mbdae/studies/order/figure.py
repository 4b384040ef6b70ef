"""Convergence plots of an order study."""

from typing import TYPE_CHECKING

import numpy as np

from ..figures import WIDTH, empty_figure, escaped, fixed_layout, legend_right, line_style, logarithmic
from .result import ObservedOrder, OrderStudy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AXES = {
    "dq": "the derivative of $q$",
    "dv": "the derivative of $v$",
    "q": "$q$ (rad, m)",
    "v": "$v$ (rad/s, m/s)",
    "own lam": r"own $\lambda$ (N, N m)",
    "lam": r"$\lambda$ (N, N m)",
    "y": "$y$",
    "own z": "own $z$",
    "z": "$z$",
}


@fixed_layout
def convergence(study: OrderStudy) -> "Figure":
    """Draw the errors over the step size, one panel per quantity: the fitted slope solid, the claimed one dotted.

    Hollow points are not used in the fit: they are below the floor of rounding and reference, or on coarse steps.
    """
    quantities = [s.quantity for s in next(iter(study.orders.values()))]
    rows = (len(quantities) + 1) // 2
    figure = empty_figure(WIDTH, max(2.7, 0.6 + 0.13 * len(study.orders)) * rows + 0.3)
    axes = np.atleast_1d(figure.subplots(rows, 2)).flat
    for k, ax in enumerate(axes):
        if k >= len(quantities):
            ax.remove()
            continue
        logarithmic(ax.xaxis)
        logarithmic(ax.yaxis)
        for name, slopes in study.orders.items():
            _convergence_line(ax, name, slopes[k], study.T)
        ax.set_xlabel("step $h$ (s)")
        ax.set_ylabel(f"error of {AXES.get(quantities[k], quantities[k])}")
        legend_right(ax, title="observed (claimed)", title_fontsize=7.5, alignment="left", handlelength=1.0)
    title = f"{study.title}, T = {study.T:g} s; lines: fitted slopes, dotted: claimed\n{study.computed_by}"
    figure.suptitle(escaped(title), fontsize=9)
    return figure


def _convergence_line(ax: "Axes", name: str, slope: ObservedOrder, T: float) -> None:
    style = {**line_style(name), "linestyle": "none"}
    h, e = T / np.array(slope.steps, float), np.array(slope.errors)
    shown = (e > 0) & np.isfinite(e)
    used = np.zeros(len(e), bool)
    used[slice(*slope.fitted)] = True
    observed = "-" if slope.observed is None else f"{slope.observed:.2f}"
    label = f"{name} {observed} ({slope.claimed})"
    ax.plot(h[shown & ~used], e[shown & ~used], **{**style, "markerfacecolor": "white"}, alpha=0.6)
    ax.plot(h[used], e[used], **style, label=label)
    if slope.observed is None:
        return
    middle = np.exp(np.mean(np.log(h[used]))), np.exp(np.mean(np.log(e[used])))
    ends = np.array([h[used][0], h[used][-1]])
    for order, line, width in ((slope.observed, "-", 1.1), (slope.claimed, ":", 0.9)):
        ax.plot(ends, middle[1] * (ends / middle[0]) ** order, line, color=style["color"], lw=width)
