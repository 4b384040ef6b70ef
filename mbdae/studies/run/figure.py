"""The motion of a run over time."""

from typing import TYPE_CHECKING

import numpy as np

from ...solution.columns import signals, units
from ...solution.solution import Solution
from ..figures import COLOURS, NAMES, WIDTH, beside, logarithmic, own_style, plain, positive, settled, sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@settled
def motion(sol: Solution) -> "Figure":
    """Draw coordinates and velocities by unit, the residuals, and the error of the energy balance over time."""
    columns, unit = signals(sol, lam=False), units(sol.mechanism)
    groups: dict[str, list[str]] = {}
    for name in columns:
        if name in unit:
            groups.setdefault(unit[name], []).append(name)
    heights = [max(1.35, 0.16 * len(names)) for names in groups.values()] + [1.0, 1.0]
    figure = sheet(WIDTH, sum(heights) + 0.6)
    axes = np.atleast_1d(figure.subplots(len(heights), 1, sharex=True, height_ratios=heights))
    for ax, (u, names) in zip(axes, groups.items(), strict=False):
        for i, name in enumerate(names):
            ax.plot(sol.t, columns[name], label=plain(name), **own_style(i))
        ax.set_ylabel(f"{NAMES[u]} ({u})" if u != "1" else NAMES[u])
        beside(ax, labelspacing=0.3)
    for name, label, style in (("g", "$|g|$ (m, rad)", "-"), ("Gv", "$|G v|$ (m/s, rad/s)", ":")):
        axes[-2].plot(sol.t, positive(columns[name]), style, color=COLOURS[0], label=label)
    logarithmic(axes[-2].yaxis, 5)
    axes[-2].set_ylabel("residuals")
    beside(axes[-2])
    work = columns["work"] - columns["work"][0]
    axes[-1].plot(sol.t, columns["energy"] - columns["energy"][0] - work, color=COLOURS[0])
    axes[-1].set_ylabel("$E - E_0 - W$ (J)")
    axes[-1].set_xlabel("$t$ (s)")
    axes[-1].set_xlim(sol.t[0], sol.t[-1])
    figure.align_ylabels(axes)
    figure.suptitle(plain(f"{sol.mechanism.title}, {sol.settings.get('method', '')}"), fontsize=9)
    return figure
