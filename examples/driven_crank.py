"""A crank driven at constant speed, and the torque of its motor.

A driver makes the crank follow 0.3 + omega t exactly; its multiplier is the torque, and only its power changes the
energy.

Run: python examples/driven_crank.py
"""

import numpy as np

import mbdae


def main(omega: float = 20.0, end: float = 1.0) -> dict[str, float]:
    """Print torque, power and work, and return them."""
    driver = mbdae.Driver.at_speed("crank", omega, start=0.3, name="motor")
    mech = mbdae.load("slider_crank", drivers=[driver])
    q, v = mech.assemble(v={"crank": omega})
    sol = mbdae.solve(mech, (0, end), q, v, rtol=1e-9, t_eval=np.linspace(0, end, 1001))
    motor = sol.effort("motor")
    work = np.trapezoid(motor.power, motor.t)  # the drift check is more accurate: it integrates along with the run
    drift = mbdae.drift(sol)
    print(f"torque of the motor {motor.effort.min():.4g} to {motor.effort.max():.4g} N m at {omega:g} rad/s")
    print(f"its work in {end:g} s: {work:.6g} J; {drift.work_end:.6g} J integrated with the motion")
    print(drift)
    return {"torque": float(motor.effort.max()), "work": float(work), "integrated": drift.work_end}


if __name__ == "__main__":
    main()
