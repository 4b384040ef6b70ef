"""Figure of a sweep: a result over each parameter, and its distribution."""

from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError, UnknownNameError
from ..figures import WIDTH, empty_figure, escaped, fixed_layout
from .table import Sweep

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = 3
HEIGHT = 2.1  # inches of a row
COLOURS = ("#0072B2", "#D55E00")


@fixed_layout
def spread(sweep: Sweep, output: str | None = None) -> "Figure":
    """Draw a result of every run over each numeric parameter, and its histogram.

    Args:
        sweep: the table.
        output: name of a column that is a number; the first output, or the number of steps, when left out.

    Raises:
        UnknownNameError: for a column that does not exist.
        InputError: for a column, or a sweep, without numbers to draw.
    """
    numeric = [n for n in sweep.names if sweep.kinds.get(n, "float") in ("int", "float")]
    name = output or (sweep.outputs or ["steps"])[0]
    if name not in numeric:
        raise UnknownNameError("column of numbers", name, numeric)
    y = sweep[name].astype(float)
    known = np.isfinite(y)
    if not known.any():
        raise InputError(f"no run of the sweep has a value of {name!r} to draw")
    parameters = [n for n in sweep.parameters if n in numeric and n != name]
    rows = -(-(len(parameters) + 1) // COLUMNS)
    figure = empty_figure(WIDTH, HEIGHT * rows + 0.3)
    axes = figure.subplots(rows, min(COLUMNS, len(parameters) + 1), squeeze=False)
    panels = list(axes.flat)
    for ax, parameter in zip(panels, parameters, strict=False):
        ax.plot(sweep[parameter][known], y[known], ".", color=COLOURS[0], markersize=3, alpha=0.7)
        ax.set_xlabel(escaped(parameter))
        ax.locator_params(axis="x", nbins=3)
    unit = sweep.meta.get("units", {}).get(name)
    for row in axes:
        row[0].set_ylabel(escaped(f"{name} ({unit})" if unit else name))
    last = panels[len(parameters)]
    last.hist(y[known], bins="sqrt", color=COLOURS[0], orientation="horizontal")
    last.axhline(y[known].mean(), color=COLOURS[1], linewidth=1.2)
    last.set_xlabel("runs; line: mean")
    for ax in panels[len(parameters) + 1 :]:
        ax.set_visible(False)
    failed = "" if known.all() else f", {(~known).sum()} without a value"
    title = f"{sweep.meta['manifest']['model']}: {len(sweep)} runs{failed}"
    figure.suptitle(escaped(title), fontsize=9)
    return figure
