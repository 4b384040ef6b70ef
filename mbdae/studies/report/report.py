"""Report on a mechanism: card, a run, drift of runs, observed orders, and a comparison of methods."""

import platform
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ...backend import machine_description
from ...data_types import JsonObject
from ...errors import InputError
from ...file_io import write_page
from ...integrate.options.span import checked_span
from ...integrate.solve import solve
from ...integrate.steppers.solvers import SOLVERS
from ...mechanism import Mechanism, ModelSource, describe
from ...solution.problem import mechanism_of
from ...solution.provenance import command_line, versions
from ...solution.solution import Solution, uninterrupted
from ..comparison.compare import compare
from ..comparison.comparison import Comparison
from ..comparison.reference_motion import is_valid_reference
from ..drift.drift import Drift, drift
from ..info.card import Card, card
from ..method_variant import Variant, default_variant, default_variants, variants
from ..order.order import order
from ..order.result import OrderStudy

__all__ = ["report"]

METHODS = ("pherk6", "pherk5", "herk5", "radau9", "ggl:pherk5", "index1:dop853")  # after the default
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
PROGRESS = {"runs": 0.1, "orders": 0.35, "comparison": 1.0}  # completed fraction at the end of each task
Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Report:
    """Result of `report`.

    Attributes:
        card: the description of the mechanism.
        sol: the run that is replayed, that of ``mbdae solve``.
        drifts: drift of every method's run.
        orders: observed and claimed orders; None if no method without a formulation was requested.
        comparison: methods against a reference; None if the user stopped it before the reference was computed.
        mechanism: description from which the mechanism can be recreated.
        meta: command, parameters, versions, machine and date.
        missing: results that are missing because the user stopped the study, in words.
    """

    card: Card
    sol: Solution
    drifts: tuple[Drift, ...]
    orders: OrderStudy | None
    comparison: Comparison | None
    mechanism: dict[str, Any]
    meta: dict[str, Any]
    missing: tuple[str, ...] = ()

    @property
    def results(self) -> list[Any]:
        """The results, in order."""
        results = (self.card, self.sol, *self.drifts, self.orders, self.comparison)
        return [result for result in results if result is not None]

    @property
    def without(self) -> str:
        """Description of the missing results."""
        return f"without {'; '.join(self.missing)}" if self.missing else ""

    def __str__(self) -> str:
        stopped = [f"stopped by the user {self.without}"] if self.missing else []
        return "\n\n".join([*map(str, self.results), *stopped])

    def to_dict(self) -> JsonObject:
        """Return JSON data, without the run's states."""
        run: JsonObject = {"status": self.sol.status, "message": self.sol.message, "stats": self.sol.stats}
        return {
            "card": self.card.to_dict(),
            "run": {**run, "settings": self.sol.settings},
            "drift": [d.to_dict() for d in self.drifts],
            "orders": self.orders.to_dict() if self.orders else None,
            "comparison": self.comparison.to_dict() if self.comparison else None,
            "meta": self.meta,
            "missing": list(self.missing),
        }

    def save(self, path: str | Path) -> None:
        """Write one self-contained HTML page, see `mbdae.studies.report.page`.

        Raises:
            InputError: for another suffix or an unwritable path.
        """
        from .page import page

        write_page(path, lambda: page(self), "a report")


