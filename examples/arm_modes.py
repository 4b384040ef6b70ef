"""Modes of an unactuated arm on a crank handle, and the damper with the shortest settling time.

In the slowest mode the wheel swings with the arm's weight. The root locus over the damping of the wheel's bearing shows
how much damping increases the decay rate before the mode becomes overdamped.

Run: python examples/arm_modes.py
"""

import numpy as np

import mbdae


def main(values: int = 13) -> dict[str, float]:
    """Print the modes and the best damping; return the decay rates in 1/s initially and at the best damping."""
    found = mbdae.modes(mbdae.load("panda_handle"))
    print(found)
    dampings = np.geomspace(0.05, 50, values)
    locus = mbdae.root_locus("panda_handle", "force.handle damping.damping", dampings)
    decay = -locus.eigenvalues.real.max(axis=1)
    best = int(decay.argmax())
    print(f"a perturbation decays at {decay[0]:.4f} 1/s with {dampings[0]:g} N m s in the bearing")
    print(f"and at {decay[best]:.4f} 1/s with {dampings[best]:.3g} N m s, the best of {values} values")
    return {"shipped": float(decay[0]), "best": float(decay[best]), "damping": float(dampings[best])}


if __name__ == "__main__":
    main()
