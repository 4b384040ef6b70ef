"""Work and precision of all families of methods on nine mechanisms.

Every method that suits a mechanism runs: with tolerances, or with numbers of fixed steps if it has no step-size
control. The table has the linear solves of each method to an error of q, relative to the fewest, which unlike times do
not depend on the load of the machine; "<=" marks those of the coarsest run, if this is more accurate. Omitted are
methods whose steps the compiled core does not take. "-" are those that do not reach the error with the tolerances and
numbers below, or do not suit the mechanism.

Run: python examples/all_families.py, which takes some minutes
"""

from collections.abc import Mapping, Sequence

import mbdae
from mbdae.studies.comparison.comparison import Comparison, Work

SPANS = {  # s
    "pendulum": 2.0,
    "four_bar": 1.0,
    "slider_crank": 0.5,
    "spring_four_bar": 1.0,
    "bricard": 2.0,
    "stewart_platform": 0.5,
    "heavy_top": 0.1,
    "delta_robot": 0.5,
    "flyball_governor": 0.2,
}
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6)
STEPS = (20, 80, 320, 1280)
TARGET = 1e-5  # rad or m


def main(
    spans: Mapping[str, float] = SPANS,
    rtol: Sequence[float] = TOLERANCES,
    steps: Sequence[int] = STEPS,
    target: float = TARGET,
    work: Work = "solves",
) -> dict[str, Comparison]:
    """Print the work of each method on each mechanism to an error of q, and return the comparisons."""
    out: dict[str, Comparison] = {}
    for model, end in spans.items():
        study = mbdae.compare(model, (0, end), methods="all", rtol=rtol, steps=steps, repeats=2 * (work == "seconds"))
        out[model] = study
        omitted = ", ".join(study.omitted) or "none"
        print(f"{model}: {len(study.points)} runs, {study.computed_by}; omitted: {omitted}", flush=True)
    rankings = {model: study.ranking(target, work=work) for model, study in out.items()}
    reached = {model: {x.method: x for x in row if x.work} for model, row in rankings.items()}
    best = {model: min((x.work for x in row.values()), default=0.0) for model, row in reached.items()}
    print(f"\n| {work} to an error of q of {target:g} | " + " | ".join(f"`{model}`" for model in out) + " |")
    print("|---" * (len(out) + 1) + "|")
    print("| least | " + " | ".join(f"{x:.3g}" for x in best.values()) + " |")
    for method in dict.fromkeys(name for study in out.values() for name in study.methods):
        found = [(row.get(method), best[model]) for model, row in reached.items()]
        cells = [f"{'<= ' * x.bound}{float(f'{x.work / least:.2g}'):g}" if x else "-" for x, least in found]
        print(f"| `{method}` | " + " | ".join(cells) + " |")
    return out


if __name__ == "__main__":
    main()
