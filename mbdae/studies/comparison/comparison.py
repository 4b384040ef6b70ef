"""Result of `mbdae.studies.comparison.compare.compare`: one row per run, and derived rankings."""

import csv
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ...backend import describe_backend
from ...data_types import JsonObject
from ...errors import InputError, UnknownNameError
from ...integrate.steppers.solvers import SOLVERS
from ...methods import METHODS
from ...methods.variational import NewtonMethod
from ...tabular import Columns, Tabular
from ...units import display_units, displayed
from ...units import quantity as quantity_text
from .ranking import RankingEntry, rank, sentence, targets
from .run_result import RunResult, nonnegative, read_run_result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KNOWN_ERROR_RATIO = 5.0  # errors above this multiple of the uncertainty of the reference are known
Work = Literal["solves", "seconds", "f"]
SHOWN: tuple[Work, ...] = ("solves", "seconds")  # in sentences and reports
QUANTITIES = {"q": "rad, m", "v": "rad/s, m/s", "lam": "N, N m"}  # and their units
RESIDUALS = {"g": "m, rad", "Gv": "m/s, rad/s"}
TEXTBOOK_QUANTITIES = ("y", "z")


@dataclass(frozen=True)
class Comparison(Tabular):
    """Result of `mbdae.compare`.

    Attributes:
        title: title of the mechanism or textbook problem.
        t_span: start and end in s.
        points: the finished runs, by method and then from coarse to fine.
        reference: the reference run for errors, in words.
        cross_check: the run of another family that checks the reference, in words; "" for an exact solution.
        uncertainty: uncertainty of the reference: largest difference between these two runs, for ``"q"``, ``"v"``,
            ``"lam"`` of a mechanism, ``"y"``, ``"z"`` of a textbook problem.
        complete: False if the comparison was stopped before its end.
        meta: key of the settings, versions, command, machine, back end, the reason why runs cannot use the core, units
            of quantities, and the number of requested runs.
    """

    title: str
    t_span: tuple[float, float]
    points: tuple[RunResult, ...]
    reference: str
    cross_check: str
    uncertainty: dict[str, float]
    complete: bool = True
    meta: dict[str, Any] = field(default_factory=dict)

    @property
    def omitted(self) -> dict[str, str]:
        """Methods that do not suit the problem, with the reasons, in a comparison of all methods."""
        return self.meta.get("omitted", {})

    @property
    def requested(self) -> int:
        """Number of requested runs."""
        return self.meta.get("runs", len(self.points))

    @property
    def quantities(self) -> tuple[str, ...]:
        """Quantities of the errors: q, v and lam of a mechanism, y and z of a textbook problem."""
        return tuple(self.uncertainty)

    def unit(self, name: str) -> str:
        """Return the SI unit of a quantity, or of g and Gv: a list if it has several, "" for a textbook problem."""
        known = QUANTITIES | RESIDUALS if "v" in self.uncertainty else {}
        return {**known, **self.meta.get("units", {})}.get(name, "")

    @property
    def trust(self) -> str:
        """Description of the reference and its uncertainty."""
        shown = {name: displayed(u, self.unit(name))[0] for name, u in self.uncertainty.items()}
        known = ", ".join(f"{u:.1e} in {name}" for name, u in shown.items())
        if not self.cross_check:
            return f"{self.reference}, known to {known}"
        return f"{self.reference}; {self.cross_check} differs by {known}"

    def quantity(self, name: str | None) -> str:
        """Return the name of a quantity, by default that of the positions.

        Raises:
            UnknownNameError: for an unknown quantity.
        """
        if name is not None and name not in self.uncertainty:
            raise UnknownNameError("quantity", name, self.uncertainty)
        return name or self.quantities[0]

    @property
    def methods(self) -> list[str]:
        """The methods, in the order of their runs."""
        return list(dict.fromkeys(p.method for p in self.points))

    @property
    def computed_by(self) -> str:
        """Back end and processor of the times, in words."""
        where = f", {self.meta['machine']}" if self.meta.get("machine") else ""
        solvers = [name for name in self.methods if name.rpartition(":")[2] in SOLVERS]
        steps = f", steps of {', '.join(solvers)} in Python" if solvers else ""
        controlled = {p.method for p in self.points if p.rtol and isinstance(METHODS.get(p.method), NewtonMethod)}
        sizes = f", step sizes of {', '.join(sorted(controlled))} in Python" if controlled else ""
        backend = describe_backend(self.meta.get("backend", "unknown"), self.meta.get("because", ""))
        return backend + steps + sizes + where

    def of(self, method: str) -> list[RunResult]:
        """Return the completed runs of a method."""
        return [p for p in self.points if p.method == method and p.success]

    def floor(self, quantity: str | None = None) -> float:
        """Return the smallest known error: five times the uncertainty of the reference."""
        return KNOWN_ERROR_RATIO * self.uncertainty[self.quantity(quantity)]

    def known(self, point: RunResult, quantity: str | None = None) -> bool:
        """Return whether the error of a run is clearly above the uncertainty of the reference."""
        return point.success and point.errors[self.quantity(quantity)] >= self.floor(quantity)

    def targets(self, quantity: str | None = None) -> list[float]:
        """Return powers of ten that at least two methods reach, above the uncertainty of the reference."""
        name = self.quantity(quantity)
        bound = self.floor(name) + self.uncertainty[name]
        return targets([[p.errors[name] for p in self.of(method)] for method in self.methods], bound)

    def ranking(self, target: float, *, work: Work = "solves", quantity: str | None = None) -> list[RankingEntry]:
        """Order the methods by the work that they need for an error of at most ``target``.

        Between two runs of a method, the logarithm of the work is linear in that of the error. A run with unknown error
        counts with an upper bound.

        Raises:
            InputError: for a target below the uncertainty of the reference.
            UnknownNameError: for an unknown quantity.
        """
        error = self.quantity(quantity)
        bound = self.floor(error) + self.uncertainty[error]
        if target < bound:
            raise InputError(f"a target of {target:g} is below the uncertainty of the reference, {bound:.1e}")
        table = {
            name: [
                (max(p.errors[error], 0.0 if self.known(p, error) else bound), float(getattr(p, work)))
                for p in self.of(name)
                if getattr(p, work) is not None
            ]
            for name in self.methods
        }
        return rank(table, target)

    def sentences(self, quantity: str | None = None) -> list[str]:
        """Return a sentence for each power of ten that at least two methods reach."""
        name = self.quantity(quantity)
        out = []
        for target in self.targets(name):
            phrases = [sentence(self.ranking(target, work=work, quantity=name), work) for work in SHOWN]
            head = f"error in {name} of {quantity_text(target, self.unit(name), '.0e')}".replace(", ", " or ")
            out.append(f"{head}: " + "; ".join(p for p in phrases if p))
        return out

    def __str__(self) -> str:
        from .tables import comparison_table

        return comparison_table(self)

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        with display_units():
            ranking = self.sentences()
        return {
            "title": self.title,
            "t_span": list(self.t_span),
            "reference": self.reference,
            "cross_check": self.cross_check,
            "uncertainty": self.uncertainty,
            "complete": self.complete,
            "meta": self.meta,
            "points": [{**p.row(self.quantities), "known": self.known(p)} for p in self.points],
            "ranking": ranking,
        }

    def cells(self) -> list[list[str]]:
        """Return the runs for display."""
        from .tables import comparison_rows

        headers, rows = comparison_rows(self)
        return [headers, *rows]

    def remarks(self) -> list[str]:
        """Return sentences on the best methods for each accuracy, and on omitted methods."""
        return [*self.sentences(), *(f"omitted: {reason}" for reason in self.omitted.values())]

    def to_columns(self) -> Columns:
        """Return a row for each run; the remaining data are JSON in the first row of the last column, ``about``."""
        rows: list[dict[str, Any]] = [
            {**p.row(self.quantities), "known": self.known(p), "about": ""} for p in self.points
        ]
        rest = {k: v for k, v in self.to_dict().items() if k not in ("points", "ranking")}
        rows = rows or [dict.fromkeys([*RunResult("", None, None, "").row(self.quantities), "known", "about"])]
        rows[0]["about"] = json.dumps(rest)
        rows = [{**row, "times": " ".join(map(repr, row["times"] or ()))} for row in rows]
        units = {f"{prefix}_{name}": self.unit(name) for prefix in ("error", "end") for name in self.quantities}
        units |= {name: self.unit(name) for name in ("g", "Gv")} | {"seconds": "s"}
        return Columns({name: [row[name] for row in rows] for name in rows[0]}, units)

    def save(self, path: str | Path) -> None:
        """Write a file as `Tabular.save`; .csv in SI units, since `load` reads it.

        Raises:
            InputError: as `Tabular.save`.
        """
        if Path(path).suffix != ".csv":
            super().save(path)
            return
        with display_units():
            super().save(path)

    @classmethod
    def load(cls, path: str | Path) -> "Comparison":
        """Read a file written by `save`.

        Raises:
            InputError: for a missing or damaged file.
        """
        try:
            with Path(path).open(encoding="utf-8-sig", newline="") as file:
                if Path(path).suffix == ".csv":
                    rows = list(csv.DictReader(file))
                    if any(None in row.values() for row in rows):
                        raise ValueError("a row ends early")
                    data = json.loads(rows[0]["about"]) | {"points": [row for row in rows if row["method"]]}
                else:
                    data = json.load(file)
            known = {name: nonnegative(x) for name, x in data["uncertainty"].items()}
            points = tuple(read_run_result(row, tuple(known)) for row in data["points"])
            span = (float(data["t_span"][0]), float(data["t_span"][1]))
            rest = (data["reference"], data["cross_check"], known, bool(data["complete"]), dict(data["meta"]))
            return cls(data["title"], span, points, *rest)
        except FileNotFoundError:
            raise InputError(f"no such file: {path}") from None
        except (OSError, ValueError, KeyError, TypeError, IndexError, AttributeError) as e:
            reason = f"{type(e).__name__}: {e}"
            raise InputError(f"{path} is damaged or not a comparison written by mbdae ({reason})") from None

    def plot(self, path: str | Path | None = None, quantity: str | None = None) -> "Figure":
        """Draw the work-precision diagram as .png, .svg, .pdf or .pgf, see `mbdae.studies.figures`.

        Raises:
            UnknownNameError: for an unknown quantity.
        """
        from .. import figures
        from .figure import work_precision

        return figures.save_if_path(work_precision(self, quantity), path)
