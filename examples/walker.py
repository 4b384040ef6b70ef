"""The gait of the simplest walker over the incline: its angle, its multipliers, and where it begins to limp.

Run: python examples/walker.py
"""

from pathlib import Path

import numpy as np

import mbdae

FOOT_CONTACT = "heel strike"


def main(first: float = 0.001, last: float = 0.017, plot: str | Path | None = None) -> dict[str, float]:
    """Print the branch of gaits; return the incline at which the period doubles, and the angle there, nan if none."""
    found = mbdae.periodic_branch("simplest_walker", "incline", first, last, rtol=1e-9)
    print(found)
    if plot:
        draw(found, plot)
    doubling = next((b for b in found.bifurcations if b.kind == "doubling"), None)
    if doubling is None:
        return {"incline": np.nan, "angle": np.nan}
    return {"incline": doubling.value, "angle": doubling.motion.after[FOOT_CONTACT]["q.stance"]}


def draw(found, path: str | Path) -> None:
    """Draw one step, the angle at the strike and the multipliers over the incline."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 2.4), layout="constrained")
    walk, angle, multipliers = figure.subplots(1, 3)
    step = found.points[len(found.points) // 2].motion.run
    start = step.resets[0][0]
    order = np.r_[start : len(step.t), 1:start]
    for i in order[:: max(1, len(order) // 9)]:
        stance, swing = step.q[i]
        hip = np.array([-np.sin(stance), np.cos(stance)])
        foot = hip + [np.sin(stance - swing), -np.cos(stance - swing)]
        walk.plot([0, hip[0]], [0, hip[1]], color="#0072B2", linewidth=0.9)
        walk.plot([hip[0], foot[0]], [hip[1], foot[1]], color="#D55E00", linewidth=0.9)
    walk.set(aspect="equal", title="one step", xticks=[], yticks=[])
    for bifurcation in found.bifurcations:
        for axes in (angle, multipliers):
            axes.axvline(bifurcation.value, color="0.5", linestyle=":", linewidth=0.9)
    angle.plot(found.values, [p.motion.after[FOOT_CONTACT]["q.stance"] for p in found.points], color="#0072B2")
    angle.set(title="angle after the strike (rad)", xlabel="incline (rad)")
    sizes = np.sort(np.abs(found.multipliers), axis=1)
    multipliers.plot(found.values, sizes[:, 1:], color="#0072B2")
    multipliers.axhline(1, color="black", linewidth=0.7)
    multipliers.set(title="magnitude of multipliers", xlabel="incline (rad)")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main(plot="walker.png")
