"""Events: times at which a signal crosses a level, or a function of the state is zero.

A four-bar swings from rest. The turning points of its crank are zeros of its speed, and the run ends where the end of
the coupler falls below a level.

Run: python examples/events.py
"""

import numpy as np
import pinocchio as pin

import mbdae

LEVEL = 1.0  # m


def main(end: float = 10.0) -> mbdae.Solution:
    """Print the events and return the solution, which ends at the terminal one."""
    mech = mbdae.load("four_bar")
    model, data = mech.model, mech.model.createData()
    tip = model.getFrameId("coupler_tip")

    def height(t: float, q: np.ndarray, v: np.ndarray) -> float:
        pin.framesForwardKinematics(model, data, q)
        return float(data.oMf[tip].translation[2]) - LEVEL

    reversals = "v.crank"  # a signal alone means its zeros
    low = mbdae.Event(height, terminal=True, direction=-1)
    sol = mbdae.solve(mech, (0, end), rtol=1e-10, events=[reversals, low])
    (turns, _), (lows, _) = sol.events  # times (n,) and states (n, ny)
    print(f"{sol.status}: {sol.message}")
    print("the crank turns at", ", ".join(f"{t:.6f}" for t in turns), "s")
    print(f"the coupler's end falls through {LEVEL:g} m at", ", ".join(f"{t:.6f}" for t in lows), "s")
    return sol


if __name__ == "__main__":
    main()
