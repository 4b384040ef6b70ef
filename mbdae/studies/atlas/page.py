"""The page of a benchmark: one HTML file with all data, which is filtered and sorted in the browser, also offline."""

import json
import shlex
from collections.abc import Iterable
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from ...tabular import finite
from ..comparison.comparison import QUANTITIES
from ..comparison.ranking import RankingEntry
from ..comparison.run_result import RunResult
from ..figures import line_style
from ..method_variant import Variant
from ..report.templates import rendered
from .result import WORK_MEASURES, Benchmark, rounded

if TYPE_CHECKING:
    from .method_runs import LongRun, MethodRuns

SECTIONS = {
    "wins": "Which method wins",
    "chart": "Error versus work",
    "runs": "Runs",
    "long": "Energy",
    "failed": "Failures",
}
COUNTS = ("steps", "rejected", "solves", "f", "factorizations")


def page(benchmark: Benchmark) -> str:
    """Return the page as text."""
    package = str(__package__)
    folder = files(package)
    style, script = (Markup(folder.joinpath(f"atlas.{kind}").read_text("utf-8")) for kind in ("css", "js"))
    text = json.dumps(finite(_data(benchmark)), separators=(",", ":"), allow_nan=False).replace("</", "<\\/")
    meta = benchmark.meta
    return rendered(
        package, "atlas.htm",
        counts=benchmark.counts, complete=benchmark.complete, meta=meta, noise=f"{benchmark.noise:.2f}",
        sections=SECTIONS, command=meta["command"], versions=_listed(meta["versions"].items()),
        families=sorted({Variant.parse(r.method).family for r in benchmark.runs}),
        style=style, script=script, data=Markup(text),
    )  # fmt: skip


def _listed(pairs: Iterable[tuple[str, str]]) -> str:
    return ", ".join(f"{name} {value}" for name, value in pairs)


def _data(benchmark: Benchmark) -> dict[str, Any]:
    """Return the data of the page; models and methods are numbered in their order."""
    methods = list(dict.fromkeys(r.method for r in benchmark.runs))
    models = [m for m in benchmark.motions if m.model in benchmark.comparisons]
    return {
        "backend": benchmark.meta["backend"],
        "noise": benchmark.noise,
        "quantities": QUANTITIES,
        "methods": [
            {"name": m, "argument": shlex.quote(m), "family": Variant.parse(m).family, "colour": line_style(m)["color"]}
            for m in methods
        ],
        "models": [
            {
                "name": m.model, "argument": shlex.quote(m.model), "title": m.title, "duration": m.duration,
                "reference": m.reference, "cross_check": m.cross_check, "floors": _floors(benchmark, m.model),
                "ranks": {name: _ranks(benchmark, m.model, name, methods) for name in QUANTITIES},
            }
            for m in models
        ],
        "runs": _runs(benchmark.runs, [m.model for m in models], methods),
        "long": [_long(r, r.long) for r in benchmark.runs if r.long],
        "failed": benchmark.failures,
    }  # fmt: skip


def _floors(benchmark: Benchmark, model: str) -> dict[str, float | None]:
    """Return the smallest known errors, by quantity."""
    return {name: rounded(benchmark.comparisons[model].floor(name)) for name in QUANTITIES}


def _ranks(benchmark: Benchmark, model: str, quantity: str, methods: list[str]) -> list[list[Any]]:
    """Return the error, and for each kind of work [index of the method, work, 1 if an upper bound], the best first."""

    def entries(ranking: list[RankingEntry]) -> list[list[Any]]:
        return [[methods.index(x.method), rounded(x.work), int(x.bound)] for x in ranking if x.work]

    ranks = benchmark.rankings(model, quantity)
    return [[target, *(entries(r[measure]) for measure in WORK_MEASURES)] for target, r in ranks.items()]


def _runs(runs: tuple["MethodRuns", ...], models: list[str], methods: list[str]) -> list[list[Any]]:
    return [[models.index(r.model), methods.index(r.method), *_run(p)] for r in runs for p in r.points]


def _run(p: RunResult) -> list[Any]:
    """Return rtol, number of steps, errors, residuals, counts, CPU time and status of a run."""
    errors = [p.errors.get(name) for name in QUANTITIES]
    values = [p.rtol, p.n, *errors, p.g, p.Gv, p.energy, *(getattr(p, name) for name in COUNTS), p.seconds]
    return [*(rounded(x) for x in values), p.status]


def _long(r: "MethodRuns", x: "LongRun") -> dict[str, Any]:
    """Return the data of a long run; the step is not rounded, since the command that repeats the run contains it."""
    energy = {"trend": x.trend, "trend_error": x.trend_error, "rate": x.largest_rate, "energy": x.energy}
    residuals = {"g": x.g, "Gv": x.Gv, "solves": x.solves}
    values = {name: rounded(value) for name, value in {**energy, **residuals}.items()}
    return {"model": r.model, "method": r.method, "step": x.step, "end": x.t_end, "status": x.status, **values}
