"""Which method and tolerance to take when one knows nothing: a comparison over all models that come with mbdae.

Each model runs over its own duration as a default run does: steps under control, positions kept. Each method needs some
time to reach an error of q; relative to the fastest one on the same model, the geometric mean over the models says how
good it is in general, and the largest ratio how wrong it can be. A method that does not reach the error on a model is
counted there. Errors over tolerance say what to expect of a tolerance.

Left out by name are models that are stiff, which want radau5, those whose q closures and drivers give alone, so that
its error at the coarsest tolerance is rounding, and for a target those whose reference cannot tell it. The implicit
methods are not compared: the compiled core does not have them, and one method without it takes all others to Python.

Run: python examples/defaults.py, which takes some minutes
"""

import warnings
from collections.abc import Sequence

import numpy as np

import mbdae
from mbdae.studies.comparison import Comparison

METHODS = ("herk3", "herk5", "pherk4", "pherk5", "pherk6", "hedop5")
TOLERANCES = (1e-4, 1e-6, 1e-8)
TARGETS = (1e-4, 1e-6)
REFERENCE = ("project:pherk6", "project:herk5")
SHARES = (0.0, 0.5, 1.0)  # of the models: least, median, largest


def studies(
    models: Sequence[str], methods: Sequence[str], tolerances: Sequence[float], repeats: int
) -> dict[str, Comparison]:
    """One comparison for each model in which q has an error to be judged; the others are said."""
    out = {}
    for model in models:
        mech = mbdae.load(model)
        with warnings.catch_warnings(action="ignore"):
            stiff = mbdae.solve(mech, (0, mech.duration)).stats.get("stiff")
        if stiff:
            print(f"{model}: left out, stiff", flush=True)
            continue
        study = mbdae.compare(
            mech, methods=methods, formulations="project", rtol=tolerances, reference=REFERENCE, repeats=repeats
        )
        if any(study.known(p) for p in study.points if p.rtol == max(tolerances)):
            out[model] = study
            print(f"{model}: {len(study.points)} runs, q known to {study.uncertainty['q']:.1g}", flush=True)
        else:
            print(f"{model}: left out, its errors of q are below {study.floor():.1g}", flush=True)
    return out


def ratios(result: dict[str, Comparison], methods: Sequence[str], target: float) -> dict[str, dict[str, float]]:
    """Time of each method to an error of q over that of the fastest one, by model; what is not reached is missing."""
    out = {}
    for model, study in result.items():
        try:
            found = study.ranking(target, work="seconds")
        except mbdae.InputError as e:
            print(f"{model}: left out, {e}")
            continue
        works = {p.method.rpartition(":")[2]: p.work for p in found if p.work}
        out[model] = {m: works[m] / min(works.values()) for m in methods if m in works}
    return out


def main(
    models: Sequence[str] | None = None,
    methods: Sequence[str] = METHODS,
    tolerances: Sequence[float] = TOLERANCES,
    targets: Sequence[float] = TARGETS,
    repeats: int = 5,
) -> dict[float, dict[str, float]]:
    """Print the tables; return the mean ratio of each method by target error."""
    result, means = studies(models or mbdae.model_names(), methods, tolerances, repeats), {}
    for target in targets:
        print(f"\ntime to an error of q of {target:g}, relative to the fastest method")
        by_model = ratios(result, methods, target)
        rows = {m: [r[m] for r in by_model.values() if m in r] for m in methods}
        means[target] = {m: float(np.exp(np.mean(np.log(r)))) for m, r in rows.items() if r}
        print("  " + " " * 17 + " ".join(f"{m:>7s}" for m in methods))
        for model, row in by_model.items():
            print(f"  {model:17s}" + " ".join(f"{row[m]:7.2f}" if m in row else "      -" for m in methods))
        for what, of in (("geometric mean", means[target].get), ("worst", lambda m, rows=rows: max(rows[m]))):
            print(f"  {what:17s}" + " ".join(f"{of(m):7.2f}" if rows[m] else "      -" for m in methods))
        print(f"  {'not reached':17s}" + " ".join(f"{len(by_model) - len(rows[m]):7d}" for m in methods))
    for what, name in (("at the end", "end_q"), ("largest of 20 times", "error_q")):
        print(f"\nerror of q over rtol, {what}: least, median, largest over the models")
        for rtol in tolerances:
            cells = []
            for m in methods:
                points = [p for s in result.values() for p in s.of(f"project:{m}") if p.rtol == rtol]
                found = np.quantile([getattr(p, name) / rtol for p in points], SHARES) if points else ()
                cells.append(f"{m} " + (" ".join(f"{x:.1g}" for x in found) or "-"))
            print(f"  rtol {rtol:g}: " + ", ".join(cells))
    return means


if __name__ == "__main__":
    main()
