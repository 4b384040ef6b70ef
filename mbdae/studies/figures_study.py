"""Figures of studies: work-precision diagrams and lines of convergence."""

from typing import TYPE_CHECKING

import numpy as np

from .comparison.comparison import Comparison, Point, Quantity
from .figures import WIDTH, beside, logarithmic, look, plain, settled, sheet
from .order.order import OrderStudy, Slope

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SYMBOLS = {"q": "q", "v": "v", "lam": r"\lambda"}
AXES = {
    "q": "$q$ (rad, m)",
    "v": "$v$ (rad/s, m/s)",
    "own lam": r"own $\lambda$ (N, N m)",
    "lam": r"$\lambda$ (N, N m)",
    "y": "$y$",
    "own z": "own $z$",
    "z": "$z$",
}
UNITS = {"q": "rad, m", "v": "rad/s, m/s", "lam": "N, N m"}


@settled
def work_precision(result: Comparison, quantity: Quantity = "q") -> "Figure":
    """Draw the error over linear solves and over wall time; errors that the reference does not tell are bounds.

    A bound is drawn at the upper edge of the grey band, with an arrow down and without a line to it.
    """
    figure = sheet(WIDTH, 3.5)
    axes = figure.subplots(1, 2, sharey=True)
    for ax, work, label in zip(axes, ("solves", "seconds"), ("linear solves", "wall time (s)"), strict=True):
        logarithmic(ax.xaxis)
        logarithmic(ax.yaxis)
        for name in result.methods:
            _curve(ax, result, result.of(name), work, quantity)
        ax.set_xlabel(label)
    axes[0].set_ylabel(rf"max $|{SYMBOLS[quantity]} - {SYMBOLS[quantity]}_\mathrm{{ref}}|$ ({UNITS[quantity]})")
    if any(p.success and not result.known(p, quantity) for p in result.points):
        floor, high = result.floor(quantity), axes[0].get_ylim()[1]
        for ax in axes:
            ax.axhspan(floor / 10, floor, color="0.88", lw=0)
            ax.set_ylim(floor / 10, high)
        axes[0].text(0.02, 0.02, "not known by the reference", transform=axes[0].transAxes, fontsize=7, color="0.35")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    t0, t1 = result.t_span
    figure.suptitle(plain(f"{result.title}, {t0:g} to {t1:g} s"), fontsize=9)
    return figure


def _curve(ax: "Axes", result: Comparison, points: list[Point], work: str, quantity: Quantity) -> None:
    """The known errors of a method as a line, the others as bounds."""
    points = [p for p in points if getattr(p, work) is not None]
    if not points:
        return
    style = look(points[0].method)
    known = [(getattr(p, work), p.error(quantity)) for p in points if result.known(p, quantity)]
    ax.plot(*zip(*known, strict=True) if known else ([], []), **style, label=points[0].method)
    below = [getattr(p, work) for p in points if not result.known(p, quantity)]
    if below:
        edge = np.full(len(below), result.floor(quantity))
        ax.errorbar(below, edge, yerr=0.6 * edge, uplims=True, capsize=1.5, **{**style, "linestyle": "none"}, lw=0.7)


@settled
def convergence(study: OrderStudy) -> "Figure":
    """Draw the errors over the step size, one panel per quantity: the fitted slope as a line, the claimed one dotted.

    Hollow points did not count for the fit: they lie below the floor of rounding and reference, or on coarse steps.
    """
    quantities = [s.quantity for s in next(iter(study.slopes.values()))]
    rows = (len(quantities) + 1) // 2
    figure = sheet(WIDTH, max(2.7, 0.6 + 0.13 * len(study.slopes)) * rows + 0.3)
    axes = np.atleast_1d(figure.subplots(rows, 2)).flat
    for k, ax in enumerate(axes):
        if k >= len(quantities):
            ax.remove()
            continue
        logarithmic(ax.xaxis)
        logarithmic(ax.yaxis)
        for name, slopes in study.slopes.items():
            _convergence_line(ax, name, slopes[k], study.T)
        ax.set_xlabel("step $h$ (s)")
        ax.set_ylabel(f"error of {AXES.get(quantities[k], quantities[k])}")
        beside(ax, title="observed (claimed)", title_fontsize=7.5, alignment="left", handlelength=1.0)
    title = f"{study.title}, T = {study.T:g} s; lines: fitted slopes, dotted: claimed"
    figure.suptitle(plain(title), fontsize=9)
    return figure


def _convergence_line(ax: "Axes", name: str, slope: Slope, T: float) -> None:
    style = {**look(name), "linestyle": "none"}
    h, e = T / np.array(slope.steps, float), np.array(slope.errors)
    shown = (e > 0) & np.isfinite(e)
    used = np.zeros(len(e), bool)
    used[slice(*slope.fitted)] = True
    seen = "-" if slope.observed is None else f"{slope.observed:.2f}"
    label = f"{name} {seen} ({slope.claimed})"
    ax.plot(h[shown & ~used], e[shown & ~used], **{**style, "markerfacecolor": "white"}, alpha=0.6)
    ax.plot(h[used], e[used], **style, label=label)
    if slope.observed is None:
        return
    middle = np.exp(np.mean(np.log(h[used]))), np.exp(np.mean(np.log(e[used])))
    ends = np.array([h[used][0], h[used][-1]])
    for order, line, width in ((slope.observed, "-", 1.1), (slope.claimed, ":", 0.9)):
        ax.plot(ends, middle[1] * (ends / middle[0]) ** order, line, color=style["color"], lw=width)
