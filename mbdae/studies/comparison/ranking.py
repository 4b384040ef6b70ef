"""Ranking of methods by the work that they need for an error: interpolation in work-precision data."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor, log

from ...units import elapsed, unit_name

Runs = Sequence[tuple[float, float]]  # (error, work), from coarse to fine


@dataclass(frozen=True)
class RankingEntry:
    """A method in a ranking.

    Attributes:
        method: name of the method.
        work: required work; None if the method does not reach the target.
        bound: True if even its coarsest run is more accurate than the target: an upper bound of the work.
    """

    method: str
    work: float | None
    bound: bool = False


def work_at(runs: Runs, target: float) -> tuple[float | None, bool]:
    """Return the work that a method needs to reach an error, and whether it is only an upper bound.

    Between the last run above the target and the next run, log work is linear in log error; if the error of the next
    run is zero, its work is returned. None if the error of the finest run is above the target.
    """
    above = [i for i, (error, _) in enumerate(runs) if error > target]
    if not runs or (above and above[-1] == len(runs) - 1):
        return None, False
    if not above:
        return runs[0][1], True
    (e0, w0), (e1, w1) = runs[above[-1]], runs[above[-1] + 1]
    if not e1:
        return w1, False
    fraction = log(e0 / target) / log(e0 / e1)
    return w0 * (w1 / w0) ** fraction, False


def rank(table: Mapping[str, Runs], target: float) -> list[RankingEntry]:
    """Order methods by their work for an error; methods that do not reach it come last."""
    entries = [RankingEntry(name, *work_at(runs, target)) for name, runs in table.items()]
    return sorted(entries, key=lambda p: float("inf") if p.work is None else p.work)


def targets(errors: Sequence[Sequence[float]], bound: float) -> list[float]:
    """Return the powers of ten, at least ``bound``, that two methods reach and at least one run exceeds.

    Args:
        errors: errors of the runs of each method.
        bound: the smallest known error.
    """
    best = sorted(min(e) for e in errors if e)
    if not best:
        return []
    low = max(best[min(1, len(best) - 1)], bound)
    high = max(max(e) for e in errors if e)
    if not 0 < low <= high:
        return []
    return [10.0**k for k in range(min(floor(log10(high)), 0), ceil(log10(low)) - 1, -1)]


def log10(x: float) -> float:
    """Return the logarithm to base 10, rounded so that powers of ten are exact."""
    return round(log(x) / log(10.0), 9)


def sentence(entries: Sequence[RankingEntry], work: str) -> str:
    """Return a ranking in words; empty if no method was measured."""
    reached = [(p, p.work) for p in entries if p.work is not None]
    if not reached:
        return ""
    first, lowest = reached[0]
    word = {"solves": "fewest solves", "seconds": "fastest"}[work]
    text = f"{word} {first.method} ({_amount(lowest, work, first.bound)})"
    if reached[1:]:
        text += ", then " + ", ".join(f"{p.method} (x {w / lowest:.2f})" for p, w in reached[1:])
    missing = [p.method for p in entries if p.work is None]
    return text + (f"; not reached by {', '.join(missing)}" if missing and work == "solves" else "")


def _amount(value: float, work: str, bound: bool) -> str:
    text = f"{value:.0f}" if work == "solves" else f"{elapsed(value)} {unit_name('s')}"
    return f"at most {text}" if bound else text
