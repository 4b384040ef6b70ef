"""Would Radau IIA of variable order pay off? A bound from runs of fixed orders 5, 9 and 13.

At time t a method of order p takes steps of h_p(t), at a cost of c_p each, so that its run costs the integral of
c_p/h_p. Of all choices of an order at each time the cheapest costs the integral of min_p c_p/h_p: less than any control
of the order, which also has to find out, and to start with a low order. c_p are the solves of the run per step.

Run: python examples/benchmarks/radau_orders.py
"""

from collections.abc import Sequence

import numpy as np

import mbdae

METHODS = ("radau5", "radau9", "radau13")
MODELS = ("flyball_governor", "car_axis")
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
POINTS = 2000  # of time


def main(models: Sequence[str] = MODELS, rtol: Sequence[float] = TOLERANCES) -> dict[tuple[str, float], float]:
    """Print the solves of each order, and return what a free choice of the order saves at most, as a share of them."""
    saved = {}
    print(f"{'solves':18s} rtol " + "".join(f"{name:>10s}" for name in METHODS) + "   free choice   saved")
    for model in models:
        mech = mbdae.load(model)
        t = (np.arange(POINTS) + 0.5) / POINTS * mech.duration
        for tolerance in rtol:
            runs = [mbdae.solve(mech, method=name, rtol=tolerance) for name in METHODS]
            rates = np.array([rate(sol, t) for sol in runs])
            totals, free = rates.mean(axis=1) * mech.duration, rates.min(axis=0).mean() * mech.duration
            saved[model, tolerance] = share = float(1 - free / totals.min())
            cells = "".join(f"{total:10.0f}" for total in totals)
            print(f"{model:18s} {tolerance:.0e}{cells} {free:13.0f} {share:7.0%}")
    return saved


def rate(sol: mbdae.Solution, t: np.ndarray) -> np.ndarray:
    """Return the solves of a run per second of time, at times t (n,)."""
    steps = np.diff(sol.t)
    at = np.clip(np.searchsorted(sol.t, t, side="right") - 1, 0, len(steps) - 1)
    return sol.stats["solves"] / sol.stats["steps"] / steps[at]


if __name__ == "__main__":
    main()
