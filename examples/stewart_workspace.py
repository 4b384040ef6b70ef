"""Workspace of a Stewart platform: a slice of it, and singular poses.

The platform is put on a grid of positions without rotation; legs have strokes, and the ratio of singular values of all
rows with the pistons locked measures the distance from singularity. Rotated about the vertical it reaches singular
poses.

Run: python examples/stewart_workspace.py
"""

import numpy as np
from scipy.optimize import brentq

import mbdae

LEGS = [f"piston_{i}" for i in range(1, 7)]
LOW, HIGH = 0.1, 0.5  # strokes of the legs, m


def strokes_and_rows(mech: mbdae.Mechanism, x: float, z: float, yaw: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Strokes of the legs (6,), and all rows with the pistons locked (24, 24), for a pose of the platform."""
    pose = (x, 0.0, z, 0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2))
    q, _ = mech.assemble(q={"platform": pose})
    pistons = mech.coordinates(dict.fromkeys(LEGS, 0.0))[1]
    strokes = np.array([q[mech.model.joints[mech.model.getJointId(name)].idx_q] for name in LEGS])
    return strokes, np.vstack([mech.system().jacobian(q), np.eye(mech.nv)[pistons]])


def main(n: int = 13) -> dict[str, float]:
    """Print the slice y = 0 and the singular angle, and return the results."""
    mech = mbdae.load("stewart_platform")
    reached, worst = 0, np.inf
    for z in np.linspace(1.0, 0.5, n):
        line = ""
        for x in np.linspace(-0.5, 0.5, 2 * n):
            strokes, rows = strokes_and_rows(mech, x, z)
            inside = strokes.min() >= LOW and strokes.max() <= HIGH
            sizes = np.linalg.svd(rows, compute_uv=False)
            line += str(min(9, int(200 * sizes[-1] / sizes[0]))) if inside else "."
            reached += inside
            worst = min(worst, sizes[-1] / sizes[0] if inside else np.inf)
        print(f"z = {z:.2f} m  {line}")
    print(f"{reached} of {2 * n * n} positions are reachable; larger digits are farther from singular poses")
    angle = brentq(
        lambda yaw: np.linalg.slogdet(strokes_and_rows(mech, 0.0, 0.7, yaw)[1])[0] * _margin(mech, yaw), 0.5, 2.0
    )
    print(f"rotated by {np.degrees(angle):.6g} degrees, the platform is singular")
    curve = mbdae.kinematics(mech, LEGS[0], hold=LEGS[1:])
    print(curve)
    return {"reached": reached, "worst": float(worst), "angle": angle, "dead_points": len(curve.dead_points)}


def _margin(mech: mbdae.Mechanism, yaw: float) -> float:
    return float(np.linalg.svd(strokes_and_rows(mech, 0.0, 0.7, yaw)[1], compute_uv=False)[-1])


if __name__ == "__main__":
    main()
