"""Figure of efforts, powers and joint forces over the input or over time."""

from typing import TYPE_CHECKING

import numpy as np

from ...units import displayed, unit_name
from ..figures import COLOURS, WIDTH, curve_style, empty_figure, escaped, fixed_layout, legend_right
from .result import InverseDynamics

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAX_JOINTS = 7  # in a figure


@fixed_layout
def demands(found: InverseDynamics) -> "Figure":
    """Draw efforts with peak and RMS, powers, and the largest forces in joints."""
    kinds = list(dict.fromkeys(found.units))
    name, si_unit = found.abscissa
    (over, over_unit), rows = displayed(found.over, si_unit), len(kinds) + 2
    figure = empty_figure(WIDTH, 1.6 * rows + 0.5)
    axes = figure.subplots(rows, 1, sharex=True)
    for ax, kind in zip(axes, kinds, strict=False):
        ax.set_ylabel(f"{'torque' if kind == 'N m' else 'force'} ({unit_name(kind)})")
        for i, d in enumerate(found.demands):
            if d.unit != kind:
                continue
            style, (peak, rms) = curve_style(i), (displayed(x, kind)[0] for x in (d.peak, d.rms))
            efforts = displayed(found.efforts[:, i], kind)[0]
            ax.plot(over, efforts, label=escaped(f"{d.name}: peak {peak:.3g}, RMS {rms:.3g}"), **style)
            for level, line in ((peak, ":"), (rms, "--")):
                ax.axhline(level, color=style["color"], lw=0.7, ls=line)
            ax.plot(
                displayed(d.at, si_unit)[0],
                efforts[np.abs(found.over - d.at).argmin()],
                "o",
                ms=3,
                color=style["color"],
            )
        legend_right(ax, labelspacing=0.3)
    for i, name in enumerate(found.names):
        axes[-2].plot(over, displayed(found.power[:, i], "W")[0], label=escaped(name), **curve_style(i))
    axes[-2].axhline(0.0, color="0.5", lw=0.7)
    axes[-2].set_ylabel(f"power ({unit_name('W')})")
    sizes, force = displayed(np.linalg.norm(found.joints[:, :, :3], axis=2), "N")
    largest = np.argsort(-np.nanmax(sizes, axis=0))[:MAX_JOINTS]
    for i, j in enumerate(sorted(largest)):
        label = escaped(found.mechanism.joint_names[j])
        axes[-1].plot(over, sizes[:, j], label=label, **curve_style(i) | {"color": COLOURS[i % len(COLOURS)]})
    axes[-1].set_ylabel(f"joint forces ({force})")
    legend_right(axes[-1], labelspacing=0.3)
    axes[-1].set_xlabel(escaped(f"{name} ({over_unit})"))
    axes[-1].set_xlim(over.min(), over.max())
    figure.align_ylabels(axes)
    figure.suptitle(escaped(f"Inverse dynamics of {found.mechanism.title}"), fontsize=9)
    return figure
