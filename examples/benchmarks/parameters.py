"""Cost of an optimization whose parameters are written in place, compared with new mechanisms for each motion.

The four-bar moves from a crank angle of 1.2 rad to 0.6 rad in 1 s, from rest to rest, with the least integral of the
squared torque, a natural spline through 9 points. An independent solution, collocation of degree 4 of the equations
in one coordinate by IPOPT, has the optimum 167.0765 of all torques; this spline attains 167.0832.

Run: python examples/benchmarks/parameters.py
"""

import sys
from time import process_time

import numpy as np
from scipy.interpolate import CubicSpline

import mbdae
from mbdae import JointTorque, backend
from mbdae.mechanism.formats.mechanism_file.load import make, read
from mbdae.mechanism.formats.mechanism_file.table_entries import with_entry

MODEL, POINTS, STEPS = "four_bar", 9, 80
TIMES = np.linspace(0.0, 1.0, POINTS)
NAMES = [f"force.motor.torque.points.{k}.1" for k in range(POINTS)]
SETTINGS = {"method": "pherk5", "step": 1.0 / STEPS}


def motor() -> JointTorque:
    """A torque without values."""
    return JointTorque(name="motor", joint="crank", torque={"kind": "table", "points": [(t, 0.0) for t in TIMES]})


def squares() -> np.ndarray:
    """Return W, the integral of u^2 is p^T W p for the values p of the spline at its points."""
    x, w = np.polynomial.legendre.leggauss(4)
    h = TIMES[1] / 2
    t = (TIMES[:-1, None] + h * (1 + x)).ravel()
    B = CubicSpline(TIMES, np.eye(POINTS), bc_type="natural")(t)
    return B.T @ (np.tile(h * w, POINTS - 1)[:, None] * B)


W = squares()


def effort(signals):
    """Return the integral of the squared torque, and its derivatives."""
    p = np.array([signals[name] for name in NAMES])
    return float(p @ W @ p), dict(zip(NAMES, 2 * W @ p, strict=True))


def end(name: str):
    """Return a signal at the end, with its derivative."""
    return lambda signals: (signals[name][-1], {name: np.eye(1, STEPS + 1, STEPS)[0]})


class NewMechanisms:
    """A mechanism made from its tables for each set of values, which shares nothing with those before."""

    def __init__(self) -> None:
        self.spec = read(MODEL, {}, more={"force": [motor()]})

    def make(self, values) -> mbdae.Mechanism:
        """Return the mechanism with these values."""
        file = self.spec.file
        for name, value in values.items():
            file = with_entry(file, name, value, name)
        return make(self.spec._replace(file=file))


def main(iterations: int = 100) -> dict[str, float]:
    """Print and return the cost, the number of motions, CPU seconds of the search, and of one motion newly made."""
    print(f"{POINTS} parameters; {backend.status()}; {backend.machine_description()}")
    constraints = {"angle": (end("q.crank"), 0.6, 0.6), "rest": (end("v.crank"), 0.0, 0.0)}
    mech, spent = mbdae.load(MODEL, forces=[motor()]), []
    for _ in range(2 if iterations > 1 else 1):  # the first one also imports
        started = process_time()
        found = mbdae.optimize(mech, effort, NAMES, constraints=constraints, t_span=(0.0, 1.0),
                               iterations=iterations, **SETTINGS)  # fmt: skip
        spent.append(process_time() - started)
    factory, started = NewMechanisms(), process_time()
    sol = mbdae.solve(factory.make(found.values), (0.0, 1.0), **SETTINGS)
    for function in (effort, *(pair[0] for pair in constraints.values())):
        cost = function if function is not effort else end("q.rocker")  # the effort has no signals of the run
        mbdae.gradient(sol, cost, found.values, model=factory)
    made = process_time() - started
    motions = len(found.history)
    print(f"cost {found.cost:.6f} after {motions} motions, bound {found.bound} times")
    print(f"{spent[-1]:.2f} s of CPU, {1e3 * spent[-1] / motions:.1f} ms a motion; newly made {1e3 * made:.0f} ms")
    print(f"newly made: {made * motions / spent[-1]:.0f} times as long")
    return {"cost": found.cost, "motions": motions, "bound": found.bound, "seconds": spent[-1], "made": made}


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
