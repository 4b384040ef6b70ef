"""Which integrator for this mechanism? A work-precision study in a few lines.

Run: python examples/compare_integrators.py
"""

from pathlib import Path

import mbdae

METHODS = ("herk3", "herk5", "pherk5", "pherk6", "radau5", "ggl:pherk5", "index1:dop853")


def main(folder: str | Path = ".", model: str = "four_bar", end: float = 2.0, repeats: int = 3) -> object:
    """Write compare.csv and compare.png into ``folder`` and return the study."""
    study = mbdae.compare(mbdae.load(model), (0, end), methods=METHODS, rtol=(1e-4, 1e-6, 1e-8), repeats=repeats)
    print(study)
    study.save(Path(folder) / "compare.csv")
    study.plot(Path(folder) / "compare.png")
    return study


if __name__ == "__main__":
    main()
