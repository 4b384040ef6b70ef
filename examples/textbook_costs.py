"""Cost of each family at equal error on the textbook problems: evaluations of f for an error of y.

Every method runs over a range of tolerances; between two runs, log work is linear in log error. Evaluations of f are
what all families have in common: half-explicit methods evaluate it in each iteration for z, implicit ones in each
iteration for all stages. Problems without a known solution are compared with a run at a tight tolerance.

Run: python examples/textbook_costs.py
"""

from collections.abc import Sequence

import mbdae
from mbdae.textbook.problems import TEXTBOOK

FAMILIES = {"HERK": "herk5", "PHERK": "pherk6", "explicit stages": "hedop5", "Radau IIA 5": "radau5", "9": "radau9"}
TOLERANCES = tuple(10.0**-k for k in range(3, 11))
TARGETS = (1e-4, 1e-7)


def main(
    problems: Sequence[str] = tuple(TEXTBOOK),
    targets: Sequence[float] = TARGETS,
    rtol: Sequence[float] = TOLERANCES,
    bdf: bool | None = None,
) -> dict[tuple[str, float], dict[str, float | None]]:
    """Print and return evaluations of f by problem, error of y, and method; None where it is not reached.

    Args:
        problems: names.
        targets: errors of y.
        rtol: tolerances.
        bdf: whether to include SUNDIALS' BDF; if it is installed, when left out.
    """
    methods = [*FAMILIES.values(), *(["ida"] if (installed() if bdf is None else bdf) else [])]
    out = {}
    print(f"{'evaluations of f':22s} error " + "".join(f"{name:>9s}" for name in methods))
    for problem in problems:
        study = mbdae.compare(problem, methods=methods, rtol=rtol, repeats=0)
        for target in targets:
            entries = {e.method: e for e in study.ranking(target, work="f")}
            out[problem, target] = {name: entries[name].work for name in methods}
            cells = [
                f"{'-' if e.work is None else f'{e.work:.0f}' + '*' * e.bound:>9s}" for e in map(entries.get, methods)
            ]
            print(f"{problem:22s} {target:.0e} {''.join(cells)}")
    print("* the coarsest run is more accurate; - not reached")
    return out


def installed() -> bool:
    """Return whether the extra sundials is installed."""
    from importlib.util import find_spec

    return find_spec("sksundae") is not None


if __name__ == "__main__":
    main()
