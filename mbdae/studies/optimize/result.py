"""Result of `mbdae.optimize`: the optimal parameters, the cost, and the history of the search."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...data_types import JsonObject
from ...mechanism import Mechanism
from ...solution.solution import Solution
from ...tabular import Columns, Tabular
from ...tolerances import VISIBLE
from ..kinematics.result import Kinematics

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__: list[str] = []


class Evaluation(NamedTuple):
    """An evaluated point: parameters, cost, constraints by name, and the error if the evaluation failed."""

    values: dict[str, float]
    cost: float
    constraints: dict[str, float]
    error: str = ""


@dataclass(frozen=True)
class Optimum(Tabular):
    """The best parameters found by a search.

    Attributes:
        values: the parameters.
        cost: the cost.
        gradient: derivative of the cost with respect to each parameter; nan if an error stopped the search.
        constraints: values of the constraints.
        limits: (low, high) of each constraint.
        bounds: (low, high) of each parameter.
        mechanism: mechanism with these parameters.
        motion: run, a Solution, or curve of poses, a Kinematics, of the mechanism.
        history: all points in order of evaluation, the start first; nan where evaluation failed.
        converged: whether the search converged and the constraints are satisfied.
        interrupted: whether the user stopped the search.
        message: termination message.
        bound: number of times that parameters were bound to runs: once if new values can be written in place, since
            directions are constant; otherwise once for each point; 0 for curves.
    """

    values: dict[str, float]
    cost: float
    gradient: dict[str, float]
    constraints: dict[str, float]
    limits: dict[str, tuple[float, float]]
    bounds: dict[str, tuple[float, float]]
    mechanism: Mechanism = field(repr=False)
    motion: Solution | Kinematics = field(repr=False)
    history: tuple[Evaluation, ...] = field(repr=False)
    converged: bool = True
    interrupted: bool = False
    message: str = ""
    bound: int = 0

    @property
    def start(self) -> Evaluation:
        """Start of the search."""
        return self.history[0]

    @property
    def at_bounds(self) -> list[str]:
        """Parameters at a bound."""
        return [name for name, x in self.values.items() if _is_at_limit(x, *self.bounds[name])]

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        scalars = ("values", "cost", "constraints", "at_bounds", "converged", "interrupted", "message", "bound")
        return {
            "model": self.mechanism.title,
            **{key: getattr(self, key) for key in scalars},
            "gradient": {name: _finite(x) for name, x in self.gradient.items()},
            "limits": {name: [_finite(x) for x in pair] for name, pair in self.limits.items()},
            "bounds": {name: [_finite(x) for x in pair] for name, pair in self.bounds.items()},
            "history": [
                {"values": t.values, "cost": _finite(t.cost), "constraints": t.constraints, "error": t.error}
                for t in self.history
            ],
        }

    def to_columns(self) -> Columns:
        """Return names of the parameters, their values at the start and at the optimum."""
        found = self.values
        return Columns({"parameter": list(found), "start": [self.start.values[name] for name in found],
                        "value": list(found.values())})  # fmt: skip

    def cells(self) -> list[list[str]]:
        """Return parameters and constraints, at the start and at the optimum."""
        rows = [(self.start.values, self.values), (self.start.constraints, self.constraints)]
        pairs = [(name, before[name], x) for before, after in rows for name, x in after.items()]
        return [["", "start", "optimum"], *([name, f"{x0:.8g}", f"{x:.8g}"] for name, x0, x in pairs)]

    @property
    def failures(self) -> list[str]:
        """Number of failed evaluations, and the last error; empty if there are none."""
        errors = [t.error for t in self.history if t.error]
        failed = f"{len(errors)} of {len(self.history)} points could not be computed"
        return [f"{failed}, the last: {errors[-1]}"] if errors else []

    def remarks(self) -> list[str]:
        """Return parameters at a bound, reasons why the result may not be an optimum, and failed evaluations."""
        bounds = [f"{name} is at its bound" for name in self.at_bounds]
        return [*bounds, *([] if self.converged else [f"not an optimum: {self.message}"]), *self.failures]

    def plot(self, path: str | Path | None = None) -> "Figure":
        """Draw cost and parameters at each evaluated point."""
        from .. import figures
        from .figure import search

        return figures.save_if_path(search(self), path)

    @property
    def _bound(self) -> str:
        return f", parameters bound {'once' if self.bound == 1 else f'{self.bound} times'}" if self.bound else ""

    def __str__(self) -> str:
        lines = [f"optimum of {self.mechanism.title}: cost {self.start.cost:.6g} -> {self.cost:.6g}, "
                 f"{len(self.history)} motions computed{self._bound}"]  # fmt: skip
        for name, x in self.values.items():
            mark = " (at its bound)" if name in self.at_bounds else ""
            lines.append(f"  {name:36s} {self.start.values[name]:14.8g} -> {x:14.8g}{mark}")
        for name, x in self.constraints.items():
            low, high = self.limits[name]
            mark = " (at its limit)" if _is_at_limit(x, low, high) else ""
            lines.append(f"  {name:36s} {self.start.constraints[name]:14.8g} -> {x:14.8g}{mark}")
        if not self.converged:
            lines.append(f"  not an optimum: {self.message}")
        return "\n".join([*lines, *(f"  {text}" for text in self.failures)])


def _is_at_limit(x: float, low: float, high: float) -> bool:
    size = high - low if np.isfinite(high - low) else 1.0 + abs(x)
    return bool(min(x - low, high - x) < VISIBLE * size)


def _finite(x: float) -> float | None:
    return x if np.isfinite(x) else None
