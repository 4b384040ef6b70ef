"""Comparisons as text: aligned columns, and sentences."""

from typing import TYPE_CHECKING

from ...tabular import aligned
from ..drift.drift import brief

if TYPE_CHECKING:
    from .comparison import Comparison, Point, Quantity

COUNTS = ("steps", "rejected", "f", "M", "G", "solves", "factorizations")
HEADS = ("method", "rtol", "error q", "error v", "error lam", "|g|", "|G v|", "energy", *COUNTS, "seconds")
SHORT = {"rejected": "rej.", "factorizations": "fact."}


def comparison_table(result: "Comparison") -> str:
    """All runs of a comparison as a table, with the reference above and the ranking below."""
    t0, t1 = result.t_span
    u = result.uncertainty
    lines = [
        f"comparison on {result.title}, {t0:g} to {t1:g} s"
        + ("" if result.complete else f" (stopped: {len(result.points)} runs so far)"),
        f"reference: {result.reference}; {result.witness} differs by"
        f" {u['q']:.1e} in q, {u['v']:.1e} in v, {u['lam']:.1e} in lam; < marks errors too small to be known by it",
        f"all runs: {result.computed_by}",
        "",
    ]
    heads, rows = comparison_rows(result)
    ranking = [t.replace(": ", ":\n  ", 1).replace("; fastest", "\n  fastest") for t in result.sentences()]
    return "\n".join([*lines, *aligned([heads, *rows]), "", *ranking]).rstrip()


def comparison_rows(result: "Comparison") -> tuple[list[str], list[list[str]]]:
    """Headings and rows of the table as text."""
    heads = [SHORT.get(h, h) for h in HEADS]
    if result.points and all(p.n is not None for p in result.points):
        heads[1] = "fixed steps"
    return heads, [_row(result, p) for p in result.points]


def _row(result: "Comparison", p: "Point") -> list[str]:
    setting = brief(p.rtol) if p.rtol is not None else f"{p.n} steps"
    counts = ["-" if getattr(p, name) is None else str(getattr(p, name)) for name in COUNTS]
    seconds = "-" if p.seconds is None else f"{p.seconds:.3f}"
    if not p.success:
        return [p.method, setting, p.status, "-", "-", "-", "-", "-", *counts, seconds]
    errors = [_error(result, p, name) for name in ("q", "v", "lam")]
    drift = ["-" if x is None else f"{x:.1e}" for x in (p.g, p.Gv, p.energy)]
    return [p.method, setting, *errors, *drift, *counts, seconds]


def _error(result: "Comparison", p: "Point", quantity: "Quantity") -> str:
    return f"{p.error(quantity):.1e}" if result.known(p, quantity) else f"<{result.floor(quantity):.1e}"
