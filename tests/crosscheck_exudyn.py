"""Machines as Exudyn models: the same parameters, with Exudyn's bodies and joints.

Its generalized-alpha method for index 2 has order 2; after extrapolation from two step sizes, errors are below 1e-8.
"""

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (
    CoordinateConstraint,
    GenericJoint,
    LinearSpringDamper,
    LoadMassProportional,
    MarkerBodyMass,
    MarkerBodyPosition,
    MarkerBodyRigid,
    MarkerKinematicTreeRigid,
    MarkerNodeCoordinate,
    NodeGenericODE2,
    NodePointGround,
    NodeRigidBody2D,
    ObjectGround,
    ObjectJointRevolute2D,
    ObjectKinematicTree,
    ObjectRigidBody2D,
    SensorBody,
    SensorNode,
    SensorObject,
    SphericalJoint,
)
from exudyn.rigidBodyUtilities import RigidBodyInertia

KINDS = exu.OutputVariableType


def extrapolated(machine, start, t):
    """Return values (len(t), n) of a machine at times t from 0 on; steps of t/200 and t/400."""
    coarse, fine = (machine(start, t, n) for n in (200, 400))
    return (4 * fine - coarse) / 3


def run(mbs, sensors, t, n):
    """Solve with n steps between times and return the sensor values, side by side."""
    mbs.Assemble()
    s = exu.SimulationSettings()
    method = s.timeIntegration
    method.endTime, method.numberOfSteps = t[-1], n * (len(t) - 1)
    method.generalizedAlpha.spectralRadius = 1.0  # the trapezoidal rule
    method.generalizedAlpha.useIndex2Constraints = method.generalizedAlpha.useNewmark = True
    method.newton.relativeTolerance, method.newton.absoluteTolerance = 1e-10, 1e-12
    s.solution.file.write, s.solution.sensors.writePeriod = False, t[1]
    mbs.SolveDynamic(s)
    stored = [mbs.GetSensorStoredData(i) for i in sensors]
    np.testing.assert_allclose(stored[0][:, 0], t, atol=1e-12)
    return np.hstack([x[:, 1:] for x in stored])


class Plane:
    """Bodies in a vertical plane, gravity along -y; angles anticlockwise."""

    def __init__(self):
        self.mbs = exu.SystemContainer().AddSystem()
        self.ground, self.sensors, self.nodes = self.mbs.AddObject(ObjectGround()), [], []

    def body(self, mass, inertia, centre, angle, speed=(0.0, 0.0, 0.0)):
        mbs = self.mbs
        node = mbs.AddNode(NodeRigidBody2D(referenceCoordinates=[*centre, angle], initialVelocities=list(speed)))
        body = mbs.AddObject(ObjectRigidBody2D(mass=mass, inertia=inertia, nodeNumber=node))
        marker = mbs.AddMarker(MarkerBodyMass(bodyNumber=body))
        mbs.AddLoad(LoadMassProportional(markerNumber=marker, loadVector=[0, -9.81, 0]))
        sensor = SensorNode(
            nodeNumber=node, storeInternal=True, writeToFile=False, outputVariableType=KINDS.Coordinates
        )
        self.sensors.append(mbs.AddSensor(sensor))
        self.nodes.append(node)
        return body

    def pin(self, a, at_a, b, at_b):
        ends = [MarkerBodyPosition(bodyNumber=x, localPosition=[*p, 0.0]) for x, p in ((a, at_a), (b, at_b))]
        self.mbs.AddObject(ObjectJointRevolute2D(markerNumbers=[self.mbs.AddMarker(e) for e in ends]))

    def hold(self, node, coordinate):
        fixed = self.mbs.AddNode(NodePointGround())
        ends = [MarkerNodeCoordinate(nodeNumber=n, coordinate=c) for n, c in ((fixed, 0), (node, coordinate))]
        self.mbs.AddObject(CoordinateConstraint(markerNumbers=[self.mbs.AddMarker(e) for e in ends]))

    def run(self, t, n):
        """Return displacements x, y, angle of each body, (len(t), bodies, 3)."""
        return run(self.mbs, self.sensors, t, n).reshape(len(t), -1, 3)


def along(angle, length):
    return length * np.array([np.cos(angle), np.sin(angle)])


