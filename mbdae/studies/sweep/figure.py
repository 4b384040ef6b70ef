"""Figure of a sweep: a result against each parameter and its distribution, or on a grid of two."""

from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError, UnknownNameError
from ...units import displayed
from ..figures import COLOURS, WIDTH, empty_figure, escaped, fixed_layout, logarithmic
from .table import Sweep

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

COLUMNS = 3
HEIGHT, MAP_HEIGHT = 2.1, 3.6  # inches of a row of panels, and of a heat map
MIN_RATIO = 100.0  # smallest ratio of the largest to the smallest value on a logarithmic axis
MAX_MEDIAN = 0.25  # largest median of values on a logarithmic axis, relative to their maximum


@fixed_layout
def spread(sweep: Sweep, output: str | None = None) -> "Figure":
    """Draw a result of every run against each numeric parameter, and its histogram; a grid over two as a heat map.

    Args:
        sweep: the table.
        output: name of a column that is a number; the first output, or the number of steps, when left out.

    Raises:
        UnknownNameError: for a column that does not exist.
        InputError: for a column, or a sweep, without numbers to draw.
    """
    name, parameters = _chosen(sweep, output)
    y = sweep[name].astype(float)
    known = np.isfinite(y)
    if not known.any():
        raise InputError(f"no run of the sweep has a value of {name!r} to draw")
    y, unit = displayed(y, sweep.meta.get("units", {}).get(name, ""))
    label = escaped(f"{name} ({unit})" if unit else name)
    values = [np.unique(sweep[n]) for n in sweep.parameters] if parameters == sweep.parameters else []
    if len(values) == 2 and min(map(len, values)) > 1 and _is_full_grid(sweep, values):
        figure = _heat_map(sweep, y, values, label)
    else:
        figure = _panels(sweep, parameters, y, label, curve=[len(x) for x in values] == [len(sweep)])
    failed = "" if known.all() else f", {(~known).sum()} without a value"
    title = f"{sweep.meta['manifest']['model']}: {len(sweep)} runs{failed}"
    figure.suptitle(escaped(title), fontsize=9)
    return figure


def _chosen(sweep: Sweep, output: str | None) -> tuple[str, list[str]]:
    """Return the column to draw, and the parameters that are numbers."""
    numeric = [n for n in sweep.names if sweep.kinds.get(n, "float") in ("int", "float")]
    name = output or (sweep.outputs or ["steps"])[0]
    if name not in numeric:
        raise UnknownNameError("column of numbers", name, numeric)
    return name, [n for n in sweep.parameters if n in numeric and n != name]


def _is_full_grid(sweep: Sweep, values: list[np.ndarray]) -> bool:
    """Return whether there is one run for each combination of the values of two parameters."""
    pairs = {*zip(*(sweep[n].tolist() for n in sweep.parameters), strict=True)}
    return len(pairs) == len(values[0]) * len(values[1]) == len(sweep)


def _panels(sweep: Sweep, parameters: list[str], y: np.ndarray, label: str, *, curve: bool) -> "Figure":
    """Draw points against each parameter, or a curve against the only one, and the histogram."""
    known = np.isfinite(y)
    rows = -(-(len(parameters) + 1) // COLUMNS)
    figure = empty_figure(WIDTH, HEIGHT * rows + 0.3)
    axes = figure.subplots(rows, min(COLUMNS, len(parameters) + 1), squeeze=False)
    panels = list(axes.flat)
    for ax, parameter in zip(panels, parameters, strict=False):
        x, name = _axis(sweep, parameter, sweep[parameter][known])
        order = x.argsort() if curve else slice(None)
        ax.plot(x[order], y[known][order], ".-" if curve else ".", color=COLOURS[0], markersize=3, alpha=0.7)
        ax.set_xlabel(name)
        if _spans_decades(x):
            logarithmic(ax.xaxis, 4)
        else:
            ax.locator_params(axis="x", nbins=3)
    for row in axes:
        row[0].set_ylabel(label)
    last = panels[len(parameters)]
    last.hist(y[known], bins="sqrt", color=COLOURS[0], orientation="horizontal")
    last.axhline(y[known].mean(), color=COLOURS[1], linewidth=1.2)
    last.set_xlabel("runs; line: mean")
    for ax in panels[len(parameters) + 1 :]:
        ax.set_visible(False)
    return figure


def _heat_map(sweep: Sweep, y: np.ndarray, values: list[np.ndarray], label: str) -> "Figure":
    """Draw a grid over two parameters; runs without a value are white."""
    table = np.full([len(x) for x in values], np.nan)
    table[tuple(np.searchsorted(x, sweep[n]) for x, n in zip(values, sweep.parameters, strict=True))] = y
    figure = empty_figure(WIDTH, MAP_HEIGHT)
    ax = figure.subplots()
    ax.grid(visible=False)
    (x, x_label), (y, y_label) = (_axis(sweep, n, x) for n, x in zip(sweep.parameters, values, strict=True))
    edges = [_cell_edges(ax.xaxis, x), _cell_edges(ax.yaxis, y)]
    figure.colorbar(ax.pcolormesh(*edges, table.T), label=label)
    ax.set_xlabel(x_label)
    ax.set_ylabel(y_label)
    return figure


def _axis(sweep: Sweep, parameter: str, values: np.ndarray) -> tuple[np.ndarray, str]:
    """Return values of a parameter in display units, and the label of their axis."""
    x, unit = displayed(values, sweep.meta.get("units", {}).get(parameter, ""))
    return x, escaped(f"{parameter} ({unit})" if unit else parameter)


def _spans_decades(x: np.ndarray) -> bool:
    """Return whether values span decades and most are small, as in a geometric series."""
    largest = x.max()
    median = np.quantile(x, 0.5, method="lower")
    return bool(x.min() > 0 and largest >= MIN_RATIO * x.min() and median <= MAX_MEDIAN * largest)


def _cell_edges(axis: "Axis", x: np.ndarray) -> np.ndarray:
    """Return the edges between increasing values; the axis is logarithmic if they are spread over decades."""
    many_decades = _spans_decades(x)
    if many_decades:
        logarithmic(axis)
        x = np.log(x)
    middle = 0.5 * (x[1:] + x[:-1])
    edges = np.concatenate([[2 * x[0] - middle[0]], middle, [2 * x[-1] - middle[-1]]])
    return np.exp(edges) if many_decades else edges
