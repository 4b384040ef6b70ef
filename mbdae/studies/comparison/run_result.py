"""One run of a comparison."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from math import inf
from statistics import median
from typing import Any

from ...data_types import JsonObject

COUNTS = ("steps", "rejected", "f", "M", "G", "solves", "factorizations")
INTEGERS = {"n", *COUNTS}


@dataclass(frozen=True)
class RunResult:
    """One run of a comparison; values that could not be computed are None.

    Attributes:
        method: a `mbdae.studies.method_variant.Variant` as text.
        rtol: relative tolerance; None for a fixed step.
        n: number of fixed steps; None under step-size control.
        status: one of `mbdae.errors.STATUS`.
        errors: by quantity the largest difference from the reference over the common times: of ``"q"`` in the tangent
            (rad, m), ``"v"`` (rad/s, m/s), and ``"lam"`` from the hidden constraint (N, N m); of ``"y"`` and ``"z"`` of
            a textbook problem. Empty for an incomplete run.
        ends: the same differences at the end time.
        g: max |g| over all rows and steps (m, rad).
        Gv: max |G v| over all rows and steps (m/s, rad/s); of a textbook problem that of g' = g_t + g_y f.
        energy: relative error of the energy balance; None if there is no energy.
        steps: steps taken.
        rejected: steps rejected; None if a solver does not report them.
        f: evaluations of the forces.
        M: evaluations of the mass matrix.
        G: evaluations of the constraint Jacobian.
        solves: linear solves of stages.
        factorizations: matrix factorizations of all kinds.
        times: wall times of the repetitions in s.
        message: why a run has no errors, or warnings; "" for none.
    """

    method: str
    rtol: float | None
    n: int | None
    status: str
    errors: Mapping[str, float] = field(default_factory=dict)
    ends: Mapping[str, float] = field(default_factory=dict)
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
    message: str = ""

    @property
    def label(self) -> tuple[str, float | None, int | None]:
        """Key of a run: method, tolerance, number of steps."""
        return self.method, self.rtol, self.n

    @property
    def seconds(self) -> float | None:
        """Median wall time in s; None if not measured."""
        return median(self.times) if self.times else None

    @property
    def success(self) -> bool:
        """Whether the run is complete and has errors."""
        return bool(self.errors)

    def row(self, quantities: Sequence[str]) -> JsonObject:
        """Return JSON and CSV data, with ``error_q`` and ``end_q`` for each quantity."""
        out: JsonObject = {}
        for f in fields(self):
            if f.name in ("errors", "ends"):
                found = getattr(self, f.name)
                out |= {f"{f.name[:-1]}_{name}": found.get(name) for name in quantities}
            else:
                out[f.name] = getattr(self, f.name)
        return out | {"seconds": self.seconds}


def read_run_result(row: Mapping[str, Any], quantities: Sequence[str]) -> RunResult:
    """Return a run from a row of JSON, or of CSV, where all values are text and None is empty.

    Raises:
        ValueError, KeyError, AttributeError, TypeError: for an invalid row.
    """
    values: dict[str, Any] = {}
    for f in fields(RunResult):
        if f.name == "times":
            x = row["times"]
            values["times"] = tuple(float(t) for t in (x.split() if isinstance(x, str) else x))
        elif f.name in ("errors", "ends"):
            found = {name: row[f"{f.name[:-1]}_{name}"] for name in quantities}
            if len({x in (None, "") for x in found.values()}) > 1:
                raise ValueError(f"a run lacks some of its {f.name}")
            values[f.name] = {name: nonnegative(x) for name, x in found.items() if x not in (None, "")}
        elif f.name in ("method", "status", "message"):
            values[f.name] = str(row[f.name])
        elif row[f.name] in (None, ""):
            values[f.name] = None
        else:
            values[f.name] = int(row[f.name]) if f.name in INTEGERS else nonnegative(row[f.name])
    return RunResult(**values)


def nonnegative(x: Any) -> float:
    """Return a number from a file: finite, and not negative, as for tolerances, errors and drifts.

    Raises:
        ValueError: for any other value.
    """
    if not 0 <= float(x) < inf:
        raise ValueError(f"expected a number of at least 0, got {x!r}")
    return float(x)


def ordered(points: Iterable[RunResult], labels: Sequence[tuple]) -> tuple[RunResult, ...]:
    """Return the runs with the requested labels, in their order."""
    found = {p.label: p for p in points}
    return tuple(found[key] for key in labels if key in found)