def four_bar(start, t, n):
    crank, coupler, rocker = start[0], start[0] + start[1], start[2]
    plane, origin, pivot = Plane(), np.zeros(2), np.array([2.0, 0.0])
    a = plane.body(1.0, 1 / 12, along(crank, 0.5), crank)
    b = plane.body(2.0, 8 / 12, along(crank, 1) + along(coupler, 1), coupler)
    c = plane.body(1.5, 1.5**3 / 12, pivot + along(rocker, 0.75), rocker)
    plane.pin(plane.ground, origin, a, (-0.5, 0))
    plane.pin(a, (0.5, 0), b, (-1, 0))
    plane.pin(b, (1, 0), c, (0.75, 0))
    plane.pin(plane.ground, pivot, c, (-0.75, 0))
    turn = plane.run(t, n)[:, :, 2]
    return start + np.stack([turn[:, 0], turn[:, 1] - turn[:, 0], turn[:, 2]], axis=1)


def four_bar_tree(q, v, h, n, rho):
    """Steps of Exudyn's generalized alpha, index 3, on the angles of crank, coupler (relative) and rocker.

    Exudyn starts with a_0 = v_0', by a difference quotient of G v. It supports velocity constraints only with Newmark's
    method.

    Returns:
        angles, speeds and accelerations (n + 1, 3), and the magnitude of the force in the pin (n + 1,).
    """
    mbs, lengths = exu.SystemContainer().AddSystem(), (1.0, 2.0, 1.5)  # the masses, too
    node = mbs.AddNode(
        NodeGenericODE2(
            numberOfODE2Coordinates=3,
            referenceCoordinates=[0.0] * 3,
            initialCoordinates=[*q],
            initialCoordinates_t=[*v],
        )
    )
    turns, offsets, inertias, centres = exu.Matrix3DList(), exu.Vector3DList(), exu.Matrix3DList(), exu.Vector3DList()
    for length, hinge in zip(lengths, (0.0, 1.0, 2.0), strict=True):
        turns.Append(np.eye(3))
        offsets.Append(np.array([hinge, 0, 0]))
        inertias.Append(np.diag([0, 1, 1]) * length**3 / 12)
        centres.Append(np.array([length / 2, 0, 0]))
    tree = ObjectKinematicTree(
        nodeNumber=node,
        gravity=[0, -9.81, 0],
        jointTypes=[exu.JointType.RevoluteZ] * 3,
        linkParents=[-1, 0, -1],
        jointTransformations=turns,
        jointOffsets=offsets,
        linkInertiasCOM=inertias,
        linkCOMs=centres,
        linkMasses=lengths,
    )
    tree = mbs.AddObject(tree)
    tips = [MarkerKinematicTreeRigid(objectNumber=tree, linkNumber=i, localPosition=[lengths[i], 0, 0]) for i in (1, 2)]
    pin = mbs.AddObject(SphericalJoint(markerNumbers=[mbs.AddMarker(x) for x in tips], constrainedAxes=[1, 1, 0]))
    common = {"storeInternal": True, "writeToFile": False}
    sensors = [
        *(
            SensorNode(nodeNumber=node, outputVariableType=kind, **common)
            for kind in (KINDS.Coordinates, KINDS.Coordinates_t, KINDS.Coordinates_tt)
        ),
        SensorObject(objectNumber=pin, outputVariableType=KINDS.Force, **common),
    ]
    sensors = [mbs.AddSensor(x) for x in sensors]
    mbs.Assemble()
    s = exu.SimulationSettings()
    method = s.timeIntegration
    method.endTime, method.numberOfSteps = n * h, n
    method.generalizedAlpha.spectralRadius = rho
    method.newton.useModifiedNewton = False
    method.newton.relativeTolerance = method.newton.absoluteTolerance = 1e-13
    s.solution.file.write, s.solution.sensors.writePeriod = False, h
    mbs.SolveDynamic(s)
    *motion, force = (mbs.GetSensorStoredData(i)[:, 1:] for i in sensors)
    return *motion, np.linalg.norm(force, axis=1)


