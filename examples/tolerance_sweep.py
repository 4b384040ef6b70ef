"""Tolerances of links and the largest reaction force of a slider-crank, by a thousand runs.

Crank and rod of the model slider_crank have lengths, the rail a height, and the rod a mass that deviate from the
nominal values by normal distributions. Each run takes the crank through about four turns; its
result is the largest force in the wrist pin.

Run: python examples/tolerance_sweep.py [number of runs]
"""

import sys
from pathlib import Path

import numpy as np

import mbdae

LINKS = {  # name in the model: description, nominal value, standard deviation
    "joint.crank_pin.xyz.0": ("crank (m)", 0.1, 0.2e-3),
    "frame.rod_tip.xyz.0": ("rod (m)", 0.35, 0.7e-3),
    "joint.slider.xyz.2": ("height of the rail (m)", 0.0, 0.2e-3),
    "joint.crank_pin.mass": ("mass of the rod (kg)", 0.4, 0.8e-3),
}
FORCE = "peak force.wrist pin"
FEWEST = len(LINKS) + 2  # runs, for a regression over all links


def main(
    n: int = 1000, end: float = 5.0, path: str | Path | None = None, plot: str | Path | None = None, **options: str
) -> mbdae.Sweep:
    """Run the sample, print its statistics, and return the table."""
    links = {name: {"distribution": "normal", "loc": at, "scale": std} for name, (_, at, std) in LINKS.items()}
    result = mbdae.sweep(
        "slider_crank",
        mbdae.Random(n, links),
        end,
        outputs=[FORCE],
        rtol=1e-8,
        max_step=2e-3,  # resolves a peak between the ends of two steps
        path=path,
        seed=1,
        **options,
    )
    finished = np.isfinite(result[FORCE])
    force = result[FORCE][finished]
    if len(force) < FEWEST:
        raise SystemExit(f"{len(LINKS)} links need at least {FEWEST} finished runs, got {len(force)}")
    quantiles = np.quantile(force, [0.05, 0.5, 0.95])
    print(f"{len(result)} runs, {len(result.failed)} failed")
    print(f"largest force in the wrist pin: mean {force.mean():.4f} N, standard deviation {force.std(ddof=1):.4f} N")
    print(f"5, 50 and 95 per cent of the runs stay below {', '.join(f'{x:.4f}' for x in quantiles)} N")
    print(f"\n{'':24}{'correlation':>14}{'N per std':>14}")
    scaled = np.column_stack([(result[name][finished] - at) / std for name, (_, at, std) in LINKS.items()])
    sensitivities = np.linalg.lstsq(np.column_stack([np.ones(len(force)), scaled]), force, rcond=None)[0][1:]
    for (words, _, _), x, sensitivity in zip(LINKS.values(), scaled.T, sensitivities, strict=True):
        print(f"{words:24}{np.corrcoef(x, force)[0, 1]:14.3f}{sensitivity:14.4f}")
    if plot:
        result.plot(plot)
    return result


if __name__ == "__main__":
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    main(runs, path="tolerances.parquet", plot="tolerances.png")
