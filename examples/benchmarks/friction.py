"""A block on a spring with dry friction, compared with programs that regularize friction: final position, and time.

m x'' + k x = -F sign(x'), m 1 kg, k 40 N/m, F 1.3 N, from x = 0.5 m at rest: ten half-periods, each 2 F/k shorter, then
it sticks at -0.02 m from t = 3.974 s on. Observed after 14 s; "creep" is the motion in the last 5 s. MuJoCo's friction
is a soft constraint, Exudyn's a bristle model with a stiffness; both with the best settings of those in this file.

Run: python examples/benchmarks/friction.py [--brief]
"""

import warnings
from collections.abc import Callable, Sequence
from time import perf_counter
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from common import brief, machine, programs, table

import mbdae

M, K, F, X, END, LATE = 1.0, 40.0, 1.3, 0.5, 14.0, 9.0
STOPS = -0.02
MODEL = """<mujoco><option timestep="{h}" gravity="0 0 0" integrator="implicitfast" iterations="100" tolerance="1e-14"/>
<worldbody><body><joint name="x" type="slide" axis="1 0 0" stiffness="{k}" frictionloss="{f}" solreffriction="{ref} 1"
solimpfriction="0.9999 0.9999 0.001"/><inertial pos="0 0 0" mass="{m}" diaginertia="1e-3 1e-3 1e-3"/></body></worldbody>
</mujoco>"""


class Run(NamedTuple):
    """The position of the block at 9 and at 14 s, and the computing time in s."""

    late: float
    end: float
    seconds: float


def ours(rtol: float) -> Run:
    """The exact friction of mbdae."""
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    rail = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    model.appendBodyToJoint(rail, pin.Inertia(M, np.zeros(3), 1e-3 * np.eye(3)), pin.SE3.Identity())
    spring, friction = mbdae.JointSpring(joint="x", stiffness=K), mbdae.JointFriction(joint="x", friction=F, exact=True)
    mech, began = mbdae.Mechanism(model, forces=[spring, friction]), perf_counter()
    sol = mbdae.solve(mech, (0, END), np.array([X]), np.zeros(1), rtol=rtol)
    taken = perf_counter() - began
    return Run(float(sol(LATE)[0][0]), float(sol.q[-1, 0]), taken)


def mujoco(h: float) -> Run:
    """MuJoCo with a step of h seconds, its friction as stiff as the step allows."""
    import mujoco as mj

    model = mj.MjModel.from_xml_string(MODEL.format(h=h, k=K, f=F, m=M, ref=2 * h))
    data = mj.MjData(model)
    data.qpos[0], late, began = X, np.nan, perf_counter()
    for _ in range(round(END / h)):
        mj.mj_step(model, data)
        if np.isnan(late) and data.time > LATE - h / 2:
            late = data.qpos[0]
    return Run(float(late), float(data.qpos[0]), perf_counter() - began)


def exudyn(h: float) -> Run:
    """Exudyn with a step of h seconds, bristles of 1e6 N/m."""
    with warnings.catch_warnings():  # numpy conversions inside the library
        warnings.simplefilter("ignore")
        return _exudyn(h)


def _exudyn(h: float) -> Run:
    import exudyn as exu
    import exudyn.itemInterface as item

    system = exu.SystemContainer()
    mbs = system.AddSystem()
    mass = mbs.AddNode(item.Node1D(referenceCoordinates=[0], initialCoordinates=[X]))
    ground = mbs.AddNode(item.NodePointGround())
    mbs.AddObject(item.Mass1D(physicsMass=M, nodeNumber=mass))
    markers = [mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=n, coordinate=0)) for n in (ground, mass)]
    bristles = mbs.AddNode(item.NodeGenericData(initialCoordinates=[1, 0, 0], numberOfDataCoordinates=3))
    mbs.AddObject(
        item.CoordinateSpringDamperExt(
            markerNumbers=markers, nodeNumber=bristles, stiffness=K, fDynamicFriction=F, stickingStiffness=1e6,
            stickingDamping=2e3,
        )
    )  # fmt: skip
    sensor = mbs.AddSensor(
        item.SensorNode(nodeNumber=mass, outputVariableType=exu.OutputVariableType.Coordinates, storeInternal=True)
    )
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = round(END / h), END
    settings.timeIntegration.verboseMode = 0
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = 0.1
    began = perf_counter()
    mbs.SolveDynamic(settings)
    taken = perf_counter() - began
    t, x = np.array(mbs.GetSensorStoredData(sensor)).T[:2]
    return Run(float(np.interp(LATE, t, x)), float(x[-1]), taken)


def solvers(short: bool) -> dict[str, Callable[[], Run]]:
    """Installed programs, by name and setting."""
    tolerances, steps = ((1e-6,), (1e-2,)) if short else ((1e-4, 1e-6, 1e-8, 1e-10), (1e-2, 1e-3, 1e-4, 1e-5))
    return programs(ours, tolerances, steps, mujoco=mujoco, exudyn=exudyn)


def main(argv: Sequence[str] | None = None) -> dict[str, Run]:
    """Print the table and return the runs."""
    found = {name: run() for name, run in solvers(brief(argv, __doc__)).items()}
    rows = [
        [name, f"{abs(r.end - STOPS):.1e}", f"{abs(r.end - r.late):.1e}", f"{1e3 * r.seconds:.3g}"]
        for name, r in sorted(found.items())
    ]
    print(machine("mujoco", "exudyn") + "\n")
    print(table(["block with friction, 14 s", "error of the final position, m", "creep in 5 s, m", "ms"], rows))
    return found


if __name__ == "__main__":
    main()
