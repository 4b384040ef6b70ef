"""Figure of the motion of a run over time."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...errors import UnknownNameError, as_list
from ...mechanism import Mechanism
from ...mechanism.tree.coordinate_units import coordinate_units
from ...solution.signals import find, signals, units
from ...solution.solution import Solution
from ...units import displayed, unit_name
from ..figures import (
    COLOURS,
    QUANTITY_NAMES,
    WIDTH,
    curve_style,
    empty_figure,
    escaped,
    fixed_layout,
    legend_right,
    logarithmic,
    positive,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_LEGEND = 24  # largest number of curves in a legend
RESIDUALS = (("g", "$|g|$ (m, rad)", "-"), ("Gv", "$|G v|$ (m/s, rad/s)", ":"))


@fixed_layout
def motion(sol: Solution, names: str | Sequence[str] = ()) -> "Figure":
    """Draw signals over time by unit; by default coordinates, velocities, residuals and the energy balance.

    For a textbook problem these are y and z.

    Raises:
        UnknownNameError: for an unknown signal.
    """
    if not isinstance(sol.problem, Mechanism):
        return _textbook(sol, names)
    mech = sol.mechanism
    chosen, unit = find(mech, names) if names else list(coordinate_units(mech)), units(mech)
    (t, time), groups = displayed(sol.t, "s"), dict[str, list[str]]()
    for name in chosen:
        groups.setdefault(unit[name], []).append(name)
    heights = [max(1.35, 0.16 * len(group)) for group in groups.values()] + ([] if names else [1.0, 1.0])
    columns = signals(sol, [*chosen, *(() if names else ("g", "Gv", "energy", "work"))])
    figure = empty_figure(WIDTH, sum(heights) + 0.6)
    axes: list[Axes] = np.atleast_1d(figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)).tolist()
    for ax, (u, group) in zip(axes, groups.items(), strict=False):
        for i, name in enumerate(group):
            ax.plot(t, displayed(columns[name], u)[0], label=escaped(name), **curve_style(i))
        ax.set_ylabel(f"{QUANTITY_NAMES.get(u, u)}\n({unit_name(u)})" if u not in ("1", "") else QUANTITY_NAMES[u])
        legend_right(ax, labelspacing=0.3)
    if not names:
        _balance(axes[-2:], t, columns)
    axes[-1].set_xlabel(f"$t$ ({time})")
    axes[-1].set_xlim(t[0], t[-1])
    figure.align_ylabels(axes)
    figure.suptitle(escaped(f"{mech.title}, {sol.settings.get('method', '')}"), fontsize=9)
    return figure


def _textbook(sol: Solution, names: str | Sequence[str]) -> "Figure":
    """Draw y and z over time, or some of them: ``"y.1"``, ``"z"``."""
    columns = sol.signals()
    requested = as_list(names or ("y", "z"), "signals are a list of names")
    for name in requested:
        if name not in columns and name not in ("y", "z"):
            raise UnknownNameError("signal", name, ["y", "z", *columns])
    groups = {k: [n for n in columns if n[0] == k and (n in requested or k in requested)] for k in ("y", "z")}
    shown = {k: group for k, group in groups.items() if group}
    figure = empty_figure(WIDTH, 2.2 * len(shown) + 0.6)
    axes: list[Axes] = np.atleast_1d(figure.subplots(len(shown), 1, sharex=True)).tolist()
    for ax, (k, group) in zip(axes, shown.items(), strict=True):
        for i, name in enumerate(group):
            ax.plot(sol.t, columns[name], label=escaped(name), **curve_style(i))
        ax.set_ylabel(f"${k}$")
        if len(group) <= MAX_LEGEND:
            legend_right(ax, labelspacing=0.3)
    axes[-1].set_xlabel("$t$")
    axes[-1].set_xlim(sol.t[0], sol.t[-1])
    figure.suptitle(escaped(f"{sol.problem.title}, {sol.settings.get('method', '')}"), fontsize=9)
    return figure


def _balance(axes: "Sequence[Axes]", t: np.ndarray, columns: Mapping[str, np.ndarray]) -> None:
    """Draw residuals, and the error of the energy balance."""
    for name, label, style in RESIDUALS:
        axes[0].plot(t, positive(columns[name]), style, color=COLOURS[0], label=label)
    logarithmic(axes[0].yaxis, 5)
    axes[0].set_ylabel("residuals")
    legend_right(axes[0])
    work = columns["work"] - columns["work"][0]
    error, unit = displayed(columns["energy"] - columns["energy"][0] - work, "J")
    axes[1].plot(t, error, color=COLOURS[0])
    axes[1].set_ylabel(f"$E - E_0 - W$ ({unit})")
