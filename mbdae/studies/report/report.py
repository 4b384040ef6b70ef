"""One report on a mechanism: what it is, a run, how runs drift, observed orders, and a comparison of methods."""

import platform
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ...backend import machine
from ...errors import InputError
from ...file_io import write_page
from ...integrate.solve import solve
from ...integrate.span import checked_span
from ...mechanism import Mechanism, describe
from ...solution.archive import versions
from ...solution.problem import mechanism_of
from ...solution.solution import Solution, uninterrupted
from ..card.card import Card, card
from ..comparison.compare import compare
from ..comparison.comparison import Comparison
from ..drift.drift import Drift, drift
from ..method_variant import Variant, default, usual, variants
from ..order.order import check_order
from ..order.result import OrderStudy

__all__ = ["report"]

METHODS = ("pherk6", "pherk5", "herk5", "radau5", "ggl:pherk5", "index1:dop853")  # behind the default
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
SHARES = {"runs": 0.1, "orders": 0.35, "comparison": 1.0}  # where each part ends, as a fraction of the work
Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Report:
    """Result of `report`.

    Attributes:
        card: what the mechanism is.
        sol: the run that is replayed, that of ``mbdae run``.
        drifts: drift of every method's run.
        orders: observed and claimed orders; None when no method without a formulation was asked for.
        comparison: methods against a reference; None when the user stopped it before the reference was there.
        mechanism: description of the mechanism, enough to make it again.
        meta: command, parameters, versions, machine and date.
        missing: what was left when the user stopped the study, in words.
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
    def parts(self) -> list[Any]:
        """The results in order."""
        every = (self.card, self.sol, *self.drifts, self.orders, self.comparison)
        return [part for part in every if part is not None]

    @property
    def without(self) -> str:
        """What is missing, in words."""
        return f"without {'; '.join(self.missing)}" if self.missing else ""

    def __str__(self) -> str:
        return "\n\n".join([*map(str, self.parts), *([f"stopped by the user {self.without}"] if self.missing else [])])

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON, without the run's states."""
        run = {"status": self.sol.status, "message": self.sol.message, "stats": self.sol.stats}
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
    mech: Mechanism | str | Path,
    end: float | None = None,
    *,
    methods: Sequence[str | Variant] | None = None,
    rtol: float | None = None,
    tolerances: Sequence[float] = TOLERANCES,
    repeats: int = 3,
    workers: int = 1,
    progress: Progress | None = None,
) -> Report:
    """Study a mechanism from its start state. Stopped by Ctrl-C, it returns what was finished.

    Args:
        mech: the mechanism, or what `mbdae.load` takes.
        end: end time in s; the model's own when left out.
        methods: as for `mbdae.compare`, the default first when left out. That one makes the run that is replayed, as
            ``mbdae run`` does, with positions kept where no formulation is said; those without a formulation are judged
            for their orders.
        rtol: relative tolerance of the run and of the drift table; that of `mbdae.solve` when left out.
        tolerances: relative tolerances of the comparison.
        repeats: runs for the median of the wall time.
        workers: processes of the comparison.
        progress: called with the fraction done and what is next.

    Raises:
        InputError: for wrong arguments, or when the first run does not come to its end.
    """
    mech = mechanism_of(mech, "report")
    tell = progress or (lambda done, name: None)
    chosen = variants(methods) if methods else usual(mech, METHODS, rtol=rtol)
    first = chosen[0] if not methods or chosen[0].prefix else default(mech, rtol=rtol, method=chosen[0].method)
    moved = list(dict.fromkeys([first, *chosen]))
    span = checked_span(mech.duration if end is None else end)
    plain = [v.method for v in chosen if not v.prefix]
    sols, orders, comparison, left = list[Solution](), None, None, 1.0 - SHARES["orders"]
    try:
        for i, v in enumerate(moved):
            tell(SHARES["runs"] * i / len(moved), f"run, {v}")
            sols.append(_finished(uninterrupted(solve(mech, span, rtol=rtol, **v.arguments()))))
        if plain:
            orders = check_order(mech, plain, progress=lambda name: tell(SHARES["runs"], f"order, {name}"))
        if orders is None or not orders.missing:
            comparison = compare(
                mech,
                span,
                methods=chosen,
                rtol=tolerances,
                repeats=repeats,
                workers=workers,
                progress=lambda done, name: tell(SHARES["orders"] + left * done, f"compare, {name}"),
            )
    except KeyboardInterrupt:
        if not sols:
            raise
    parameters = {
        "t_span": list(span),
        "methods": [str(v) for v in chosen],
        "rtol": sols[0].settings.get("rtol"),
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
        missing=tuple(_missing([str(v) for v in moved[len(sols) :]], orders, bool(plain), comparison)),
    )


def _missing(runs: list[str], orders: OrderStudy | None, judged: bool, comparison: Comparison | None) -> Iterator[str]:
    """What a study is without, in words."""
    if runs:
        yield f"runs of {', '.join(runs)}"
    if judged and orders is None:
        yield "orders"
    elif orders and orders.missing:
        yield f"orders of {', '.join(orders.missing)}"
    if comparison is None:
        yield "the comparison"
    elif not comparison.complete:
        left = comparison.asked - len(comparison.points)
        yield f"{left} of {comparison.asked} runs of the comparison" if left else "times of the comparison"


def _finished(sol: Solution) -> Solution:
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
