"""Figure of the drift of several runs over time."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...units import common_unit, displayed, unit_name
from ..figures import (
    WIDTH,
    curve_style,
    empty_figure,
    escaped,
    fixed_layout,
    legend_right,
    line_style,
    logarithmic,
    positive,
)
from .drift import History

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@fixed_layout
def drifts(runs: Sequence[History]) -> "Figure":
    """Draw |g|, and the relative error of the energy balance, of several runs over time.

    Textbook problems have no energy: if all runs are of textbook problems, the lower axes show |g_t + g_y f|.
    Runs of one method share a colour and a line style; labels name the mechanism if there are several.
    """
    figure = empty_figure(WIDTH, 4.6)
    top, bottom = figure.subplots(2, 1, sharex=True)
    titles = list(dict.fromkeys(run.title for run in runs))
    distinct = len({run.method for run in runs}) == len(runs)
    energies = any(run.energy is not None for run in runs)
    unit = common_unit(filter(None, (run.unit for run in runs)))
    for i, run in enumerate(runs):
        style = line_style(run.method) | ({} if distinct else curve_style(i))
        label = run.label if len(titles) == 1 else f"{run.title}: {run.label}"
        for ax, values in ((top, displayed(run.g, unit)[0]), (bottom, run.energy if energies else run.Gv)):
            if values is not None:
                _line(ax, displayed(run.t, "s")[0], values, (i + 0.5) / len(runs), label=escaped(label), **style)
    top.set_ylabel(f"max $|g|$ {f'({unit_name(unit)})' * bool(unit)}".rstrip())
    bottom.set_ylabel("$|E - E_0 - W|$ / scale" if energies else "max $|g_t + g_y f|$")
    bottom.set_xlabel(f"$t$ ({unit_name('s')})")
    span = min(run.t[0] for run in runs), max(run.t[-1] for run in runs)
    bottom.set_xlim(*displayed(np.array(span), "s")[0])
    figure.align_ylabels([top, bottom])
    legend_right(top)
    figure.suptitle(escaped(f"Drift of {', '.join(titles)}"), fontsize=9)
    return figure


def _line(ax: "Axes", t: np.ndarray, values: np.ndarray, shift: float, **style: Any) -> None:
    """Draw a curve with ten markers, at different times for different runs."""
    fractions = (np.arange(10) + shift) / 10
    nodes = np.abs(t[:, None] - (t[0] + fractions * (t[-1] - t[0]))).argmin(axis=0)
    ax.plot(t, positive(values), **style, lw=0.9, markevery=sorted(set(nodes.tolist())))
    logarithmic(ax.yaxis)
