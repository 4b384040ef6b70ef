"""Comparisons as text: aligned columns, and sentences."""

from typing import TYPE_CHECKING

from ...tabular import align_columns
from ...units import displayed, elapsed, quantity, unit_name
from ..method_variant import format_tolerance
from .run_result import COUNTS

if TYPE_CHECKING:
    from .comparison import Comparison
    from .run_result import RunResult

ABBREVIATIONS = {"rejected": "rej.", "factorizations": "fact."}


def comparison_table(result: "Comparison") -> str:
    """Return all runs of a comparison as a table, after the reference and before the ranking."""
    t0, t1 = result.t_span
    lines = [
        f"comparison on {result.title}, {displayed(t0, 's')[0]:g} to {quantity(t1, 's', 'g')}"
        + ("" if result.complete else f" (stopped: {len(result.points)} of {result.requested} runs so far)"),
        f"reference: {result.trust}; < marks errors below its uncertainty",
        f"all runs: {result.computed_by}",
        "",
    ]
    headers, units = comparison_headings(result)
    rows = [*([units] if any(units[:-1]) else []), *comparison_rows(result)[1]]
    ranking = [t.replace(": ", ":\n  ", 1).replace("; fastest", "\n  fastest") for t in result.sentences()]
    omitted = ["", "omitted:", *(f"  {reason}" for reason in result.omitted.values())] if result.omitted else []
    return "\n".join([*lines, *align_columns([headers, *rows]), "", *ranking, *omitted]).rstrip()


def comparison_rows(result: "Comparison") -> tuple[list[str], list[list[str]]]:
    """Return headings with units, and rows, of the table as text."""
    headers = [f"{name} ({unit})" if unit else name for name, unit in zip(*comparison_headings(result), strict=True)]
    return headers, [_row(result, p) for p in result.points]


def comparison_headings(result: "Comparison") -> tuple[list[str], list[str]]:
    """Return headings of the table, and the units of its columns as they are shown."""
    fixed = result.points and all(p.n is not None for p in result.points)
    residuals = ("|g|", "|G v|", "energy") if "v" in result.quantities else ("|g|", "|g'|")
    counts = [ABBREVIATIONS.get(name, name) for name in COUNTS]
    errors = [f"error {name}" for name in result.quantities]
    mixed = any(p.n is not None for p in result.points)
    setting = "fixed steps" if fixed else "rtol or steps" if mixed else "rtol"
    units = [*map(result.unit, result.quantities), result.unit("g"), result.unit("Gv")]
    headers = ["method", setting, *errors, *residuals, *counts, "time"]
    shown = [*map(unit_name, units), *[""] * (len(headers) - len(units) - 3), unit_name("s")]
    return headers, ["", "", *shown]


def _residuals(result: "Comparison") -> int:
    """Return the number of residuals of a run: |g| and |G v|, and for a mechanism the energy."""
    return 3 if "v" in result.quantities else 2


def _row(result: "Comparison", p: "RunResult") -> list[str]:
    n_residuals = _residuals(result)
    setting = format_tolerance(p.rtol) if p.rtol is not None else f"{p.n} steps"
    counts = ["-" if getattr(p, name) is None else str(getattr(p, name)) for name in COUNTS]
    seconds = "-" if p.seconds is None else elapsed(p.seconds)
    if not p.success:
        missing = ["-"] * (len(result.quantities) - 1 + n_residuals)
        return [p.method, setting, p.status, *missing, *counts, seconds]
    errors = [_error(result, p, name) for name in result.quantities]
    residuals = zip((p.g, p.Gv, p.energy), (result.unit("g"), result.unit("Gv"), ""), strict=True)
    drift = ["-" if x is None else f"{displayed(x, unit)[0]:.1e}" for x, unit in residuals][:n_residuals]
    return [p.method, setting, *errors, *drift, *counts, seconds]


def _error(result: "Comparison", p: "RunResult", quantity: str) -> str:
    known, unit = result.known(p, quantity), result.unit(quantity)
    error = displayed(p.errors[quantity] if known else result.floor(quantity), unit)[0]
    return f"{'' if known else '<'}{error:.1e}"
