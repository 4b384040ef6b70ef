"""The four-bar with a flexible coupler as an Exudyn model: ObjectFFRFreducedOrder on the same modes and masses.

Exudyn's gravity on this object neglects the deformation (1.0e-4 rad of the crank at 0.5 s): weights act on its nodes.
"""

import numpy as np
from crosscheck_exudyn import KINDS, Plane, along, run
from exudyn.FEM import FEMinterface, ObjectFFRFreducedOrderInterface
from exudyn.itemInterface import (
    Force,
    MarkerBodyPosition,
    MarkerNodeRigid,
    MarkerSuperElementPosition,
    SensorNode,
    SphericalJoint,
)
from scipy.sparse import csr_matrix, diags


def four_bar(points, start, t, n):
    """Return the crank's angle and the coordinates of the modes at times t, with n steps between them, (len(t), 1 + k).

    Args:
        points: positions (m, 3), masses (m,), modes (m, 3, k) and stiffness (k,) of the coupler, last the tip.
        start: angles of crank, coupler and rocker from +x, and their rates.
        t: times.
        n: number of steps.
    """
    r, m, Phi, stiffness = points
    (a, b, c), (wa, wb, wc) = start
    plane, pivot = Plane(), np.array([1.0, 0.0])
    mbs = plane.mbs
    quarter = np.pi / 2
    first = plane.body(0.5, 0.5 * 0.3**2 / 12, along(a, 0.15), a, (*along(a + quarter, 0.15 * wa), wa))
    last = plane.body(1.0, 0.7**2 / 12, pivot + along(c, 0.35), c, (*along(c + quarter, 0.35 * wc), wc))
    fem, k, U = FEMinterface(), len(stiffness), Phi.reshape(-1, len(stiffness))
    weights, modal = np.repeat(m, 3), np.linalg.inv(Phi.reshape(-1, k).T @ (np.repeat(m, 3)[:, None] * U))
    MU = weights[:, None] * U @ modal
    fem.nodes["Position"] = r
    fem.massMatrix, fem.stiffnessMatrix = csr_matrix(diags(weights)), csr_matrix(MU @ np.diag(stiffness) @ MU.T)
    fem.modeBasis = {"matrix": U, "type": "NormalModes"}
    rotation = np.array([[np.cos(b), -np.sin(b), 0], [np.sin(b), np.cos(b), 0], [0, 0, 1]])
    coupler = ObjectFFRFreducedOrderInterface(fem).AddObjectFFRFreducedOrder(
        mbs, positionRef=[*along(a, 0.3), 0.0], initialVelocity=[*along(a + quarter, 0.3 * wa), 0.0],
        rotationMatrixRef=rotation, initialAngularVelocity=[0, 0, wb],
    )  # fmt: skip
    for coordinate in (2, 4, 5):  # it stays in the plane
        plane.hold(coupler["nRigidBody"], coordinate)
    plane.pin(plane.ground, np.zeros(2), first, (-0.15, 0))
    plane.pin(plane.ground, pivot, last, (-0.35, 0))
    tip = MarkerSuperElementPosition(
        bodyNumber=coupler["oFFRFreducedOrder"], meshNodeNumbers=[len(m) - 1], weightingFactors=[1]
    )
    ends = [
        ((first, 0.15), MarkerNodeRigid(nodeNumber=coupler["nRigidBody"])),
        ((last, 0.35), tip),
    ]
    for (body, at), other in ends:
        pair = MarkerBodyPosition(bodyNumber=body, localPosition=[at, 0, 0]), other
        markers = [mbs.AddMarker(x) for x in pair]
        mbs.AddObject(SphericalJoint(markerNumbers=markers, constrainedAxes=[1, 1, 0]))
    for i, mass in enumerate(m):
        if mass:
            marker = MarkerSuperElementPosition(
                bodyNumber=coupler["oFFRFreducedOrder"], meshNodeNumbers=[i], weightingFactors=[1]
            )
            mbs.AddLoad(Force(markerNumber=mbs.AddMarker(marker), loadVector=[0, -9.81 * mass, 0]))
    modes = SensorNode(
        nodeNumber=coupler["nGenericODE2"], storeInternal=True, writeToFile=False, outputVariableType=KINDS.Coordinates
    )
    seen = run(mbs, [plane.sensors[0], mbs.AddSensor(modes)], t, n)
    return np.column_stack([a + seen[:, 2], seen[:, 3:]])
