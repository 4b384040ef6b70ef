"""What `mbdae.studies.comparison.compare.compare` returns: one row per run, and what follows from them."""

import csv
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields
from math import inf
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any, Literal

from ...errors import InputError
from ...tabular import Columns, Tabular
from .ranking import Place, rank, sentence, targets

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KNOWN = 5.0  # an error is known where it is this many times the uncertainty of the reference
Quantity = Literal["q", "v", "lam"]
Work = Literal["solves", "seconds"]
UNITS = {"error_q": "rad, m", "error_v": "rad/s, m/s", "error_lam": "N, N m", "end_q": "rad, m", "end_v": "rad/s, m/s",
         "end_lam": "N, N m", "g": "m, rad", "Gv": "m/s, rad/s", "seconds": "s"}  # fmt: skip


@dataclass(frozen=True)
class Point:
    """One run of a comparison; what could not be computed is None.

    Attributes:
        method: a `mbdae.studies.variant.Variant` as text.
        rtol: relative tolerance; None for a fixed step.
        n: number of fixed steps; None under step-size control.
        status: one of `mbdae.errors.STATUS`.
        error_q: largest component of q (-) q_ref in the tangent (rad, m) over the common times.
        error_v: the same of v - v_ref (rad/s, m/s).
        error_lam: the same of lam - lam_ref (N, N m), both from the hidden constraint.
        end_q: error of q at the end.
        end_v: error of v at the end.
        end_lam: error of lam at the end.
        g: max |g| over all rows and steps (m, rad).
        Gv: max |G v| over all rows and steps (m/s, rad/s).
        energy: relative error of the energy balance.
        steps: steps taken.
        rejected: steps rejected; None where a solver does not tell.
        f: evaluations of the forces.
        M: mass matrices.
        G: constraint Jacobians.
        solves: linear systems of a stage.
        factorizations: of any kind.
        times: wall times of the repeated runs in s.
    """

    method: str
    rtol: float | None
    n: int | None
    status: str
    error_q: float | None = None
    error_v: float | None = None
    error_lam: float | None = None
    end_q: float | None = None
    end_v: float | None = None
    end_lam: float | None = None
    g: float | None = None
    Gv: float | None = None
    energy: float | None = None
    steps: int = 0
    rejected: int | None = None
    f: int = 0
    M: int = 0
    G: int = 0
    solves: int = 0
    factorizations: int = 0
    times: tuple[float, ...] = ()

    @property
    def label(self) -> tuple[str, float | None, int | None]:
        """What tells runs apart: method, tolerance, number of steps."""
        return self.method, self.rtol, self.n

    @property
    def seconds(self) -> float | None:
        """Median wall time in s; None when it was not measured."""
        return median(self.times) if self.times else None

    @property
    def success(self) -> bool:
        """The run came to its end, and has errors."""
        return self.error_q is not None

    def error(self, quantity: Quantity) -> float | None:
        """Error of a quantity over the common times."""
        return getattr(self, f"error_{quantity}")

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON and CSV."""
        return {f.name: getattr(self, f.name) for f in fields(self)} | {"seconds": self.seconds}


@dataclass(frozen=True)
class Comparison(Tabular):
    """Result of `mbdae.compare`.

    Attributes:
        title: of the mechanism.
        t_span: start and end in s.
        points: the runs that were finished, by method and then from coarse to fine.
        reference: the run that the errors are differences to, in words.
        witness: the run of another family that it was held against, in words.
        uncertainty: largest difference of the two, for ``"q"``, ``"v"``, ``"lam"``: what is known of the reference.
        complete: False when the comparison was stopped before its end.
        meta: key of the settings, versions, command, machine, back end and what keeps the runs from the core.
    """

    title: str
    t_span: tuple[float, float]
    points: tuple[Point, ...]
    reference: str
    witness: str
    uncertainty: dict[str, float]
    complete: bool = True
    meta: dict[str, Any] = field(default_factory=dict)

    @property
    def methods(self) -> list[str]:
        """The methods in order."""
        return list(dict.fromkeys(p.method for p in self.points))

    @property
    def computed_by(self) -> str:
        """Which back end and which processor the times are of, in words."""
        because = f" ({self.meta['because']})" if self.meta.get("because") else ""
        where = f", {self.meta['machine']}" if self.meta.get("machine") else ""
        return f"{self.meta.get('backend', 'unknown')} back end{because}{where}"

    def of(self, method: str) -> list[Point]:
        """The runs of a method that came to their end."""
        return [p for p in self.points if p.method == method and p.success]

    def floor(self, quantity: Quantity = "q") -> float:
        """Errors below are not known: five times the uncertainty of the reference."""
        return KNOWN * self.uncertainty[quantity]

    def known(self, point: Point, quantity: Quantity = "q") -> bool:
        """True when the error of a run stands clear of the uncertainty of the reference."""
        error = point.error(quantity)
        return error is not None and error >= self.floor(quantity)

    def ranking(self, target: float, *, work: Work = "solves", quantity: Quantity = "q") -> list[Place]:
        """Order the methods by the work that they need to an error of at most ``target``.

        Between two runs of a method the logarithm of the work is linear in that of the error. A run whose error is not
        known counts with an upper bound of it.

        Raises:
            InputError: for a target below what the reference can tell.
        """
        bound = self.floor(quantity) + self.uncertainty[quantity]
        if target < bound:
            raise InputError(f"a target of {target:g} is below what the reference can tell, {bound:.1e}")
        table = {
            name: [
                (max(p.error(quantity) or 0.0, 0.0 if self.known(p, quantity) else bound), float(getattr(p, work)))
                for p in self.of(name)
                if getattr(p, work) is not None
            ]
            for name in self.methods
        }
        return rank(table, target)

    def sentences(self, quantity: Quantity = "q") -> list[str]:
        """One sentence for each power of ten that at least two methods reach."""
        unit = {"q": "rad or m", "v": "rad/s or m/s", "lam": "N or N m"}[quantity]
        bound = self.floor(quantity) + self.uncertainty[quantity]
        errors = [[p.error(quantity) or 0.0 for p in self.of(name)] for name in self.methods]
        out = []
        for target in targets(errors, bound):
            works: tuple[Work, ...] = ("solves", "seconds")
            parts = [sentence(self.ranking(target, work=work, quantity=quantity), work) for work in works]
            out.append(f"error in {quantity} of {target:.0e} {unit}: " + "; ".join(p for p in parts if p))
        return out

    def __str__(self) -> str:
        from .tables import comparison_table

        return comparison_table(self)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "title": self.title,
            "t_span": list(self.t_span),
            "reference": self.reference,
            "witness": self.witness,
            "uncertainty": self.uncertainty,
            "complete": self.complete,
            "meta": self.meta,
            "points": [{**p.to_dict(), "known": self.known(p)} for p in self.points],
            "ranking": self.sentences(),
        }

    def cells(self) -> list[list[str]]:
        """The runs, as they are read."""
        from .tables import comparison_rows

        heads, rows = comparison_rows(self)
        return [heads, *rows]

    def remarks(self) -> list[str]:
        """Which method is best for an accuracy."""
        return self.sentences()

    def tabulated(self) -> Columns:
        """A row for each run; all else stands as JSON in the first row of the last column, ``about``."""
        rows = [{**p.to_dict(), "known": self.known(p), "about": ""} for p in self.points]
        rest = {k: v for k, v in self.to_dict().items() if k not in ("points", "ranking")}
        names = [f.name for f in fields(Point)] + ["seconds", "known", "about"]
        rows = rows or [dict.fromkeys(names)]  # type: ignore[list-item]
        rows[0]["about"] = json.dumps(rest)
        rows = [{**row, "times": " ".join(map(repr, row["times"] or ()))} for row in rows]
        return Columns({name: [row[name] for row in rows] for name in names}, UNITS)

    @classmethod
    def load(cls, path: str | Path) -> "Comparison":
        """Read what `save` wrote.

        Raises:
            InputError: for a missing or damaged file.
        """
        try:
            with Path(path).open(encoding="utf-8", newline="") as file:
                if Path(path).suffix == ".csv":
                    rows = list(csv.DictReader(file))
                    if any(None in row.values() for row in rows):
                        raise ValueError("a row ends early")
                    data = json.loads(rows[0]["about"]) | {"points": [row for row in rows if row["method"]]}
                else:
                    data = json.load(file)
            points = tuple(_point(row) for row in data["points"])
            span = (float(data["t_span"][0]), float(data["t_span"][1]))
            known = {name: _number(data["uncertainty"][name]) for name in ("q", "v", "lam")}
            rest = (data["reference"], data["witness"], known, bool(data["complete"]), dict(data["meta"]))
            return cls(data["title"], span, points, *rest)
        except FileNotFoundError:
            raise InputError(f"no such file: {path}") from None
        except (OSError, ValueError, KeyError, TypeError, IndexError, AttributeError) as e:
            reason = f"{type(e).__name__}: {e}"
            raise InputError(f"{path} is damaged or not a comparison written by mbdae ({reason})") from None

    def plot(self, path: str | Path | None = None, quantity: Quantity = "q") -> "Figure":
        """Draw the work-precision diagram as .png, .svg or .pdf, see `mbdae.studies.figures`.

        Raises:
            InputError: for another format or an unwritable path.
        """
        from .. import figures
        from .figure import work_precision

        return figures.given(work_precision(self, quantity), path)


def _point(row: dict[str, Any]) -> Point:
    """A point from a row of JSON, or of CSV where everything is text and nothing is None."""
    times = row["times"].split() if isinstance(row["times"], str) else row["times"]
    whole = {"n", "steps", "rejected", "f", "M", "G", "solves", "factorizations"}
    values: dict[str, Any] = {"times": tuple(float(t) for t in times)}
    for f in fields(Point):
        x = row[f.name]
        if f.name == "times":
            continue
        if f.name in ("method", "status"):
            values[f.name] = str(x)
        elif x in (None, ""):
            values[f.name] = None
        else:
            values[f.name] = int(x) if f.name in whole else _number(x)
    return Point(**values)


def _number(x: Any) -> float:
    """A number of a file: finite, and not negative, as tolerances, errors and drifts are."""
    if not 0 <= float(x) < inf:
        raise ValueError(f"expected a number of at least 0, got {x!r}")
    return float(x)


def in_order(points: Iterable[Point], labels: Sequence[tuple]) -> tuple[Point, ...]:
    """Points in the order of the labels asked for; others are left out."""
    found = {p.label: p for p in points}
    return tuple(found[key] for key in labels if key in found)
