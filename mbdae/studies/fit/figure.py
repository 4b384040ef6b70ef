"""Figure of measured and computed signals of a fit, and residuals."""

from pathlib import Path
from typing import TYPE_CHECKING

from ...units import displayed
from ..figures import COLOURS, WIDTH, empty_figure, escaped, fixed_layout
from .result import Fit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEIGHT = 2.2  # inches per signal


@fixed_layout
def compared(fit: Fit) -> "Figure":
    """Draw each signal of each run, measured and computed, and alongside its residuals in noise levels."""
    panels = [(i, name) for i, signals in enumerate(fit.measured) for name in signals]
    figure = empty_figure(WIDTH, HEIGHT * len(panels) + 0.3)
    axes = figure.subplots(len(panels), 2, squeeze=False, width_ratios=(2, 1))
    for (left, right), (i, name) in zip(axes, panels, strict=True):
        (t, time), si_unit = displayed(fit.times[i], "s"), fit.units.get(name, "")
        measured, unit = displayed(fit.measured[i][name], si_unit)
        left.plot(t, measured, ".", color=COLOURS[1], markersize=3, label="measured")
        left.plot(t, displayed(fit.computed[i][name], si_unit)[0], color=COLOURS[0], label="computed")
        source = f", {Path(fit.names[i]).name}" if len(fit.names) > 1 else ""
        left.set_ylabel(escaped(f"{name}{source} ({unit})" if unit else name + source))
        left.set_xlabel(f"$t$ ({time})")
        right.plot(t, fit.residuals[i][name], ".", color=COLOURS[0], markersize=3)
        right.axhline(0.0, color="0.4", linewidth=0.7)
        right.set_ylabel("residual / noise level")
        right.set_xlabel(f"$t$ ({time})")
    axes[0][0].legend()
    figure.suptitle(escaped(f"Fit of {fit.model}: chi^2 / degrees of freedom = {fit.reduced_chi2:.3g}"), fontsize=9)
    return figure
