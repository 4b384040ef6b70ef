"""The torque that moves a four-bar from rest to rest with least effort, and with a weaker motor in least time.

The closed loop is part of each run, so that the search has the torque alone as unknown. The least integral of the
squared torque was found by collocation of the reduced equation of motion in the crank angle, too (CasADi, IPOPT, 40
intervals of degree 4).

Run: python examples/optimal_control.py
"""

from pathlib import Path

import mbdae

CRANK, SPEED = "q.crank", "v.crank"
FROM, TO, DURATION = 1.2, 0.6, 1.0  # rad, rad, s
COLLOCATION = 167.076509  # N^2 m^2 s
STRONGEST = 40.0  # N m


def driven_four_bar(hold: str) -> mbdae.Mechanism:
    """The four-bar at rest, with a motor torque as input."""
    mech = mbdae.load("four_bar")
    motor = mbdae.Input(name="motor", unit="N m", hold=hold)
    torque = mbdae.JointTorque(joint="crank", torque=motor)
    return mbdae.Mechanism(mech.model, mech.closures, [torque], start=mech.start_values, title="Driven four-bar")


def main(points: int = 33, fast_points: int = 21, plot: str | Path | None = None) -> dict[str, float]:
    """Print both optima, draw the first one, and return costs and durations."""
    end = {CRANK: TO, SPEED: 0.0}
    gentle = mbdae.optimal_control(
        driven_four_bar("first"), {"motor": 1.0}, ["motor"], end=end, duration=DURATION, points=points
    )
    print(gentle)
    print(f"least effort {gentle.cost:.7g} N^2 m^2 s, by collocation {COLLOCATION:.9g}")
    limits = {"motor": (-STRONGEST, STRONGEST)}
    fast = mbdae.optimal_control(
        driven_four_bar("zero"), {"motor": 0.0}, limits, end=end, duration=(0.2, 1.0), time_weight=1.0,
        guess={"motor": 10.0}, points=fast_points,
    )  # fmt: skip
    print(fast)
    if plot:
        gentle.plot(plot)
    return {"effort": gentle.cost, "excess": gentle.cost / COLLOCATION - 1, "duration": fast.duration}


if __name__ == "__main__":
    main()
