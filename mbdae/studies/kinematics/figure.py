"""Figure of poses, rates and the transmission angle against the input."""

from typing import TYPE_CHECKING

import numpy as np

from ...mechanism.tree.coordinate_units import coordinate_units
from ...tolerances import COINCIDENT, SOLUTION_ROUNDING
from ...units import displayed, unit_name
from ..figures import COLOURS, QUANTITY_NAMES, WIDTH, curve_style, empty_figure, escaped, fixed_layout, legend_right

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .result import Kinematics

CUTOFF = 50.0  # multiple of the median above which values close to dead points are not drawn
PREFIXES = ("q.", "v.", "a.")


@fixed_layout
def curves(found: "Kinematics") -> "Figure":
    """Draw coordinates, velocities and accelerations per unit of the drive, and transmission angles, against the input.

    Curves are cut at dead points, where rates are unbounded; dotted lines mark dead points, dashed ones branch points.
    """
    signals = found.signals()
    unit = {n: u for n, u in coordinate_units(found.mechanism).items() if n.startswith("q.") and u != "1"}
    moving = [n for n in unit if np.ptp(signals[n]) > COINCIDENT]
    kinds = list(dict.fromkeys(unit[n] for n in moving))
    rows = [(prefix, kind) for prefix in PREFIXES for kind in kinds]
    extra = bool(found.output)
    figure = empty_figure(WIDTH, 1.35 * (len(rows) + extra) + 0.6)
    axes = np.atleast_1d(figure.subplots(len(rows) + extra, 1, sharex=True))
    for ax, (prefix, kind) in zip(axes, rows, strict=False):
        names = [n for n in moving if unit[n] == kind]
        for i, name in enumerate(names):
            value_unit = {"q.": kind, "v.": f"{kind}/{found.unit}", "a.": f"{kind}/{found.unit}^2"}[prefix]
            values = displayed(signals.get(prefix + name[2:], np.full(len(found.u), np.nan)), value_unit)[0]
            _curve(ax, found, values, escaped(name[2:]), i)
        _label(ax, prefix, kind, found.unit)
    if extra:
        _curve(axes[-1], found, np.degrees(found.transmission), "", 0)
        axes[-1].set_ylabel("transmission\n(deg)")
        axes[-1].set_ylim(0, 92)
    _mark_points(axes, found)
    axes[-1].set_xlabel(escaped(f"{found.drive} ({unit_name(found.unit)})"))
    figure.align_ylabels(axes)
    figure.suptitle(escaped(f"{found.mechanism.title} over {found.drive}"), fontsize=9)
    return figure


def _label(ax: "Axes", prefix: str, kind: str, unit: str) -> None:
    """Label coordinates, rates or accelerations of a kind, against an input with a unit."""
    of_kind, of_input = (unit_name(x) for x in (kind, unit))
    words, value_unit = {
        "q.": (QUANTITY_NAMES[kind], of_kind),
        "v.": ("rates", f"{of_kind}/{of_input}"),
        "a.": ("accelerations", f"{of_kind}/{of_input}$^2$"),
    }[prefix]
    ax.set_ylabel(f"{words}\n({value_unit})")
    if prefix == "q.":
        legend_right(ax, labelspacing=0.3)


def _mark_points(axes: np.ndarray, found: "Kinematics") -> None:
    """Draw dotted lines at dead points, dashed ones at branch points."""
    for ax in axes:
        for u, _ in found.dead_points:
            ax.axvline(displayed(u, found.unit)[0], color="0.5", lw=0.7, ls=":")
        for b in found.branch_points:
            ax.axvline(displayed(b.u, found.unit)[0], color="0.5", lw=0.7, ls="--")


def _curve(ax: "Axes", found: "Kinematics", values: np.ndarray, label: str, i: int) -> None:
    """Draw one signal, with a gap at each dead point."""
    limit = CUTOFF * float(np.nanmedian(np.abs(values))) if np.isfinite(values).any() else 0.0
    values = np.where(np.abs(values) < SOLUTION_ROUNDING, 0.0, values)
    shown = np.where(np.abs(values) > limit, np.nan, values) if limit and found.dead_points else values
    style, u = curve_style(i) | {"color": COLOURS[i % len(COLOURS)]}, displayed(found.u, found.unit)[0]
    for k, segment in enumerate(found.monotonic_segments):
        ax.plot(u[segment], shown[segment], label=label if k == 0 else None, **style)
