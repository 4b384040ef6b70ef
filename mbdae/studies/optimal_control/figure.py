"""Figure of an optimal control: inputs and signals over time."""

from typing import TYPE_CHECKING

from ..figures import WIDTH, curve_style, empty_figure, escaped, fixed_layout, legend_right
from .result import OptimalControl

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@fixed_layout
def controls(found: OptimalControl) -> "Figure":
    """Draw the inputs, constant ones as steps, and the signals that the cost or a constraint uses."""
    figure = empty_figure(WIDTH, 4.0 if found.signals else 2.5)
    upper, *lower_axes = figure.subplots(2 if found.signals else 1, 1, sharex=True, squeeze=False)[:, 0]
    for i, (name, x) in enumerate(found.inputs.items()):
        unit = f" in {found.units[name]}" if found.units[name] else ""
        steps = "default" if name in found.linear else "steps-post"
        upper.plot(found.t, x, drawstyle=steps, label=escaped(name + unit), **curve_style(i))
    upper.set_ylabel("inputs")
    legend_right(upper)
    for lower in lower_axes:
        for i, (name, x) in enumerate(found.signals.items()):
            lower.plot(found.t, x, label=escaped(name), **curve_style(i))
        lower.set_ylabel("signals")
        legend_right(lower)
    [upper, *lower_axes][-1].set_xlabel("t in s")
    return figure
