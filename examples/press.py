"""The torque of a press over its crank angle, and the motor that it needs.

The block of a slider-crank presses with 800 N over the last 20 mm of its stroke. Inverse dynamics of one revolution at
constant speed gives peak and RMS of the torque; from a list of motors and gears, the first with sufficient torques at
the speed is chosen.

Run: python examples/press.py
"""

from pathlib import Path

import numpy as np

import mbdae

MOTORS = {"A": (1.3, 4.0, 300.0), "B": (2.4, 7.2, 300.0), "C": (4.8, 14.0, 250.0)}  # rated, peak N m; rad/s
GEARS = (1, 3, 5, 10, 20)
OUTER, FORCE, DEPTH = 0.45, 800.0, 0.02  # position of the block at its outer dead point in m; N, m


def pressing(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Generalized forces (3,): the workpiece resists while the block advances into it."""
    depth = np.clip((q[2] - (OUTER - DEPTH)) / (0.2 * DEPTH), 0, 1)
    return np.array([0, 0, -FORCE * depth * np.clip(v[2] / 0.1, 0, 1)])


def main(speed: float = 6.0, plot: str | Path | None = None) -> dict[str, float | str]:
    """Print torque, power and the motor, and return them."""
    mech = mbdae.load("slider_crank", forces=[pressing])
    curve = mbdae.kinematics(mech, "crank", points=721)
    found = mbdae.inverse_dynamics(mech, curve, speed=speed)
    print(found)
    demand = found.demands[0]
    suitable = (
        (name, gear)
        for name, (rated, peak, most) in MOTORS.items()
        for gear in GEARS
        if demand.rms <= gear * rated and demand.peak <= gear * peak and abs(speed) * gear <= most
    )
    motor, gear = next(suitable, ("", 0))
    if not motor:
        raise SystemExit(f"no motor of the list drives the press at {speed:g} rad/s")
    print(f"motor {motor} with a gear of {gear}: {demand.peak / gear:.3g} N m at {speed * gear:g} rad/s")
    if plot:
        from mbdae.studies import figures
        from mbdae.studies.inverse.figure import demands

        figures.save(demands(found), plot)
    return {"peak": demand.peak, "rms": demand.rms, "energy": demand.energy, "motor": motor, "gear": gear}


if __name__ == "__main__":
    main(plot="press.png")