def report(
    mech: Mechanism | ModelSource,
    t_span: float | Sequence[float] | None = None,
    *,
    methods: Sequence[str | Variant] | None = None,
    rtol: float | None = None,
    tolerances: Sequence[float] = TOLERANCES,
    repeats: int = 3,
    workers: int = 1,
    progress: Progress | None = None,
) -> Report:
    """Study a mechanism from its start state. After Ctrl-C it returns the finished results.

    Args:
        mech: the mechanism, or an argument of `mbdae.load`.
        t_span: end, or start and end in s; from 0 to the model's duration when left out.
        methods: as for `mbdae.compare`, the default first when left out. The first one computes the run of the replay,
            as ``mbdae solve`` does, with projection if no formulation is given; orders are measured for those without
            a formulation, except solvers of libraries, which take no fixed steps.
        rtol: relative tolerance of the run and of the drift table; that of `mbdae.solve` when left out.
        tolerances: relative tolerances of the comparison.
        repeats: number of runs for the median wall time.
        workers: processes of the comparison.
        progress: called with the completed fraction and the next task.

    Raises:
        InputError: for wrong arguments, or if the first run fails.
    """
    mech = mechanism_of(mech, "report")
    report_progress = progress or (lambda done, name: None)
    chosen = variants(methods) if methods else default_variants(mech, METHODS, rtol=rtol)
    first = chosen[0] if not methods or chosen[0].prefix else default_variant(mech, rtol=rtol, method=chosen[0].method)
    run_variants = list(dict.fromkeys([first, *chosen]))
    span = checked_span(mech.duration if t_span is None else t_span)
    study = _Study(mech, span, chosen, run_variants, report_progress)
    try:
        study.run(rtol)
        study.measure_orders()
        study.compare(tolerances, repeats, workers)
    except KeyboardInterrupt:
        if not study.sols:
            raise
    parameters = {
        "t_span": list(span),
        "methods": [str(v) for v in chosen],
        "rtol": study.sols[0].settings.get("rtol"),
        "tolerances": list(tolerances),
        "repeats": repeats,
        "workers": workers,
    }
    return Report(
        card=card(mech),
        sol=study.sols[0],
        drifts=tuple(drift(sol) for sol in study.sols if is_valid_reference(sol)),
        orders=study.orders,
        comparison=study.comparison,
        mechanism=describe(mech),
        meta=provenance(parameters),
        missing=tuple(study.missing()),
    )


class _Study:
    """Finished results of a report: runs, observed orders and a comparison of methods."""

    def __init__(
        self,
        mech: Mechanism,
        span: tuple[float, float],
        chosen: list[Variant],
        run_variants: list[Variant],
        report_progress: Progress,
    ) -> None:
        self.mech, self.span, self.chosen, self.run_variants = mech, span, chosen, run_variants
        self.report_progress = report_progress
        self.sols: list[Solution] = []
        self.orders: OrderStudy | None = None
        self.comparison: Comparison | None = None

    def run(self, rtol: float | None) -> None:
        """Run every method once."""
        for i, v in enumerate(self.run_variants):
            self.report_progress(PROGRESS["runs"] * i / len(self.run_variants), f"run, {v}")
            self.sols.append(_require_finite(uninterrupted(solve(self.mech, self.span, rtol=rtol, **v.arguments()))))

    @property
    def order_methods(self) -> list[Any]:
        """Methods whose order is measured: those without a formulation that take fixed steps."""
        return [v.method for v in self.chosen if not v.prefix and v.name not in SOLVERS]

    def measure_orders(self) -> None:
        """Measure the orders of methods."""
        if self.order_methods:
            report_progress = self.report_progress
            self.orders = order(
                self.mech, self.order_methods, progress=lambda name: report_progress(PROGRESS["runs"], f"order, {name}")
            )

    def compare(self, tolerances: Sequence[float], repeats: int, workers: int) -> None:
        """Compare the methods, unless the user stopped the study of orders."""
        if self.orders is not None and self.orders.missing:
            return
        before = PROGRESS["orders"]
        self.comparison = compare(
            self.mech,
            self.span,
            methods=self.chosen,
            rtol=tolerances,
            repeats=repeats,
            workers=workers,
            progress=lambda done, name: self.report_progress(before + (1.0 - before) * done, f"compare, {name}"),
        )

    def missing(self) -> Iterator[str]:
        """Yield the missing results of the study, in words."""
        if runs := self.run_variants[len(self.sols) :]:
            yield f"runs of {', '.join(map(str, runs))}"
        if self.order_methods and self.orders is None:
            yield "orders"
        elif self.orders and self.orders.missing:
            yield f"orders of {', '.join(self.orders.missing)}"
        if self.comparison is None:
            yield "the comparison"
        elif not self.comparison.complete:
            remaining = self.comparison.requested - len(self.comparison.points)
            absent = f"{remaining} of {self.comparison.requested} runs" if remaining else "times"
            yield f"{absent} of the comparison"


def _require_finite(sol: Solution) -> Solution:
    if not len(sol.t) or not np.isfinite(sol.y).all():
        raise InputError(f"{sol.mechanism.title!r} cannot be run: {sol.status}, {sol.message}")
    return sol


def provenance(parameters: dict[str, Any]) -> dict[str, Any]:
    """Return data to reproduce a result: command, parameters, versions, machine and date."""
    return {
        "command": command_line(),
        "parameters": parameters,
        "versions": {**versions(), "python": platform.python_version()},
        "machine": machine_description(),
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    }
