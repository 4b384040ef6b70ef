"""Result of `mbdae.optimal_control`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...solution.solution import Solution
from ...system import Array
from ...tabular import Columns, Tabular
from ..optimize.result import Optimum
from .controlled_motion import ControlledMotion, Grid

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__: list[str] = []


@dataclass(frozen=True)
class OptimalControl(Tabular):
    """Inputs that minimize a cost of a motion.

    Attributes:
        t: times of the grid in s, (points,).
        inputs: values by name, (points,) each; an input with ``hold = "zero"`` is constant after each time.
        units: units of the inputs.
        linear: names of inputs that are linear between these times.
        signals: signals that the cost or a constraint uses, at these times, (points,) each.
        cost: the cost.
        duration: duration in s.
        solution: the run.
        motions: number of motions that were computed.
        converged: whether the search converged and the constraints are satisfied.
        interrupted: whether the user stopped the search.
        message: termination message.
    """

    t: Array
    inputs: dict[str, Array]
    units: dict[str, str]
    linear: tuple[str, ...]
    signals: dict[str, Array]
    cost: float
    duration: float
    solution: Solution = field(repr=False)
    motions: int
    converged: bool
    interrupted: bool
    message: str

    @classmethod
    def of(cls, found: Optimum, motion: ControlledMotion, grid: Grid) -> "OptimalControl":
        """Return the result of a search."""
        z = np.array(list(found.values.values()))
        inputs = {name: z[grid.columns(name)] for name in grid.names}
        inputs = {name: x if name in grid.linear else np.append(x, x[-1]) for name, x in inputs.items()}
        user_inputs = motion.shooting.simulator.inputs.user_inputs
        return cls(
            np.append(motion.t[:, 0], motion.t[-1, -1]), inputs, {name: user_inputs[name].unit for name in grid.names},
            grid.linear, {name: motion.at_points(name) for name in motion.values if name not in grid.names}, found.cost,
            motion.duration, motion.result, len(found.history), found.converged, found.interrupted, found.message,
        )  # fmt: skip

    def to_columns(self) -> Columns:
        """Return inputs and signals over time."""
        units = {"t": "s", **{name: unit for name, unit in self.units.items() if unit}}
        return Columns({"t": self.t, **self.inputs, **self.signals}, units, "t")

    def to_dict(self) -> dict[str, Any]:
        """Return JSON data."""
        tables = {name: {n: x.tolist() for n, x in getattr(self, name).items()} for name in ("inputs", "signals")}
        scalars = ("cost", "duration", "motions", "converged", "interrupted", "message")
        return {"t": self.t.tolist(), **tables, **{name: getattr(self, name) for name in scalars}}

    def remarks(self) -> list[str]:
        """Return why the result may not be an optimum."""
        return [] if self.converged else [f"not an optimum: {self.message}"]

    def plot(self, path: str | Path | None = None) -> "Figure":
        """Draw inputs and signals over time."""
        from .. import figures
        from .figure import controls

        return figures.save_if_path(controls(self), path)

    def __str__(self) -> str:
        lines = [f"optimal control of {self.solution.mechanism.title}: cost {self.cost:.9g}, duration"
                 f" {self.duration:.6g} s, {self.motions} motions computed"]  # fmt: skip
        for name, x in self.inputs.items():
            lines.append(f"  {name:28s} {x.min():12.6g} to {x.max():12.6g} {self.units[name]}".rstrip())
        for name, x in self.signals.items():
            lines.append(f"  {name:28s} {x[0]:12.6g} -> {x[-1]:11.6g}, {x.min():.6g} to {x.max():.6g}")
        return "\n".join([*lines, *(f"  {text}" for text in self.remarks())])
