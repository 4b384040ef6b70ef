"""Which method and tolerance to take when one knows nothing: a comparison over all models that come with mbdae.

Each method needs some time to reach an error of q; relative to the fastest one on the same model, the geometric mean
over the models says how good it is in general, and the largest ratio how wrong it can be. A method that does not reach
the error on a model is counted there. Errors over tolerance say what to expect of a tolerance.

Run: python examples/defaults.py, which takes some minutes
"""

from collections.abc import Mapping, Sequence

import numpy as np

import mbdae

SPANS = {  # s: each model does something within
    "andrews_squeezer": 0.03,
    "bricard": 1.0,
    "delta_robot": 0.2,
    "dual_arm": 0.1,
    "flyball_governor": 0.2,
    "four_bar": 2.0,
    "heavy_top": 0.1,
    "jansen_walker?legs=1": 0.5,
    "panda_handle": 0.3,
    "pendulum": 2.0,
    "slider_crank": 2.0,
    "stewart_platform": 0.2,
}
METHODS = ("herk3", "herk5", "pherk4", "pherk5", "pherk6", "hedop5", "radau5")
TOLERANCES = (1e-4, 1e-6, 1e-8)
TARGETS = (1e-4, 1e-6)


def studies(spans: Mapping[str, float], methods: Sequence[str], tolerances: Sequence[float]) -> dict[str, object]:
    """One comparison for each model."""
    out = {}
    for model, end in spans.items():
        out[model] = mbdae.compare(
            mbdae.load(model), (0, end), methods=methods, rtol=tolerances, repeats=1, max_steps=20_000
        )
        print(f"{model}: {len(out[model].points)} runs", flush=True)
    return out


def main(
    spans: Mapping[str, float] = SPANS,
    methods: Sequence[str] = METHODS,
    tolerances: Sequence[float] = TOLERANCES,
    targets: Sequence[float] = TARGETS,
) -> dict[float, dict[str, float]]:
    """Print the tables; return the mean ratio of each method by target error."""
    result, means = studies(spans, methods, tolerances), {}
    for target in targets:
        ratios: dict[str, list[float]] = {m: [] for m in methods}
        judged = 0
        for study in result.values():
            if target < study.floor():
                continue
            judged += 1
            places = {p.method: p.work for p in study.ranking(target, work="seconds") if p.work}
            for name, work in places.items():
                ratios[name].append(work / min(places.values()))
        means[target] = {m: float(np.exp(np.mean(np.log(r)))) for m, r in ratios.items() if r}
        print(f"\ntime to an error of q of {target:g}, relative to the fastest method, over {judged} models")
        for name, mean in sorted(means[target].items(), key=lambda item: item[1]):
            missed = f", {judged - len(ratios[name])} not reached" if len(ratios[name]) < judged else ""
            print(f"  {name:10s} mean {mean:5.2f}   worst {max(ratios[name]):5.2f}{missed}")
    print("\nerror of q over rtol, least and largest over the models")
    for rtol in tolerances:
        cells = []
        for name in methods:
            points = [p for s in result.values() for p in s.of(name) if p.rtol == rtol and p.success and s.known(p)]
            errors = [p.error_q / rtol for p in points]
            cells.append(f"{name} {min(errors):.1g} to {max(errors):.1g}" if errors else f"{name} -")
        print(f"  rtol {rtol:g}: " + ", ".join(cells))
    return means


if __name__ == "__main__":
    main()