def slider_crank(start, t, n):
    crank, rod, slider = start[0], start[0] + start[1], start[2]
    speed = 6.0
    rod_rate = -0.1 * np.cos(crank) * speed / (0.35 * np.cos(rod))  # of the rod: its end stays on the rail
    at_pin = speed * along(crank + np.pi / 2, 0.1)
    slider_speed = at_pin[0] - 0.35 * np.sin(rod) * rod_rate
    plane = Plane()
    a = plane.body(1.5, 0.012675, (0, 0), crank, (0, 0, speed))
    rod_centre = along(crank, 0.1) + along(rod, 0.175), at_pin + rod_rate * along(rod + np.pi / 2, 0.175)
    b = plane.body(0.4, 0.4 * (0.35**2 + 0.03**2) / 12, rod_centre[0], rod, (*rod_centre[1], rod_rate))
    c = plane.body(0.6, 0.00065, (slider, 0), 0.0, (slider_speed, 0, 0))
    plane.pin(plane.ground, (0, 0), a, (0, 0))
    plane.pin(a, (0.1, 0), b, (-0.175, 0))
    plane.pin(b, (0.175, 0), c, (0, 0))
    plane.hold(plane.nodes[2], 1)
    plane.hold(plane.nodes[2], 2)
    displacements = plane.run(t, n)
    turn = displacements[:, :, 2]
    return start + np.stack([turn[:, 0], turn[:, 1] - turn[:, 0], displacements[:, 2, 0]], axis=1)


def double_pendulum(start, t, n):
    upper, lower = np.cumsum(start) + np.pi / 2  # from the horizontal
    plane = Plane()
    a = plane.body(0.2, 0.000177083, along(upper, 0.05), upper)
    b = plane.body(0.3, 0.001015625, along(upper, 0.1) + along(lower, 0.1), lower)
    plane.pin(plane.ground, (0, 0), a, (-0.05, 0))
    plane.pin(a, (0.05, 0), b, (-0.1, 0))
    turn = plane.run(t, n)[:, :, 2]
    return start + np.stack([turn[:, 0], turn[:, 1] - turn[:, 0]], axis=1)


def stewart_platform(start, t, n):
    """Return the platform's position and the entries of its rotation matrix, (len(t), 12).

    Args:
        start: poses and velocities of all bodies in the world by name, from the forward kinematics.
        t: times from 0 on.
        n: steps between them.
    """
    mbs = exu.SystemContainer().AddSystem()
    ground = mbs.AddObject(ObjectGround())

    def body(name, mass, com, inertia):
        place, twist = start.bodies[name]
        com, R = np.array([0, 0, com]), np.ascontiguousarray(place.rotation)
        about = RigidBodyInertia(mass=mass, inertiaTensor=np.diag(inertia)).Translated(com)
        velocity = {"initialVelocity": R @ twist.linear, "initialAngularVelocity": R @ twist.angular}
        where = {"referencePosition": place.translation, "referenceRotationMatrix": R}
        return mbs.CreateRigidBody(inertia=about, gravity=[0, 0, -9.81], **where, **velocity)

    def marker(body, position, rotation=None):
        rotation = np.eye(3) if rotation is None else np.ascontiguousarray(rotation)
        there = exu.HT(rotation=rotation, translation=position)
        return mbs.AddMarker(MarkerBodyRigid(bodyNumber=body, localHT=there))

    platform = body("platform", 20.0, 0.0, [0.5, 0.5, 0.9])
    for i, (foot, socket, home, phase) in enumerate(start.legs, 1):
        leg, piston = (
            body(f"leg_{i}", 2.0, 0.2, [0.03, 0.03, 0.002]),
            body(f"piston_{i}", 1.0, 0.3, [0.02, 0.02, 0.0002]),
        )
        inside = [marker(leg, [0, 0, 0]), marker(piston, [0, 0, 0])]
        top = [marker(piston, [0, 0, 0.5]), marker(platform, socket)]
        universal = [marker(ground, foot, home), inside[0]]
        mbs.AddObject(GenericJoint(markerNumbers=universal, constrainedAxes=[1, 1, 1, 0, 0, 1]))
        mbs.AddObject(GenericJoint(markerNumbers=inside, constrainedAxes=[1, 1, 0, 1, 1, 1]))
        mbs.AddObject(SphericalJoint(markerNumbers=top))

        def pull(mbs, t, item, u, v, k, d, offset, phase=phase):
            return k * (u - 0.28 - 0.06 * np.sin(np.pi * t + phase)) + d * (
                v - 0.06 * np.pi * np.cos(np.pi * t + phase)
            )

        drive = {"stiffness": 8000.0, "damping": 200.0, "axisMarker0": [0, 0, 1], "springForceUserFunction": pull}
        mbs.AddObject(LinearSpringDamper(markerNumbers=inside, **drive))
    sensors = [
        mbs.AddSensor(SensorBody(bodyNumber=platform, storeInternal=True, writeToFile=False, outputVariableType=k))
        for k in (KINDS.Position, KINDS.RotationMatrix)
    ]
    return run(mbs, sensors, t, n)
