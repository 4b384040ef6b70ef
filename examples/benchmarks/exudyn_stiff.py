"""The problems of stiff.py as Exudyn models: a kinematic tree, and bodies in the plane with springs and constraints."""

from types import ModuleType
from typing import Any

import numpy as np
from exudyn import itemInterface as item
from exudyn.utilities import CreateSymbolicUserFunction
from runs import Array
from stiff import CAR_AXIS, EPS, GOVERNOR, MASS, REST, ROUGH, SPEED, SPRING_CRANK

GRAVITY, BAR, BALL = 9.81, 0.3, 5.0  # m/s^2; kg
BOX = np.diag([5e-6, 0.0250025, 0.0250025])  # kg m^2, of a rod along x
HEAVY = (0.5 * BAR + BALL) / (BAR + BALL)  # m: centre of mass of a rod and its ball


def _spring(mbs: Any, a: Any, b: Any, stiffness: float, damping: float, length: float) -> None:
    numbers = {"stiffness": stiffness, "damping": damping, "referenceLength": length}
    mbs.AddObject(item.ObjectConnectorSpringDamper(markerNumbers=[a, b], **numbers))


def _hold(mbs: Any, node: Any, coordinate: int, **motion: Any) -> Any:
    fixed = mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(item.NodePointGround()), coordinate=0))
    moved = mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate))
    return mbs.AddObject(item.ObjectConnectorCoordinate(markerNumbers=[fixed, moved], **motion))


def governor(exu: ModuleType, mbs: Any) -> Array:
    """Build shaft, slider and both rods as a kinematic tree; return the indices of the observed coordinates."""
    inertia = BOX + (BALL * (1 - HEAVY) ** 2 + BAR * (HEAVY - 0.5) ** 2) * np.diag([0.0, 1.0, 1.0])
    turned, none = np.diag([-1.0, -1.0, 1.0]), np.eye(3)
    (_, slider, tilt), (turn, *_) = GOVERNOR.start
    start = {"initialCoordinates": [0.0, slider, tilt, tilt], "initialCoordinates_t": [turn, 0.0, 0.0, 0.0]}
    node = mbs.AddNode(item.NodeGenericODE2(referenceCoordinates=[0.0] * 4, numberOfODE2Coordinates=4, **start))
    kind = exu.JointType
    tree = mbs.AddObject(
        item.ObjectKinematicTree(
            nodeNumber=node,
            gravity=[0.0, 0.0, -GRAVITY],
            jointTypes=[kind.RevoluteZ, kind.PrismaticZ, kind.RevoluteY, kind.RevoluteY],
            linkParents=[-1, 0, 0, 0],
            jointTransformations=exu.Matrix3DList([none, none, none, turned]),
            jointOffsets=exu.Vector3DList([[0, 0, 0], [0, 0, 0], [0.05, 0, 1], [-0.05, 0, 1]]),
            linkInertiasCOM=exu.Matrix3DList([np.diag([0.0250025, 0.0250025, 5e-6]), 0.005 * none, inertia, inertia]),
            linkCOMs=exu.Vector3DList([[0, 0, 0.5], [0, 0, 0], [HEAVY, 0, 0], [HEAVY, 0, 0]]),
            linkMasses=[BAR, 3.0, BAR + BALL, BAR + BALL],
        )
    )

    def at(link: int, x: float) -> Any:
        return mbs.AddMarker(
            item.MarkerKinematicTreeRigid(objectNumber=tree, linkNumber=link, localPosition=[x, 0.0, 0.0])
        )

    for rod, side in ((2, 0.05), (3, -0.05)):
        _spring(mbs, at(1, side), at(rod, 0.5), 8e5, 4e4, 0.5)
    return np.array([1, 2])


