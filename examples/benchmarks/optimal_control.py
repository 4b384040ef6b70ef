"""Optimal control of a four-bar: CPU time, motions, and distance of the least effort from collocation.

Run: python examples/benchmarks/optimal_control.py [POINTS ...]
"""

import sys
from time import process_time

import mbdae
from mbdae import backend

COLLOCATION = 167.076509  # of the reduced equation of motion, 40 intervals of degree 4, by CasADi and IPOPT


def main(points: tuple[int, ...] = (9, 17, 33, 65)) -> dict[int, tuple[float, float]]:
    """Print and return CPU seconds, and the relative excess of the cost, by number of points."""
    bars = mbdae.load("four_bar")
    torque = mbdae.JointTorque(joint="crank", torque=mbdae.Input(name="motor", hold="first"))
    mech = mbdae.Mechanism(bars.model, bars.closures, [torque], start=bars.start_values)
    print(f"crank 1.2 to 0.6 rad, rest to rest in 1 s; {backend.status()}; {backend.machine_description()}")
    print(f"{'points':>6s} {'motions':>8s} {'CPU s':>8s} {'cost':>12s} {'excess':>8s}")
    found = {}
    for n in points:
        started = process_time()
        best = mbdae.optimal_control(
            mech, {"motor": 1.0}, ["motor"], end={"q.crank": 0.6, "v.crank": 0.0}, duration=1.0, points=n
        )
        found[n] = process_time() - started, best.cost / COLLOCATION - 1
        print(f"{n:6d} {best.motions:8d} {found[n][0]:8.2f} {best.cost:12.6f} {found[n][1]:8.1e}")
    return found


if __name__ == "__main__":
    main(tuple(map(int, sys.argv[1:])) or (9, 17, 33, 65))
