"""The final states of many runs."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from ...data_types import JsonObject
from ...errors import STATUS, SUCCESS
from ...system import Array
from ...tabular import Columns, Tabular, align_columns
from ...units import displayed, unit_name
from ..sweep.sweep_run import FAILURES

__all__ = ["Ensemble"]


@dataclass
class Ensemble(Tabular):
    """Final states of n runs, in the order of their starts and parameters; nan for runs that never began.

    Attributes:
        title: title of the mechanism.
        t: end times in s, (n,).
        q: configurations at the end, (n, nq).
        v: velocities at the end, (n, nv).
        status: status of each run, one of `mbdae.errors.STATUS`, or ``"input"``, ``"assembly"``, ``"error"`` for runs
            that did not begin.
        message: one line of text for each run.
        steps: accepted steps, (n,).
        rejected: rejected steps, (n,).
        drift: largest |g| at the ends of steps, in rad or characteristic lengths, (n,).
        parameters: values by name, (n,) each.
        signals: values at the end by name, (n,) each.
        units: units of the signals.
        in_python: numbers of runs that were deferred to `mbdae.solve`, by reason.
    """

    title: str
    t: Array
    q: Array
    v: Array
    status: list[str]
    message: list[str]
    steps: Array
    rejected: Array
    drift: Array
    parameters: dict[str, Array] = field(default_factory=dict)
    signals: dict[str, Array] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict, repr=False)
    in_python: dict[str, int] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.t)

    @property
    def success(self) -> Array:
        """Whether each run reached its end without accuracy warnings, (n,)."""
        return np.array([status in SUCCESS for status in self.status], bool)

    def to_columns(self) -> Columns:
        """Parameters, end times, states, counts, drift and signals of all runs, by name."""
        return Columns({**self.parameters, **self._results()}, {"t": "s", **self.units})

    def _results(self) -> dict[str, Array]:
        counts = {"steps": self.steps, "rejected": self.rejected, "drift": self.drift}
        return {"t": self.t, "q": self.q, "v": self.v, **counts, **self.signals}

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        about: JsonObject = {"title": self.title, "status": self.status, "message": self.message}
        return {**about, "in_python": self.in_python, **super().to_dict()}

    def cells(self) -> list[list[str]]:
        """Return mean, standard deviation and extrema over the successful runs, as text."""
        found = {"steps": self.steps, "drift": self.drift, **self.signals}
        return [["", "mean", "std", "min", "max"], *(self._summary(name, x) for name, x in found.items())]

    def _summary(self, name: str, values: Array) -> list[str]:
        unit = self.units.get(name, "")
        x = np.asarray(displayed(values[self.success], unit)[0], float)
        heading = f"{name} ({unit_name(unit)})" if unit else name
        if not len(x):
            return [heading, *"----"]
        spread = x.std(ddof=1) if len(x) > 1 else 0.0
        return [heading, *(f"{value:.6g}" for value in (x.mean(), spread, x.min(), x.max()))]

    def remarks(self) -> list[str]:
        """Return a line for each reason for runs in Python, and for each kind of failure."""
        lines = [f"{n} by mbdae.solve: {reason}" for reason, n in self.in_python.items()]
        for status in dict.fromkeys(status for status in self.status if status not in SUCCESS):
            i = self.status.index(status)
            meaning = FAILURES.get(status) or STATUS.get(status, "")
            lines.append(f"{status}: {meaning}, for instance run {i}: {self.message[i]}")
        return lines

    def __str__(self) -> str:
        counts = ", ".join(f"{n} {status}" for status, n in Counter(self.status).most_common())
        table = align_columns(self.cells())
        return "\n".join([f"ensemble of {self.title}: {len(self)} runs, {counts}", "", *table, *self.remarks()])
