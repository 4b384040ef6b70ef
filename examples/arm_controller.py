"""A closed-loop arm under control: a Panda arm swings the crank of a wheel.

The hand holds the handle by a revolute joint, so arm and wheel form a loop. The controller ignores the loop: at 200 Hz
it compensates the arm's weight and pulls the hand along the circle of the handle, tau = weight + J^T f, so that the
wheel's angle follows a reference. The torque is constant between two samples.

Run: python examples/arm_controller.py
"""

import numpy as np
import pinocchio as pin

import mbdae

ARM = tuple(f"panda_joint{i}" for i in range(1, 8))
STIFFNESS, DAMPING, OMEGA = 2000.0, 200.0, 2.0  # N/rad and N s/rad at the hand, rad/s of the reference


def reference(t: float) -> tuple[float, float]:
    """Reference angle of the wheel in rad, and its rate in rad/s."""
    return -0.45 - 0.4 * (1 - np.cos(OMEGA * t)), -0.4 * OMEGA * np.sin(OMEGA * t)


def main(end: float = 4.0) -> mbdae.Solution:
    """Print the tracking error of the wheel and return the solution."""
    model = mbdae.load("panda_handle").model
    data, hand, wheel = model.createData(), model.getFrameId("panda_hand_tcp"), model.getJointId("handle")
    iq, iv = model.joints[wheel].idx_q, model.joints[wheel].idx_v
    arm = [model.joints[model.getJointId(name)].idx_v for name in ARM]

    def pull(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        weight = pin.computeGeneralizedGravity(model, data, q)[arm]
        pin.computeJointJacobians(model, data, q)
        J = pin.getFrameJacobian(model, data, hand, pin.LOCAL_WORLD_ALIGNED)[:3, arm]
        spoke = pin.updateFramePlacement(model, data, hand).translation - data.oMi[wheel].translation
        tangent = np.cross([0.0, -1.0, 0.0], spoke / np.linalg.norm(spoke))
        angle, rate = reference(t)
        return weight + J.T @ ((STIFFNESS * (angle - q[iq]) + DAMPING * (rate - v[iv])) * tangent)

    control = mbdae.Sampled(pull, rate=200.0, joints=ARM, name="pull")
    sol = mbdae.solve(mbdae.load("panda_handle", forces=[control]), (0, end), rtol=1e-6)
    for t in np.linspace(0, sol.t[-1], 9):
        print(f"t = {t:4.2f} s   wheel {sol(t).q[iq]:7.3f} rad, reference {reference(t)[0]:7.3f} rad")
    print(mbdae.drift(sol))
    return sol


if __name__ == "__main__":
    main()
