"""Default method and tolerance: a comparison over all models that come with mbdae.

Each model runs over its default duration as a default run does: with step-size control and projection. Each method
needs some time, and some linear solves, to reach an error of q; relative to the best one on the same model, the
geometric mean over the models measures the method in general, and the largest ratio the worst case. A method that does
not reach the error on a model is counted there. Solves do not depend on the load of the machine; crossings of singular
configurations count only in the time. Errors over tolerance show the accuracy to expect of a tolerance.

Excluded by name are stiff models, which need radau5, those whose q is determined by closures and drivers alone, so that
its error at the coarsest tolerance is rounding, and, for a target, those whose reference is less accurate.

Run: python examples/defaults.py, which takes some minutes
"""

import warnings
from collections.abc import Sequence
from itertools import product

import numpy as np

import mbdae
from mbdae.errors import InputError
from mbdae.studies.comparison.comparison import Comparison, Work

METHODS = ("herk3", "herk5", "pherk4", "pherk5", "pherk6", "hedop5", "radau5")
TOLERANCES = (1e-4, 1e-6, 1e-8)
TARGETS = (1e-4, 1e-6)
REFERENCE = ("project:pherk6", "project:herk5")
WORK: dict[Work, str] = {"seconds": "time", "solves": "solves"}
QUANTILES = (0.0, 0.5, 1.0)  # of the models: smallest, median, largest


def studies(
    models: Sequence[str], methods: Sequence[str], tolerances: Sequence[float], repeats: int
) -> dict[str, Comparison]:
    """One comparison for each model in which the error of q can be measured; the others are printed."""
    out = {}
    for model in models:
        mech = mbdae.load(model)
        with warnings.catch_warnings(action="ignore"):
            stiff = mbdae.solve(mech, (0, mech.duration)).stats.get("stiff")
        if stiff:
            print(f"{model}: omitted, stiff", flush=True)
            continue
        study = mbdae.compare(
            mech, methods=methods, formulations="project", rtol=tolerances, reference=REFERENCE, repeats=repeats
        )
        if any(study.known(p) for p in study.points if p.rtol == max(tolerances)):
            out[model] = study
            known = study.uncertainty["q"]
            print(f"{model}: {len(study.points)} runs, q known to {known:.1g}, {study.computed_by}", flush=True)
        else:
            print(f"{model}: omitted, its errors of q are below {study.floor():.1g}", flush=True)
    return out


def ratios(
    result: dict[str, Comparison], methods: Sequence[str], target: float, work: Work
) -> dict[str, dict[str, float]]:
    """Work of each method to an error of q over that of the best one, by model; missing if not reached."""
    out = {}
    for model, study in result.items():
        try:
            found = study.ranking(target, work=work)
        except InputError as e:
            print(f"{model}: omitted, {e}")
            continue
        works = {p.method.rpartition(":")[2]: p.work for p in found if p.work}
        out[model] = {m: works[m] / min(works.values()) for m in methods if m in works}
    return out


def mean(values: Sequence[float]) -> float:
    """The geometric mean; nan if empty."""
    return float(np.exp(np.mean(np.log(values)))) if values else np.nan


def main(
    models: Sequence[str] | None = None,
    methods: Sequence[str] = METHODS,
    tolerances: Sequence[float] = TOLERANCES,
    targets: Sequence[float] = TARGETS,
    repeats: int = 5,
) -> dict[tuple[Work, float], dict[str, float]]:
    """Print the tables; return the mean ratio of each method by kind of work and target error."""
    result = studies(models or mbdae.model_names(), methods, tolerances, repeats)
    means: dict[tuple[Work, float], dict[str, float]] = {}
    for work, target in product(WORK, targets):
        print(f"\n{WORK[work]} to an error of q of {target:g}, relative to the best method")
        by_model = ratios(result, methods, target, work)
        columns = {m: [r[m] for r in by_model.values() if m in r] for m in methods}
        means[work, target] = {m: mean(column) for m, column in columns.items()}
        print("  " + " " * 17 + " ".join(f"{m:>7s}" for m in methods))
        for model, row in by_model.items():
            print(f"  {model:17s}" + " ".join(f"{row[m]:7.2f}" if m in row else "      -" for m in methods))
        print("  geometric mean   " + " ".join(f"{means[work, target][m]:7.2f}" for m in methods))
        print("  worst            " + " ".join(f"{max(columns[m], default=np.nan):7.2f}" for m in methods))
        print("  not reached      " + " ".join(f"{len(by_model) - len(columns[m]):7d}" for m in methods))
    for what, name in (("at the end", "ends"), ("largest of 20 times", "errors")):
        print(f"\nerror of q over rtol, {what}: smallest, median, largest over the models")
        for rtol in tolerances:
            cells = []
            for m in methods:
                points = [p for s in result.values() for p in s.of(f"project:{m}") if p.rtol == rtol]
                found = np.quantile([getattr(p, name)["q"] / rtol for p in points], QUANTILES) if points else ()
                cells.append(f"{m} " + (" ".join(f"{x:.1g}" for x in found) or "-"))
            print(f"  rtol {rtol:g}: " + ", ".join(cells))
    return means


if __name__ == "__main__":
    main()
