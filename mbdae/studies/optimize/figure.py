"""Figure of the progress of a search: cost and parameters over the evaluated points."""

from typing import TYPE_CHECKING

import numpy as np

from ..figures import WIDTH, curve_style, empty_figure, escaped, fixed_layout, legend_right, positive
from .result import Optimum

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@fixed_layout
def search(found: Optimum) -> "Figure":
    """Draw the cost, and the parameters from 0 at the start to 1 at the optimum, at each evaluated point."""
    figure = empty_figure(WIDTH, 4.0)
    upper, lower = figure.subplots(2, 1, sharex=True)
    costs = np.array([t.cost for t in found.history])
    upper.plot(costs, ".-", color="#0072B2")
    if (positive(costs) > 0).all() and costs.max() > 10 * costs.min():
        upper.set_yscale("log")
    upper.set_ylabel("cost")
    for i, (name, end) in enumerate(found.values.items()):
        x = np.array([t.values[name] for t in found.history])
        lower.plot((x - x[0]) / ((end - x[0]) or 1.0), ".", label=escaped(name), **curve_style(i))
    lower.set_ylabel("(p - start) / (optimum - start)")
    lower.set_xlabel("point")
    legend_right(lower)
    return figure
