"""Result of an order study: an observed order for each quantity of each method."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...backend import describe_backend, machine_description
from ...data_types import JsonObject
from ...errors import UnknownNameError
from ...tabular import Columns, Tabular, align_columns, latex
from ...units import displayed, quantity, unit_name

if TYPE_CHECKING:
    from matplotlib.figure import Figure


DIVERGENT = 0.2  # observed order below which an error does not tend to zero
MAX_DETAILED = 3  # largest number of methods for which the text has tables of errors


@dataclass(frozen=True)
class ObservedOrder:
    """Observed order of one quantity of one method.

    Attributes:
        quantity: q, v, own lam (of the method) or lam (hidden constraint); y, own z or z of a textbook problem.
        claimed: the method's claim; 0 if it does not converge.
        observed: fitted order; None if it cannot be estimated.
        verdict: ``"holds"`` (observed >= claimed - 0.2), ``"misses"`` or the reason why the order cannot be estimated.
        steps: numbers of steps.
        errors: errors of these runs.
        floors: 100 times the uncertainty and rounding of these runs.
        fitted: first and last plus one of the errors to which the order is fitted.
    """

    quantity: str
    claimed: int
    observed: float | None
    verdict: str
    steps: tuple[int, ...]
    errors: tuple[float, ...]
    floors: tuple[float, ...]
    fitted: tuple[int, int] = (0, 0)

    @property
    def is_conclusive(self) -> bool:
        """Whether an order could be fitted."""
        return self.observed is not None

    @property
    def claim(self) -> str:
        """The claimed order in words: ``"0: does not converge"`` where the method promises no order."""
        stays = not self.claimed and self.observed is not None and self.observed < DIVERGENT
        return f"{self.claimed}: does not converge" if stays else str(self.claimed)

    @property
    def rates(self) -> tuple[float, ...]:
        """Observed orders from each step to the next one: log of the error ratio over log of the step ratio."""
        with np.errstate(divide="ignore", invalid="ignore"):
            rates = -np.diff(np.log(self.errors)) / np.diff(np.log(self.steps))
        return (float("nan"), *rates.tolist())


@dataclass(frozen=True)
class OrderStudy(Tabular):
    """Result of `order`.

    Attributes:
        title: title of the problem.
        T: end time in s.
        orders: observed orders by method.
        backend: back end of all runs.
        because: why runs cannot use the compiled core, in words; "" if they can.
        missing: the methods that remained when the user stopped the study.
        machine: the machine, whose arithmetic determines rounding.
        units: units of the errors by quantity, a list if coordinates have several; none for a textbook problem.
    """

    title: str
    T: float
    orders: dict[str, tuple[ObservedOrder, ...]]
    backend: str = "python"
    because: str = ""
    missing: tuple[str, ...] = ()
    machine: str = field(default_factory=machine_description, kw_only=True)
    units: dict[str, str] = field(default_factory=dict, kw_only=True)

    @property
    def holds(self) -> bool:
        """Whether every order was estimated and reaches its claim."""
        return not self.missing and all(s.verdict == "holds" for row in self.orders.values() for s in row)

    @property
    def refuted(self) -> bool:
        """Whether some observed order is below its claim."""
        return any(s.verdict == "misses" for row in self.orders.values() for s in row)

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        orders = {name: [asdict(s) for s in row] for name, row in self.orders.items()}
        return {
            "title": self.title,
            "T": self.T,
            "backend": self.backend,
            "because": self.because,
            "machine": self.machine,
            "units": self.units,
            "holds": self.holds,
            "refuted": self.refuted,
            "missing": list(self.missing),
            "methods": orders,
        }

    def cells(self) -> list[list[str]]:
        """Return observed and claimed orders."""
        quantities = [s.quantity for s in next(iter(self.orders.values()), ())]
        rows = [
            [name, *((f"{s.observed:.2f}" if s.observed is not None else "-") + f" ({s.claim})" for s in row)]
            for name, row in self.orders.items()
        ]
        return [["method", *quantities], *rows]

    def remarks(self) -> list[str]:
        """Return missed and undecided claims, and missing methods."""
        pairs = [(name, s) for name, row in self.orders.items() for s in row]
        return [f"{name}, {s.quantity}: {s.verdict}" for name, s in pairs if s.verdict != "holds"] + self.missing_text()

    def missing_text(self) -> list[str]:
        """Return a line about missing methods if the user stopped the study."""
        return [f"stopped: {', '.join(self.missing)} remain"] if self.missing else []

    @property
    def computed_by(self) -> str:
        """Back end and machine of all runs, in words."""
        return f"all runs: {describe_backend(self.backend, self.because)}, {self.machine}"

    def convergence(self, method: str) -> list[list[str]]:
        """Return step sizes of a method, and for each quantity the errors and the rates between them, below the units.

        Raises:
            UnknownNameError: for a method that was not studied.
        """
        if method not in self.orders:
            raise UnknownNameError("method", method, self.orders)
        row = self.orders[method]
        headers = [method, *(text for s in row for text in (f"error {s.quantity}", "rate"))]
        columns = [["", *(f"h = {quantity(self.T / n, 's', '.4g')}" for n in row[0].steps)]]
        for s in row:
            errors, unit = displayed(np.array(s.errors), self.units.get(s.quantity, ""))
            rates = [f"{x:.2f}" if np.isfinite(x) else "-" for x in s.rates]
            columns += [[unit, *(f"{x:.2e}" for x in errors)], ["", *rates]]
        rows = [list(x) for x in zip(*columns, strict=True)]
        return [headers, *(rows if any(rows[0]) else rows[1:])]

    def to_columns(self) -> Columns:
        """Return a row for each error, with the step, its floor, the rate, and the claimed and the fitted order.

        Errors and floors are in display units, which are in a column if there are any.
        """
        rows = [
            (name, s.quantity, n, self.T / n, *self._shown(error, floor, s), rate, s.claimed, s.observed,
             unit_name(self.units.get(s.quantity, "")))
            for name, row in self.orders.items()
            for s in row
            for n, error, floor, rate in zip(s.steps, s.errors, s.floors, s.rates, strict=True)
        ]  # fmt: skip
        names = ("method", "quantity", "n", "h", "error", "floor", "rate", "claimed", "observed", "unit")
        return Columns(dict(zip(names, map(list, zip(*rows, strict=True)), strict=True)), {"h": "s"})

    def _shown(self, error: float, floor: float, order: ObservedOrder) -> tuple[float, float]:
        unit = self.units.get(order.quantity, "")
        return displayed(error, unit)[0], displayed(floor, unit)[0]

    def to_latex(self) -> str:
        """Return the orders, and a table of convergence for each method."""
        tables = [latex(self.convergence(name), f"{name} on {self.title}") for name in self.orders]
        return "\n".join([super().to_latex(), *tables])

    def plot(self, path: str | Path | None = None) -> "Figure":
        """Draw the errors against the step with the fitted and the claimed orders; saved if a path is given.

        Raises:
            InputError: for a format other than .png, .svg, .pdf or .pgf, or an unwritable path.
        """
        from .. import figures
        from .figure import convergence

        return figures.save_if_path(convergence(self), path)

    def __str__(self) -> str:
        lines = [f"observed (claimed) order, {self.title}, T = {quantity(self.T, 's', 'g')}"]
        for name, row in self.orders.items():
            cells = [
                f"{s.quantity} {s.observed:.2f} ({s.claim})" if s.is_conclusive else f"{s.quantity} - ({s.claimed})"
                for s in row
            ]
            bad = [f"{s.quantity}: {s.verdict}" for s in row if s.verdict != "holds"]
            lines.append(f"{name:8s} " + "  ".join(cells) + ("  " + "; ".join(bad) if bad else ""))
        for name in self.orders if len(self.orders) <= MAX_DETAILED else ():
            lines += ["", *align_columns(self.convergence(name))]
        return "\n".join(
            [*lines, *([""] if len(self.orders) <= MAX_DETAILED else []), self.computed_by, *self.missing_text()]
        )
