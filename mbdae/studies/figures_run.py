"""Figures of runs: the motion of one, and how several drift."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..solution.columns import units
from ..solution.solution import Solution
from .drift.drift import History
from .figures import WIDTH, beside, logarithmic, look, plain, settled, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES = {"rad": "angles", "m": "positions", "1": "quaternions", "rad/s": "turning rates", "m/s": "speeds"}
PATTERNS = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (8, 2)))
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#E69F00", "#56B4E9")


@settled
def motion(sol: Solution) -> "Figure":
    """Draw coordinates and velocities by unit, the residuals, and the error of the energy balance over time."""
    signals, unit = sol.signals(), units(sol.mechanism)
    groups: dict[str, list[str]] = {}
    for name in signals:
        if name in unit:
            groups.setdefault(unit[name], []).append(name)
    heights = [max(1.35, 0.16 * len(names)) for names in groups.values()] + [1.0, 1.0]
    figure = sheet(WIDTH, sum(heights) + 0.6)
    axes = np.atleast_1d(figure.subplots(len(heights), 1, sharex=True, height_ratios=heights))
    for ax, (u, names) in zip(axes, groups.items(), strict=False):
        for i, name in enumerate(names):
            ax.plot(sol.t, signals[name], label=plain(name), **_own(i))
        ax.set_ylabel(f"{NAMES[u]} ({u})" if u != "1" else NAMES[u])
        beside(ax, labelspacing=0.3)
    for name, label, style in (("g", "$|g|$ (m, rad)", "-"), ("Gv", "$|G v|$ (m/s, rad/s)", ":")):
        axes[-2].plot(sol.t, _positive(signals[name]), style, color=COLOURS[0], label=label)
    logarithmic(axes[-2].yaxis, 5)
    axes[-2].set_ylabel("residuals")
    beside(axes[-2])
    work = signals["work"] - signals["work"][0]
    axes[-1].plot(sol.t, signals["energy"] - signals["energy"][0] - work, color=COLOURS[0])
    axes[-1].set_ylabel("$E - E_0 - W$ (J)")
    axes[-1].set_xlabel("$t$ (s)")
    axes[-1].set_xlim(sol.t[0], sol.t[-1])
    figure.align_ylabels(axes)
    figure.suptitle(plain(f"{sol.mechanism.title}, {sol.settings.get('method', '')}"), fontsize=9)
    return figure


@settled
def drifts(runs: Sequence[History]) -> "Figure":
    """Draw |g|, and the relative error of the energy balance, of several runs over time.

    Runs of one method have colours and line styles of their own; those of several mechanisms say which is theirs.
    """
    figure = sheet(WIDTH, 4.6)
    top, bottom = figure.subplots(2, 1, sharex=True)
    titles = list(dict.fromkeys(run.title for run in runs))
    apart = len({run.method for run in runs}) == len(runs)
    for i, run in enumerate(runs):
        style = look(run.method) | ({} if apart else _own(i))
        label = run.label if len(titles) == 1 else f"{run.title}: {run.label}"
        for ax, values in ((top, run.g), (bottom, run.energy)):
            _line(ax, run.t, values, (i + 0.5) / len(runs), label=plain(label), **style)
    top.set_ylabel("max $|g|$ (m, rad)")
    bottom.set_ylabel("$|E - E_0 - W|$ / scale")
    bottom.set_xlabel("$t$ (s)")
    bottom.set_xlim(min(run.t[0] for run in runs), max(run.t[-1] for run in runs))
    figure.align_ylabels([top, bottom])
    beside(top)
    figure.suptitle(plain(f"Drift of {', '.join(titles)}"), fontsize=9)
    return figure


def _own(i: int) -> dict[str, Any]:
    """Colour and line style of the i-th of several curves."""
    colour = COLOURS[i % len(COLOURS)]
    return {"color": colour, "markerfacecolor": colour, "linestyle": PATTERNS[i % len(PATTERNS)]}


def _line(ax: "Axes", t: np.ndarray, values: np.ndarray, shift: float, **style: Any) -> None:
    """A curve with ten markers, those of different runs at different times."""
    share = (np.arange(10) + shift) / 10
    at = np.abs(t[:, None] - (t[0] + share * (t[-1] - t[0]))).argmin(axis=0)
    ax.plot(t, _positive(values), **style, lw=0.9, markevery=sorted(set(at.tolist())))
    logarithmic(ax.yaxis)


def _positive(values: np.ndarray) -> np.ndarray:
    """Values for a logarithmic axis, with gaps at zero."""
    return np.where(values > 0, values, np.nan)