def spring_crank(exu: ModuleType, mbs: Any) -> Array:
    """Build crank and slider in the plane with constraints; return the indices of the observed coordinates."""
    (angle, x), (turn, speed) = SPRING_CRANK.start
    moves = {"initialCoordinates": [0.0, 0.0, angle], "initialVelocities": [0.0, 0.0, turn]}
    crank = mbs.AddNode(item.NodeRigidBody2D(referenceCoordinates=[0.0, 0.0, 0.0], **moves))
    slider = mbs.AddNode(item.NodePoint2D(referenceCoordinates=[x, 0.0], initialVelocities=[speed, 0.0]))
    body = mbs.AddObject(item.ObjectRigidBody2D(mass=1.0, inertia=0.02, nodeNumber=crank))
    mbs.AddObject(item.ObjectMassPoint2D(mass=0.5, nodeNumber=slider))
    for node, coordinate in ((crank, 0), (crank, 1), (slider, 1)):
        _hold(mbs, node, coordinate)
    pin = mbs.AddMarker(item.MarkerBodyPosition(bodyNumber=body, localPosition=[0.1, 0.0, 0.0]))
    _spring(mbs, pin, mbs.AddMarker(item.MarkerNodePosition(nodeNumber=slider)), 1e8, 1e4, 0.35)
    return np.array([2, 3])


def car_axis(exu: ModuleType, mbs: Any) -> Array:
    """Build an axle rotated by a function of time, which Exudyn compiles, and two masses; return the observed ones."""
    symbolic = exu.symbolic

    def angle(mbs: Any, t: Any, item: Any, offset: Any) -> Any:
        return symbolic.asin(ROUGH * symbolic.sin(SPEED * t))

    def rate(mbs: Any, t: Any, item: Any, offset: Any) -> Any:
        y = ROUGH * symbolic.sin(SPEED * t)
        return ROUGH * SPEED * symbolic.cos(SPEED * t) / symbolic.sqrt(1.0 - y * y)

    (xl, yl, xr, yr), (ul, wl, ur, wr) = CAR_AXIS.start
    spin = {"initialVelocities": [0.0, 0.0, ROUGH * SPEED]}
    axle = mbs.AddNode(item.NodeRigidBody2D(referenceCoordinates=[0.0, 0.0, 0.0], **spin))
    body = mbs.AddObject(item.ObjectRigidBody2D(mass=1.0, inertia=1.0, nodeNumber=axle))
    _hold(mbs, axle, 0), _hold(mbs, axle, 1)
    drive = _hold(mbs, axle, 2, offsetUserFunction=angle, offsetUserFunction_t=rate)
    for function, name in ((angle, "offsetUserFunction"), (rate, "offsetUserFunction_t")):
        compiled = CreateSymbolicUserFunction(mbs, function, name, drive)
        mbs.SetObjectParameter(drive, name, compiled)
    K, ends = EPS**2 * MASS / 2, []
    for x, y, u, w, wheel in ((xl, yl, ul, wl, 0.0), (xr, yr, ur, wr, 1.0)):
        start = {"referenceCoordinates": [x, y, 0.0], "initialVelocities": [u, w, 0.0]}
        node = mbs.AddNode(item.NodeRigidBody2D(**start))
        mass = mbs.AddObject(item.ObjectRigidBody2D(mass=K, inertia=K, nodeNumber=node))
        _hold(mbs, node, 2)
        whole = mbs.AddMarker(item.MarkerBodyMass(bodyNumber=mass))
        mbs.AddLoad(item.LoadMassProportional(markerNumber=whole, loadVector=[0.0, -1.0, 0.0]))
        ends.append(mbs.AddMarker(item.MarkerBodyRigid(bodyNumber=mass)))
        wheel_at = mbs.AddMarker(item.MarkerBodyPosition(bodyNumber=body, localPosition=[wheel, 0.0, 0.0]))
        _spring(mbs, wheel_at, ends[-1], 1.0, 0.0, REST)
    mbs.AddObject(item.ObjectConnectorDistance(markerNumbers=ends, distance=1.0))
    upright = [ends[0], mbs.AddMarker(item.MarkerBodyRigid(bodyNumber=body))]
    along = {"axisMarker0": [0.0, 1.0, 0.0], "normalMarker1": [1.0, 0.0, 0.0], "constrainRotation": False}
    mbs.AddObject(item.ObjectJointPrismatic2D(markerNumbers=upright, **along))
    return np.array([3, 4, 6, 7])


MODELS = {GOVERNOR.title: governor, SPRING_CRANK.title: spring_crank, CAR_AXIS.title: car_axis}
