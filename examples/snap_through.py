"""Snap-through: a toggle is loaded beyond its limit point, slowly by continuation and in time by a run.

The path of equilibria under a growing load reverses at the limit point, 42.914 N. A run in which the load grows
steadily stays on the path up to there, and then jumps to the far side.

Run: python examples/snap_through.py
"""

import numpy as np

import mbdae

RATE = 0.02  # of the nominal load of 100 N, per second


def main(end: float = 25.0) -> dict[str, float]:
    """Print the snap-through loads of the path and of the run; return both in N, nan if the run ends before."""
    mech = mbdae.load("snap_toggle")
    path = mbdae.load_path(mech, "press", (0, 2))
    limit = path.critical[0]
    print(path)

    springs = [f for f in mech.forces if f.name != "press"]
    growing = mbdae.Wrench(name="press", frame="pin", force=(0, 0, lambda t: -100 * RATE * t))
    brake = mbdae.JointDamping(joint="pin", damping=10.0)
    slow = mbdae.Mechanism(mech.model, mech.closures, [*springs, growing, brake], start=mech.start_values)
    sol = mbdae.solve(slow, (0, end), rtol=1e-8)
    snapped = float(100 * RATE * next(iter(sol.t[sol.q[:, 0] < 0]), np.nan))
    print(f"limit point at {100 * limit.factor:.6f} N; the run passes the middle at {snapped:.3f} N")
    return {"limit": 100 * limit.factor, "run": snapped}


if __name__ == "__main__":
    main()
