"""Which dimensions of a loop in space decide where its slider stands, and does a sample agree?

Seven dimensions of the model spatial_slider_crank deviate by normal distributions. One reaction analysis gives the
influence of each, and the mean and standard deviation of the slider's position to second order; a sweep assembles the
mechanism for random dimensions instead. Differences are given in standard errors of the sample.

Run: python examples/tolerance_stack.py [number of runs]
"""

import sys

import numpy as np

import mbdae

SIGMAS = {  # standard deviations in m: centre of the crank, its pin, the rod
    **{f"body.crank.xyz.{i}": 1e-3 for i in range(3)},
    **{f"frame.crank_pin.xyz.{i}": 5e-4 for i in range(3)},
    "frame.rod_end.xyz.2": 1e-3,
}
CRANK = 0.7  # rad


def main(n: int = 1000) -> dict[str, float]:
    """Print the analysis, run the sample, and return the differences in standard errors."""
    found = mbdae.tolerance(
        "spatial_slider_crank", "crank", ["q.slider"], SIGMAS,
        span=(CRANK, CRANK + 0.01), points=2, sigmas=1, second_order=True,
    )  # fmt: skip
    print(found)
    nominal = {"crank_pin": (0.0, 0.0, 0.08), "rod_end": (0.0, 0.0, 0.3), "crank": (0.0, 0.1, 0.12)}
    centres = {name: nominal[name.split(".")[1]][int(name[-1])] for name in SIGMAS}
    sample = {name: {"distribution": "normal", "loc": centres[name], "scale": x} for name, x in SIGMAS.items()}
    rest = {"start.q.crank": CRANK, "start.v.crank": 0.0}
    runs = mbdae.sweep("spatial_slider_crank", mbdae.Random(n, sample | rest), 1e-9, outputs=["final q.slider"], seed=1)
    x = runs["final q.slider"] - found.influences.values[0, 0]
    mean, deviation = found.mean_shift[0, 0], found.second_order_deviation[0, 0]
    errors = {
        "mean": float((x.mean() - mean) / (x.std() / np.sqrt(n))),
        "standard deviation": float((x.std(ddof=1) / deviation - 1) * np.sqrt(2 * n)),
    }
    print(f"{n} runs: mean {x.mean():+.4g} m, analysis {mean:+.4g} m, {errors['mean']:+.1f} standard errors")
    print(f"standard deviation {x.std(ddof=1):.6g} m, analysis {deviation:.6g} m, "
          f"{errors['standard deviation']:+.1f} standard errors")  # fmt: skip
    return errors


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
