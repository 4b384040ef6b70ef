"""Convergence plots of an order study."""

from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from ...units import displayed, quantity, unit_name
from ..figures import WIDTH, empty_figure, escaped, fixed_layout, legend_right, line_style, logarithmic
from .result import ObservedOrder, OrderStudy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MANY = 8  # number of methods above which there is one legend below the panels
PANEL, LINE = 2.7, 0.145  # heights in inches of a panel, and of a line of the legend
TITLE_WIDTH = 110  # characters
AXES = {
    "dq": "the derivative of $q$",
    "dv": "the derivative of $v$",
    "q": "$q$",
    "v": "$v$",
    "own lam": r"own $\lambda$",
    "lam": r"$\lambda$",
    "y": "$y$",
    "own z": "own $z$",
    "z": "$z$",
}


@fixed_layout
def convergence(study: OrderStudy) -> "Figure":
    """Draw the errors against the step size, one panel per quantity: fitted orders solid, claimed orders dotted.

    Hollow points are not used in the fit: they are below the floor of rounding and reference, or on coarse steps.
    """
    from matplotlib.lines import Line2D

    quantities = [s.quantity for s in next(iter(study.orders.values()))]
    rows, many = (len(quantities) + 1) // 2, len(study.orders) > MANY
    lines = -(-len(study.orders) // 2) + 2 if many else 0
    figure = empty_figure(WIDTH, PANEL * rows + LINE * lines + 0.4)
    axes = np.atleast_1d(figure.subplots(rows, 2)).flat
    for k, ax in enumerate(axes):
        if k >= len(quantities):
            ax.remove()
            continue
        logarithmic(ax.xaxis)
        logarithmic(ax.yaxis)
        for name, found in study.orders.items():
            _convergence_line(ax, name, found[k], study.T, study.units.get(quantities[k], ""))
        unit = unit_name(study.units.get(quantities[k], ""))
        ax.set_xlabel(f"step $h$ ({unit_name('s')})")
        ax.set_ylabel(f"error of {AXES.get(quantities[k], quantities[k])}{f' ({unit})' if unit else ''}")
        if not many:
            legend_right(ax, title="observed (claimed)", title_fontsize=7.5, alignment="left", handlelength=1.0)
    if many:
        symbols = ", ".join(AXES.get(q, q) for q in quantities)
        handles = [Line2D([], [], **line_style(name) | {"linestyle": "none"}) for name in study.orders]
        labels = [f"{name}  " + "  ".join(map(_observed, found)) for name, found in study.orders.items()]
        title = f"method, and observed (claimed) orders of {symbols}"
        figure.legend(handles, labels, loc="outside lower center", ncols=2, title=title, title_fontsize=7.5)
    end = quantity(study.T, "s", "g")
    title = f"{study.title}, T = {end}; lines: fitted orders, dotted: claimed\n{study.computed_by}"
    figure.suptitle(escaped("\n".join(fill(line, TITLE_WIDTH) for line in title.splitlines())), fontsize=9)
    return figure


def _observed(found: ObservedOrder) -> str:
    """Return the observed order, and the claimed order in brackets."""
    observed = "-" if found.observed is None else f"{round(found.observed, 2) + 0.0:.2f}"  # + 0.0: no -0.00
    return f"{observed} ({found.claimed})"


def _convergence_line(ax: "Axes", name: str, fit: ObservedOrder, T: float, unit: str) -> None:
    style = {**line_style(name), "linestyle": "none"}
    h, e = displayed(T / np.array(fit.steps, float), "s")[0], displayed(np.array(fit.errors), unit)[0]
    shown = (e > 0) & np.isfinite(e)
    used = np.zeros(len(e), bool)
    used[slice(*fit.fitted)] = True
    ax.plot(h[shown & ~used], e[shown & ~used], **{**style, "markerfacecolor": "white"}, alpha=0.6)
    ax.plot(h[used], e[used], **style, label=f"{name} {_observed(fit)}")
    if fit.observed is None:
        return
    middle = np.exp(np.mean(np.log(h[used]))), np.exp(np.mean(np.log(e[used])))
    ends = np.array([h[used][0], h[used][-1]])
    for order, line, width in ((fit.observed, "-", 1.1), (fit.claimed, ":", 0.9)):
        ax.plot(ends, middle[1] * (ends / middle[0]) ** order, line, color=style["color"], lw=width)
