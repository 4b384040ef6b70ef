"""One report on a mechanism: what it is, a run, how runs drift, observed orders, and a comparison of methods."""

import platform
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ...backend import machine
from ...errors import InputError, require
from ...files import write_page
from ...integrate.solve import solve
from ...integrate.span import checked_span
from ...mechanism import Mechanism, describe
from ...solution.archive import versions
from ...solution.solution import Solution
from ..card.card import Card, card
from ..comparison.compare import compare
from ..comparison.comparison import Comparison
from ..drift.drift import Drift, drift
from ..order.order import check_order
from ..order.result import OrderStudy
from ..variant import Variant, variants

__all__ = ["report"]

METHODS = ("pherk5", "pherk6", "herk5", "radau5", "ggl:pherk5", "index1:dop853")
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
SHARES = {"runs": 0.1, "orders": 0.35, "comparison": 1.0}  # where each part ends, as a fraction of the work
Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Report:
    """Result of `report`.

    Attributes:
        card: what the mechanism is.
        sol: the run that is replayed.
        drifts: drift of every method's run.
        orders: observed and claimed orders; None when no method without a formulation was asked for.
        comparison: methods against a reference.
        mechanism: description of the mechanism, enough to make it again.
        meta: command, parameters, versions, machine and date.
    """

    card: Card
    sol: Solution
    drifts: tuple[Drift, ...]
    orders: OrderStudy | None
    comparison: Comparison
    mechanism: dict[str, Any]
    meta: dict[str, Any]

    @property
    def parts(self) -> list[Any]:
        """The results in order."""
        return [part for part in (self.card, *self.drifts, self.orders, self.comparison) if part is not None]

    def __str__(self) -> str:
        return "\n\n".join(str(part) for part in self.parts)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON, without the run's states."""
        run = {"status": self.sol.status, "message": self.sol.message, "stats": self.sol.stats}
        return {
            "card": self.card.to_dict(),
            "run": {**run, "settings": self.sol.settings},
            "drift": [d.to_dict() for d in self.drifts],
            "orders": self.orders.to_dict() if self.orders else None,
            "comparison": self.comparison.to_dict(),
            "meta": self.meta,
        }

    def save(self, path: str | Path) -> None:
        """Write one self-contained HTML page, see `mbdae.studies.report.page`.

        Raises:
            InputError: for another suffix or an unwritable path.
        """
        from .page import page

        write_page(path, lambda: page(self), "a report")


def report(
    mech: Mechanism,
    end: float | None = None,
    *,
    methods: Sequence[str | Variant] | None = None,
    rtol: float = 1e-8,
    tolerances: Sequence[float] = TOLERANCES,
    repeats: int = 3,
    workers: int = 1,
    progress: Progress | None = None,
) -> Report:
    """Study a mechanism from its start state.

    Args:
        mech: the mechanism.
        end: end time in s; the model's own when left out.
        methods: as for `mbdae.compare`; the first one makes the run that is replayed, those without a formulation are
            judged for their orders.
        rtol: relative tolerance of the run and of the drift table.
        tolerances: relative tolerances of the comparison.
        repeats: runs for the median of the wall time.
        workers: processes of the comparison.
        progress: called with the fraction done and what is next.

    Raises:
        InputError: for wrong arguments, or when the first run does not come to its end.
    """
    require(mech, Mechanism, "report takes a Mechanism (see mbdae.load)")
    tell = progress or (lambda done, name: None)
    chosen = variants(methods or METHODS)
    span = checked_span(mech.duration if end is None else end)
    sols = []
    for i, v in enumerate(chosen):
        tell(SHARES["runs"] * i / len(chosen), f"run, {v}")
        sols.append(_finished(solve(mech, span, rtol=rtol, **v.arguments())))
    plain = [v.method for v in chosen if not v.prefix]
    orders = check_order(mech, plain, progress=lambda name: tell(SHARES["runs"], f"order, {name}")) if plain else None
    left = 1.0 - SHARES["orders"]
    comparison = compare(
        mech,
        span,
        methods=chosen,
        rtol=tolerances,
        repeats=repeats,
        workers=workers,
        progress=lambda done, name: tell(SHARES["orders"] + left * done, f"compare, {name}"),
    )
    if not comparison.complete:
        raise KeyboardInterrupt
    parameters = {
        "t_span": list(span),
        "methods": [str(v) for v in chosen],
        "rtol": rtol,
        "tolerances": list(tolerances),
        "repeats": repeats,
        "workers": workers,
    }
    done = [sol for sol in sols if sol.success]
    return Report(
        card=card(mech),
        sol=sols[0],
        drifts=tuple(drift(sol) for sol in done),
        orders=orders,
        comparison=comparison,
        mechanism=describe(mech),
        meta=provenance(parameters),
    )


def _finished(sol: Solution) -> Solution:
    if sol.status == "interrupted":
        raise KeyboardInterrupt
    if not len(sol.t) or not np.isfinite(sol.y).all():
        raise InputError(f"{sol.mechanism.title!r} cannot be run: {sol.status}, {sol.message}")
    return sol


def provenance(parameters: dict[str, Any]) -> dict[str, Any]:
    """What repeats a result: command, parameters, versions, machine and date."""
    program = Path(sys.argv[0]).name
    return {
        "command": shlex.join(["mbdae" if program == "__main__.py" else program, *sys.argv[1:]]),
        "parameters": parameters,
        "versions": {**versions(), "python": platform.python_version()},
        "machine": machine(),
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    }
