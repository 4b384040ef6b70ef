"""A problem of planar.py as an Exudyn model: every body moves freely in the plane, every hinge and pin is a joint."""

from types import ModuleType
from typing import Any

import numpy as np
from exudyn import itemInterface as item
from planar import Equations, Problem


def settings(exu: ModuleType, end: float, step: float) -> Any:
    """Return generalized alpha as the trapezoidal rule on index 2; no files."""
    s = exu.SimulationSettings()
    method = s.timeIntegration
    method.endTime, method.numberOfSteps = end, round(end / step)
    method.generalizedAlpha.spectralRadius = 1.0
    method.generalizedAlpha.useIndex2Constraints = method.generalizedAlpha.useNewmark = True
    method.newton.useModifiedNewton = True
    method.newton.relativeTolerance, method.newton.absoluteTolerance = 1e-10, 1e-12
    s.solution.file.write = False
    return s


def plane(exu: ModuleType, problem: Problem) -> tuple[Any, list[Any]]:
    """Return the assembled system and a sensor for each bar, whose column 3 is the angle of rotation."""
    mbs = exu.SystemContainer().AddSystem()
    ground, bodies, sensors = mbs.AddObject(item.ObjectGround()), {}, []
    eq, theta = Equations(problem), problem.absolute(problem.start())
    for bar, angle in zip(problem.bars, theta, strict=True):
        row, const = eq.point(bar.name, bar.com)
        centre = row @ np.exp(1j * theta) + const
        node = mbs.AddNode(item.NodeRigidBody2D(referenceCoordinates=[centre.real, centre.imag, angle]))
        body = mbs.AddObject(item.ObjectRigidBody2D(mass=bar.mass, inertia=bar.inertia, nodeNumber=node))
        whole = mbs.AddMarker(item.MarkerBodyMass(bodyNumber=body))
        mbs.AddLoad(item.LoadMassProportional(markerNumber=whole, loadVector=[0, -problem.gravity, 0]))
        kind = exu.OutputVariableType.Coordinates
        sensor = item.SensorNode(nodeNumber=node, storeInternal=True, writeToFile=False, outputVariableType=kind)
        sensors.append(mbs.AddSensor(sensor))
        bodies[bar.name] = body, bar.com

    def marker(name: str | None, at: complex) -> Any:
        body, com = bodies[name] if name else (ground, 0j)
        local = [(at - com).real, (at - com).imag, 0.0]
        return mbs.AddMarker(item.MarkerBodyPosition(bodyNumber=body, localPosition=local))

    hinges = [(b.parent, b.hinge, b.name, 0j) for b in problem.bars]
    for a, at_a, b, at_b in (*hinges, *problem.pins):
        mbs.AddObject(item.ObjectJointRevolute2D(markerNumbers=[marker(a, at_a), marker(b, at_b)]))
    if problem.spring:
        name, at, anchor, stiffness, length = problem.spring
        ends = [marker(name, at), marker(None, anchor)]
        spring = item.ObjectConnectorSpringDamper(markerNumbers=ends, stiffness=stiffness, referenceLength=length)
        mbs.AddObject(spring)
    if problem.torque:
        first = mbs.AddMarker(item.MarkerBodyRigid(bodyNumber=bodies[problem.bars[0].name][0]))
        mbs.AddLoad(item.LoadTorqueVector(markerNumber=first, loadVector=[0, 0, problem.torque]))
    mbs.Assemble()
    return mbs, sensors
