"""Figure of efforts, powers and joint forces over the input or over time."""

from typing import TYPE_CHECKING

import numpy as np

from ..figures import COLOURS, WIDTH, curve_style, empty_figure, escaped, fixed_layout, legend_right
from .result import InverseDynamics

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAX_JOINTS = 7  # in a figure


@fixed_layout
def demands(found: InverseDynamics) -> "Figure":
    """Draw efforts with peak and RMS, powers, and the largest forces in joints."""
    kinds = list(dict.fromkeys(found.units))
    rows = len(kinds) + 2
    figure = empty_figure(WIDTH, 1.6 * rows + 0.5)
    axes = figure.subplots(rows, 1, sharex=True)
    for ax, kind in zip(axes, kinds, strict=False):
        ax.set_ylabel(f"{'torque' if kind == 'N m' else 'force'} ({kind})")
        for i, d in enumerate(found.demands):
            if d.unit != kind:
                continue
            style = curve_style(i)
            ax.plot(
                found.over, found.efforts[:, i], label=escaped(f"{d.name}: peak {d.peak:.3g}, RMS {d.rms:.3g}"), **style
            )
            for level, line in ((d.peak, ":"), (d.rms, "--")):
                ax.axhline(level, color=style["color"], lw=0.7, ls=line)
            ax.plot(d.at, found.efforts[np.abs(found.over - d.at).argmin(), i], "o", ms=3, color=style["color"])
        legend_right(ax, labelspacing=0.3)
    for i, name in enumerate(found.names):
        axes[-2].plot(found.over, found.power[:, i], label=escaped(name), **curve_style(i))
    axes[-2].axhline(0.0, color="0.5", lw=0.7)
    axes[-2].set_ylabel("power (W)")
    sizes = np.linalg.norm(found.joints[:, :, :3], axis=2)
    largest = np.argsort(-np.nanmax(sizes, axis=0))[:MAX_JOINTS]
    for i, j in enumerate(sorted(largest)):
        label = escaped(found.mechanism.joint_names[j])
        axes[-1].plot(found.over, sizes[:, j], label=label, **curve_style(i) | {"color": COLOURS[i % len(COLOURS)]})
    axes[-1].set_ylabel("joint forces (N)")
    legend_right(axes[-1], labelspacing=0.3)
    axes[-1].set_xlabel(escaped(found.over_name))
    axes[-1].set_xlim(found.over.min(), found.over.max())
    figure.align_ylabels(axes)
    figure.suptitle(escaped(f"Inverse dynamics of {found.mechanism.title}"), fontsize=9)
    return figure
