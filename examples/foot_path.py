"""Lengths of Theo Jansen's leg for a flatter path of the foot on the ground.

In stance, the foot should stay at one height, with its original step length and lift. Poses over one turn of the crank
are differentiated by the lengths of the bars; each may change by a tenth.

Run: python examples/foot_path.py
"""

from pathlib import Path

import numpy as np

import mbdae

MODEL, FOOT = "jansen_walker?legs=1", "position.foot_0"
RODS = {"upper_rod_tip": 0.5, "lower_rod_tip": 0.619}  # m
ARMS = {"thigh_top": 0.415, "arm_tip": 0.393, "hanger_tip": 0.394, "knee": 0.367}
LENGTHS = {f"frame.{name}_0.xyz.0": length for name, length in (RODS | ARMS).items()}
SHARE = 0.1
STANDING = 0.45  # of a turn, in which the foot is on the ground


def main(points: int = 73, plot: str | Path | None = None) -> dict[str, float]:
    """Print the lengths and the height variation of the foot; return the variation."""
    shipped = mbdae.kinematics(mbdae.load(MODEL), "crank", points=points).signals()
    x, z = shipped[f"{FOOT}.x"], shipped[f"{FOOT}.z"]
    stance = np.isin(np.arange(points), np.argsort(z)[: int(STANDING * points)])  # always the same poses
    ends = np.flatnonzero(stance)[[np.argmin(x[stance]), np.argmax(x[stance])]]
    top = int(np.argmax(z))

    def bumps(signals):
        """Half the variance of the height of the foot in stance in mm^2, and its gradient."""
        height = 1e3 * signals[f"{FOOT}.z"]
        left = np.where(stance, height - height[stance].mean(), 0.0)
        return left @ left / (2 * stance.sum()), {f"{FOOT}.z": 1e3 * left / stance.sum()}

    def stride(signals):
        derivative = np.zeros(points)
        derivative[ends] = -1, 1
        return derivative @ signals[f"{FOOT}.x"], {f"{FOOT}.x": derivative}

    def lift(signals):
        derivative = np.where(stance, -1 / stance.sum(), 0.0)
        derivative[top] = 1
        return derivative @ signals[f"{FOOT}.z"], {f"{FOOT}.z": derivative}

    was = {name: function(shipped)[0] for name, function in (("stride", stride), ("lift", lift))}
    found = mbdae.optimize(
        MODEL,
        bumps,
        LENGTHS,
        bounds={name: ((1 - SHARE) * length, (1 + SHARE) * length) for name, length in LENGTHS.items()},
        constraints={"stride": (stride, was["stride"], None), "lift": (lift, was["lift"], None)},
        drive="crank",
        points=points,
        tolerance=1e-6,
    )
    print(found)
    before, after = ((2 * c) ** 0.5 for c in (found.start.cost, found.cost))
    print(f"the standing foot leaves its mean height by {before:.3g} mm before, {after:.3g} mm after (RMS)")
    if plot:
        draw({"shipped": shipped, "optimized": found.motion.signals()}, stance, plot)
    return {"before": before, "after": after, **{f"{n} kept": found.constraints[n] / was[n] for n in was}}


def draw(paths, stance, path: str | Path) -> None:
    """Draw paths of the foot."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 3), layout="constrained")
    axes = figure.subplots()
    for name, signals in paths.items():
        x, z = 1e3 * signals[f"{FOOT}.x"], 1e3 * signals[f"{FOOT}.z"]
        (line,) = axes.plot(x, z, label=name, linewidth=1)
        axes.plot(x[stance], z[stance], ".", color=line.get_color(), markersize=4)
    axes.set(aspect="equal", xlabel="x (mm)", ylabel="z (mm)")
    axes.legend()
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(plot="foot_path.png")
