"""Comparisons as text: aligned columns, and sentences."""

from typing import TYPE_CHECKING

from ...tabular import align_columns
from ..drift.drift import format_tolerance
from .run_result import COUNTS

if TYPE_CHECKING:
    from .comparison import Comparison
    from .run_result import RunResult

ABBREVIATIONS = {"rejected": "rej.", "factorizations": "fact."}


def comparison_table(result: "Comparison") -> str:
    """Return all runs of a comparison as a table, after the reference and before the ranking."""
    t0, t1 = result.t_span
    lines = [
        f"comparison on {result.title}, {t0:g} to {t1:g} s"
        + ("" if result.complete else f" (stopped: {len(result.points)} of {result.requested} runs so far)"),
        f"reference: {result.trust}; < marks errors below its uncertainty",
        f"all runs: {result.computed_by}",
        "",
    ]
    heads, rows = comparison_rows(result)
    ranking = [t.replace(": ", ":\n  ", 1).replace("; fastest", "\n  fastest") for t in result.sentences()]
    omitted = ["", "omitted:", *(f"  {reason}" for reason in result.omitted.values())] if result.omitted else []
    return "\n".join([*lines, *align_columns([heads, *rows]), "", *ranking, *omitted]).rstrip()


def comparison_rows(result: "Comparison") -> tuple[list[str], list[list[str]]]:
    """Return headings and rows of the table as text."""
    fixed = result.points and all(p.n is not None for p in result.points)
    residuals = ("|g|", "|G v|", "energy") if "v" in result.quantities else ("|g|", "|g'|")
    counts = [ABBREVIATIONS.get(name, name) for name in COUNTS]
    errors = [f"error {name}" for name in result.quantities]
    mixed = any(p.n is not None for p in result.points)
    setting = "fixed steps" if fixed else "rtol or steps" if mixed else "rtol"
    heads = ["method", setting, *errors, *residuals, *counts, "seconds"]
    return heads, [_row(result, p, len(residuals)) for p in result.points]


def _row(result: "Comparison", p: "RunResult", n_residuals: int) -> list[str]:
    setting = format_tolerance(p.rtol) if p.rtol is not None else f"{p.n} steps"
    counts = ["-" if getattr(p, name) is None else str(getattr(p, name)) for name in COUNTS]
    seconds = "-" if p.seconds is None else f"{p.seconds:.3f}"
    if not p.success:
        missing = ["-"] * (len(result.quantities) - 1 + n_residuals)
        return [p.method, setting, p.status, *missing, *counts, seconds]
    errors = [_error(result, p, name) for name in result.quantities]
    drift = ["-" if x is None else f"{x:.1e}" for x in (p.g, p.Gv, p.energy)[:n_residuals]]
    return [p.method, setting, *errors, *drift, *counts, seconds]


def _error(result: "Comparison", p: "RunResult", quantity: str) -> str:
    return f"{p.errors[quantity]:.1e}" if result.known(p, quantity) else f"<{result.floor(quantity):.1e}"
