"""Result of `mbdae.studies.atlas.atlas.atlas`: comparisons and long runs by model, and which method wins where."""

import json
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from statistics import quantiles
from typing import Any, NamedTuple

from ...data_types import JsonObject
from ...errors import InputError
from ...file_io import atomic_write, write_page
from ...tabular import Tabular, align_columns
from ..comparison.comparison import Comparison, Work
from ..comparison.ranking import RankingEntry
from .method_runs import MethodRuns
from .model_motion import ModelMotion

PAGE, DATA = ".html", ".json"
WORK_MEASURES: tuple[Work, ...] = ("solves", "f", "seconds")
SHOWN_WORK_MEASURES: tuple[Work, ...] = ("solves", "seconds")  # in the summary
STIFF = "stiff"  # status of finished runs with a stiffness warning
NOISE = 0.9  # quantile of the scatter of CPU times that is reported as noise
TARGET_DEFAULTS = (1e-2, 1e-4, 1e-6, 1e-8)  # errors of q in the summary


class BestMethod(NamedTuple):
    """The best method of a model for an error of q.

    Attributes:
        model: name or path.
        target: the error in rad or m.
        fewest: methods with the fewest linear solves, to 1 %.
        solves: number of these solves; an upper bound if ``bound``.
        bound: whether even the coarsest run is more accurate.
        fastest: methods with the least CPU time, within the noise.
        seconds: the least CPU time in s.
    """

    model: str
    target: float
    fewest: tuple[str, ...]
    solves: float
    bound: bool
    fastest: tuple[str, ...]
    seconds: float


class FailedRun(NamedTuple):
    """A run that failed or has a warning, or a method that does not suit a model; all fields are texts."""

    model: str
    method: str
    setting: str
    status: str
    reason: str


EQUAL_WORK = 1.01  # interpolated numbers of solves within this ratio are taken as equal
DIGITS = 4  # digits of numbers on the page and in the file; three cannot resolve EQUAL_WORK


