"""Figure of a path of equilibria: the load factor against a coordinate."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import UnknownNameError
from ...mechanism.tree.coordinate_units import coordinate_units
from ...units import displayed
from ..figures import COLOURS, WIDTH, empty_figure, escaped, fixed_layout, legend_right
from .load_path import LoadPath

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLES = {"limit": ("limit point", "o"), "branch": ("branch point", "s")}
STYLES |= {"contact": ("contact closes", "v"), "separation": ("contact opens", "^")}


@fixed_layout
def load_deflection(path: LoadPath, coordinate: str | None = None) -> "Figure":
    """Draw the factor on the load against a coordinate; unstable equilibria dashed, critical points marked.

    Raises:
        UnknownNameError: for a coordinate that does not exist.
    """
    found, name = path.coordinates, coordinate or path.moving
    if name not in found:
        raise UnknownNameError("coordinate", name, found)
    figure = empty_figure(WIDTH, 3.2)
    ax = figure.subplots()
    x, unit = displayed(found[name], coordinate_units(path.mechanism).get(name, ""))
    unstable = path.unstable > 0
    changes = np.flatnonzero(np.diff(unstable)) + 1
    seen = set[bool]()
    for segment in np.split(np.arange(len(x)), changes):
        dashed = bool(unstable[segment[0]])
        run = np.append(segment, segment[-1] + 1)[: len(x) - segment[0]]
        style: Any = {"color": COLOURS[1], "linestyle": "--"} if dashed else {"color": COLOURS[0], "linestyle": "-"}
        label = None if dashed in seen else "unstable" if dashed else "stable"
        ax.plot(x[run], path.factor[run], label=label, **style)
        seen.add(dashed)
    for kind, (label, marker) in STYLES.items():
        points = [e for e in path.critical if e.kind == kind]
        positions = [float(x[np.abs(path.q - e.q).max(axis=1).argmin()]) for e in points]
        if points:
            ax.plot(positions, [e.factor for e in points], marker, color="black", label=label)
    ax.set_xlabel(escaped(f"{name} ({unit})"))
    ax.set_ylabel(escaped(f"factor on {path.load}"))
    ax.set_title(escaped(path.mechanism.title))
    legend_right(ax)
    return figure
