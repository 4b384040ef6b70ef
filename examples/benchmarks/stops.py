"""A pendulum on a stop, compared with programs that make stops soft: error of its angle, penetration, and time.

A point of 1 kg on a light rod of 1 m falls from 1.2 rad on a stop at 0.3 rad and rebounds with 0.7 of its speed.
Observed after 2.2 s and three impacts; the exact angle follows from elliptic integrals, in 30 digits. MuJoCo's limit is
a soft constraint, Exudyn's a stiff spring with a damper, both with the damping that gives a restitution of 0.7 in one
impact of a mass (xi = -log e/sqrt(pi^2 + log^2 e)), and as stiff as the step allows.

Run: python examples/benchmarks/stops.py [--brief]
"""

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import NamedTuple

import mpmath
import numpy as np
from common import brief, machine, programs, table

import mbdae

STOP, TOP, E, END, G = 0.3, 1.2, 0.7, 2.2, 9.81
XI = float(-np.log(E) / np.hypot(np.pi, np.log(E)))
PERIODS = 20  # steps in a half-period of the stop's spring
MODEL = """<mujoco><compiler angle="radian"/><option timestep="{h}" gravity="0 0 -9.81" integrator="RK4"/>
<worldbody><body><joint name="a" type="hinge" axis="0 1 0" limited="true" range="{stop} 3" solreflimit="-{k} -{d}"
solimplimit="0.9999 0.9999 0.001"/><inertial pos="0 0 -1" mass="1" diaginertia="1e-9 1e-9 1e-9"/></body></worldbody>
</mujoco>"""


class Run(NamedTuple):
    """The angle at the end, the penetration of the stop, in rad, and the computing time in s."""

    end: float
    beyond: float
    seconds: float


def exact() -> float:
    """The angle at the end."""
    mpmath.mp.dps = 30
    s, top, e, g = mpmath.mpf("0.3"), mpmath.mpf("1.2"), mpmath.mpf("0.7"), mpmath.mpf("9.81")

    def fall(top: object) -> object:
        m = mpmath.sin(top / 2) ** 2
        angle = mpmath.asin(mpmath.sin(s / 2) / mpmath.sin(top / 2))
        return (mpmath.ellipk(m) - mpmath.ellipf(angle, m)) / mpmath.sqrt(g)

    t = fall(top)
    while True:
        top = mpmath.acos(mpmath.cos(s) - e**2 * (mpmath.cos(s) - mpmath.cos(top)))
        half = fall(top)
        if t + 2 * half > mpmath.mpf("2.2"):
            break
        t += 2 * half
    m = mpmath.sin(top / 2) ** 2  # sin(phi/2) = sin(top/2) cd(sqrt(g) (t - t_top))
    u = mpmath.sqrt(g) * (mpmath.mpf("2.2") - t - half)
    return float(2 * mpmath.asin(mpmath.sin(top / 2) * mpmath.ellipfun("cd", u, m=m)))


def ours(rtol: float) -> Run:
    """The exact stop of mbdae."""
    mech, began = mbdae.load("pendulum_on_stop"), perf_counter()
    sol = mbdae.solve(mech, (0, END), rtol=rtol)
    return Run(float(sol.q[-1, 0]), max(0.0, STOP - float(sol.q.min())), perf_counter() - began)


def spring(h: float) -> tuple[float, float]:
    """Stiffness and damping of a soft stop of 1 kg m^2 for a step of h seconds."""
    w = np.pi / (PERIODS * h)
    return w**2, 2 * XI * w


def mujoco(h: float) -> Run:
    """MuJoCo with a step of h seconds."""
    import mujoco as mj

    k, d = spring(h)
    model = mj.MjModel.from_xml_string(MODEL.format(h=h, stop=STOP, k=k, d=d))
    data = mj.MjData(model)
    data.qpos[0], least, began = TOP, TOP, perf_counter()
    for _ in range(round(END / h)):
        mj.mj_step(model, data)
        least = min(least, data.qpos[0])
    return Run(float(data.qpos[0]), STOP - float(least), perf_counter() - began)


def exudyn(h: float) -> Run:
    """Exudyn with a step of h seconds."""
    import exudyn as exu
    import exudyn.itemInterface as item

    (k, d), system = spring(h), exu.SystemContainer()
    mbs = system.AddSystem()
    angle = mbs.AddNode(item.Node1D(referenceCoordinates=[0], initialCoordinates=[TOP]))
    ground = mbs.AddNode(item.NodePointGround())
    mbs.AddObject(item.Mass1D(mass=1.0, nodeNumber=angle))
    markers = [mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=n, coordinate=0)) for n in (ground, angle)]

    def force(mbs: object, t: float, number: int, x: float, v: float, *rest: float) -> float:
        return G * np.sin(x) + (k * (x - STOP) + d * v if x < STOP else 0.0)

    mbs.AddObject(item.CoordinateSpringDamper(markerNumbers=markers, springForceUserFunction=force))
    kind = exu.OutputVariableType.Coordinates
    sensor = mbs.AddSensor(item.SensorNode(nodeNumber=angle, outputVariableType=kind, storeInternal=True))
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = round(END / h), END
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = h
    began = perf_counter()
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.RK44)
    taken = perf_counter() - began
    x = np.array(mbs.GetSensorStoredData(sensor))[:, 1]
    return Run(float(x[-1]), STOP - float(x.min()), taken)


def solvers(short: bool) -> dict[str, Callable[[], Run]]:
    """Installed programs, by name and setting."""
    tolerances, steps = ((1e-6,), (1e-3,)) if short else ((1e-4, 1e-6, 1e-8, 1e-10, 1e-12), (1e-3, 1e-4, 1e-5))
    return programs(ours, tolerances, steps, mujoco=mujoco, exudyn=exudyn)


def main(argv: Sequence[str] | None = None) -> dict[str, Run]:
    """Print the table and return the runs."""
    found, angle = {name: run() for name, run in solvers(brief(argv, __doc__)).items()}, exact()
    rows = [
        [name, f"{abs(r.end - angle):.1e}", f"{r.beyond:.1e}", f"{1e3 * r.seconds:.3g}"]
        for name, r in sorted(found.items())
    ]
    print(machine("mujoco", "exudyn") + "\n")
    print(table(["pendulum on a stop, 2.2 s", "error of the angle, rad", "beyond the stop, rad", "ms"], rows))
    return found


if __name__ == "__main__":
    main()