@dataclass(frozen=True)
class Benchmark(Tabular):
    """Result of `mbdae.atlas`.

    Attributes:
        motions: motions of the models.
        runs: the runs of each method on each model.
        complete: False if the benchmark was stopped before its end.
        models: number of requested models.
        requested: number of requested pairs of a method and a model.
        meta: back end, machine, versions, tolerances, command, date.
    """

    motions: tuple[ModelMotion, ...]
    runs: tuple[MethodRuns, ...]
    complete: bool
    models: int
    requested: int
    meta: dict[str, Any]

    @cached_property
    def comparisons(self) -> dict[str, Comparison]:
        """The runs by model, as `mbdae.compare` returns them."""
        about = {key: self.meta[key] for key in ("backend", "machine", "versions")}
        out = {}
        for m in self.motions:
            points = tuple(p for r in self.runs if r.model == m.model for p in r.points)
            trust, meta = (m.reference, m.cross_check, m.uncertainty), {**about, "omitted": m.omitted}
            if points:
                out[m.model] = Comparison(m.title, (0.0, m.duration), points, *trust, self.complete, meta)
        return out

    @cached_property
    def noise(self) -> float:
        """Noise of CPU times: the 90 % quantile of the ratio of the largest to the smallest time of a run."""
        spreads = [max(p.times) / min(p.times) for r in self.runs for p in r.points if len(p.times) > 1]
        return quantiles(spreads, n=10)[round(10 * NOISE) - 1] if len(spreads) > 1 else 1.0

    @cached_property
    def wins(self) -> list[BestMethod]:
        """The best methods of each model for each power of ten of the error of q that two methods reach."""
        return [self._best_method(name, c, target) for name, c in self.comparisons.items() for target in c.targets()]

    def _best_method(self, model: str, c: Comparison, target: float) -> BestMethod:
        solves, seconds = (c.ranking(target, work=work) for work in ("solves", "seconds"))
        least, shortest = solves[0], seconds[0]
        return BestMethod(
            model, target, _within(solves, EQUAL_WORK), least.work or 0.0, least.bound,
            _within(seconds, self.noise), shortest.work or 0.0,
        )  # fmt: skip

    @cached_property
    def failures(self) -> list[FailedRun]:
        """Runs that failed or have a warning, unsuitable methods, and models without runs, with their reasons."""
        out = [FailedRun(m.model, "", "", "omitted", m.failure) for m in self.motions if m.failure]
        for m in self.motions:
            out += [FailedRun(m.model, method, "", "omitted", reason) for method, reason in m.omitted.items()]
        for r in self.runs:
            for p in r.points:
                if not p.success or p.message:
                    setting = f"rtol {p.rtol:g}" if p.rtol else f"{p.n} steps"
                    status = STIFF if p.status == "finished" else p.status
                    out.append(FailedRun(r.model, r.method, setting, status, p.message))
            if r.long and r.long.message:
                out.append(FailedRun(r.model, r.method, f"long, step {r.long.step:g} s", r.long.status, r.long.message))
        return out

    @property
    def counts(self) -> str:
        """Numbers of models, methods and runs in words."""
        n, methods = sum(len(r.points) for r in self.runs), {r.method for r in self.runs}
        return f"{len(self.motions)} models, {len(methods)} methods, {n} runs"

    def cells(self) -> list[list[str]]:
        """Return for each model the methods with the fewest linear solves, by error of q."""
        found = {(w.model, w.target): w for w in self.wins}
        rows = [[m.model, *(_cell(found.get((m.model, target))) for target in TARGET_DEFAULTS)] for m in self.motions]
        return [["fewest solves to an error of q of", *(f"{x:.0e}" for x in TARGET_DEFAULTS)], *rows]

    def summary(self) -> list[str]:
        """Return, for each target error, on how many models each method needs the fewest solves or the least time."""
        out = []
        for target in TARGET_DEFAULTS:
            wins = [w for w in self.wins if w.target == target]
            if wins:
                solves, seconds = (_counted([getattr(w, x) for w in wins]) for x in ("fewest", "fastest"))
                fastest = f"fastest, within the noise, {seconds}"
                out.append(f"{target:.0e} ({len(wins)} models): fewest solves {solves}; {fastest}")
        return out

    def __str__(self) -> str:
        where = f"{self.meta['backend']} back end, {self.meta['machine']}"
        so_far = f"{len(self.runs)} of {self.requested} pairs of a method and a model"
        done = "" if self.complete else f" (stopped: {so_far})"
        failed = Counter(f.status for f in self.failures)
        lines = [
            f"atlas of {self.counts}{done}",
            f"all runs: {where}; CPU times vary by a factor of {self.noise:.2f}",
            "",
        ]
        lines += [*align_columns(self.cells()), "", *self.summary()]
        if failed:
            listed = ", ".join(f"{status} {n}" for status, n in failed.most_common())
            lines.append(f"failures and warnings: {listed}")
        return "\n".join(lines)

    def rankings(self, model: str, quantity: str) -> dict[float, dict[Work, list[RankingEntry]]]:
        """Return the methods of a model by work, for each power of ten of an error."""
        c = self.comparisons[model]
        return {
            x: {work: c.ranking(x, work=work, quantity=quantity) for work in WORK_MEASURES} for x in c.targets(quantity)
        }

    def to_dict(self) -> JsonObject:
        """Return JSON data: for each model the work for errors of q, the energy drift, and failures.

        Amounts of work are in the order of the methods, negative for upper bounds. `BenchmarkData` stores all runs.
        """
        models = {m.model: self._model_data(m) for m in self.motions}
        return {"meta": self.meta, "complete": self.complete, "noise": round(self.noise, 3), "models": models}

    def _model_data(self, m: ModelMotion) -> JsonObject:
        """Return the data of a model, see `to_dict`."""
        out: JsonObject = {
            "title": m.title, "duration": m.duration, "reference": m.reference, "cross_check": m.cross_check,
            "uncertainty": m.uncertainty, "methods": m.methods, "omitted": m.omitted, "failure": m.failure,
        }  # fmt: skip
        if m.model in self.comparisons:
            out["work"] = {
                f"{target:.0e}": {work: _signed_work(found[work], m.methods) for work in SHOWN_WORK_MEASURES}
                for target, found in self.rankings(m.model, "q").items()
            }
        runs = [r for r in self.runs if r.model == m.model]
        out["energy_rate"] = {r.method: [rounded(r.long.largest_rate), r.long.has_trend] for r in runs if r.long}
        out["failed"] = {
            r.method: status
            for r in runs
            if (status := {f"{p.rtol or p.n:g}": p.status for p in r.points if not p.success})
        }
        return out

    def save(self, path: str | Path) -> None:
        """Write the page as .html, see `mbdae.studies.atlas.page`, or `to_dict` as .json.

        Raises:
            InputError: for another suffix or an unwritable path.
        """
        from .page import page

        if Path(path).suffix == DATA:
            with atomic_write(path) as temporary:
                temporary.write_text(json.dumps(self.to_dict(), separators=(",", ":")) + "\n", "utf-8")
        elif Path(path).suffix == PAGE:
            write_page(path, lambda: page(self), "an atlas")
        else:
            raise InputError(f"an atlas is saved as {PAGE} or {DATA}, got {str(path)!r}")


def _within(entries: list[RankingEntry], ratio: float) -> tuple[str, ...]:
    """Return the methods whose work is at most ``ratio`` times the least work."""
    least = entries[0].work or 0.0
    return tuple(x.method for x in entries if x.work is not None and x.work <= ratio * least)


def _cell(win: BestMethod | None) -> str:
    return "-" if win is None else f"{', '.join(win.fewest)} {'<= ' * win.bound}{win.solves:.3g}"


def _counted(names: list[tuple[str, ...]]) -> str:
    return ", ".join(f"{name} {n}" for name, n in Counter(x for some in names for x in some).most_common())


def _signed_work(entries: list[RankingEntry], methods: tuple[str, ...]) -> list[float | None]:
    found = {x.method: (x.work, x.bound) for x in entries}
    amounts = [found.get(name, (None, False)) for name in methods]
    return [None if work is None else (rounded(-work) if bound else rounded(work)) for work, bound in amounts]


def rounded(x: float | None) -> float | None:
    """Round a number to `DIGITS` significant digits; an int if it is integral, ints are unchanged."""
    if x is None or isinstance(x, int):
        return x
    y = float(f"{x:.{DIGITS - 1}e}")
    return int(y) if y.is_integer() else y
