"""Forces against finite differences of their potentials, frame Jacobians and hand formulas."""

import numpy as np
import pinocchio as pin
import pytest
from chains import JOINTS, random_q, tree

import mbdae
from mbdae import (
    Bushing,
    JointFriction,
    JointPID,
    JointSpring,
    JointTorque,
    Mechanism,
    SpringDamper,
    Wrench,
    finite_differences,
)
from mbdae.errors import InputError, StepError
from mbdae.mechanism import forces
from mbdae.mechanism.forces.force import PythonForce
from mbdae.mechanism.forces.joint_law import JointElement
from mbdae.mechanism.time_functions.time_functions import Harmonic, Polynomial

MODEL = tree(["free", "prismatic", "spherical", "revolute", "universal", "planar"], [0, 1, 2, 3, 2, 5])
SINGLE = [n for n in MODEL.names if n.startswith(("prismatic", "revolute"))]
TABLE = ((-2.0, -9.0), (-0.5, -1.0), (0.0, 0.0), (0.5, 0.2), (2.0, 7.0))
SIX = (40.0, 90.0, 20.0, 3.0, 0.7, 5.0)
SPRINGS = {
    "joint_spring": JointSpring(joint=SINGLE, stiffness=30.0, rest=0.2),
    "joint_spring, table": JointSpring(joint=SINGLE, table=TABLE, rest=0.1),
    "joint_spring, monotone table": JointSpring(joint=SINGLE, table=TABLE, interpolation="monotone"),
    "spring_damper": SpringDamper(frames=("tip_3", "tip_5"), stiffness=50.0, length=0.3),
    "bushing": Bushing(frames=("tip_1", "tip_5"), stiffness=SIX),
    "bushing to the world": Bushing(frames=("tip_3", "ground"), stiffness=SIX),
    "wrench": Wrench(frame="tip_5", force=(3.0, -4.0, 5.0)),
}


def states(model=MODEL, number=4, seed=3):
    rng = np.random.default_rng(seed)
    return [(random_q(model, rng, 1.2), rng.uniform(-2, 2, model.nv)) for _ in range(number)]


def parts(force, t, q, v, model=MODEL):
    """The conservative and the other part of tau, (nv,) each, of the only force of a mechanism."""
    system = Mechanism(model, forces=[force]).system()
    system.inertia(t, q)
    return [np.broadcast_to(part, model.nv) for part in system.laws.split_generalized_force(t, q, v, q[:0])[:2]]


def gradient(force, q, model=MODEL):
    """dV/dq in the tangent, (nv,), by differences of order six."""
    mech, level = Mechanism(model, forces=[force]), Mechanism(model)
    rest = np.zeros(model.nv)
    V = lambda x: mech.energy(x, rest)[1] - level.energy(x, rest)[1]  # noqa: E731
    return finite_differences.numerical_jacobian(lambda x: V(pin.integrate(model, q, x)), model.nv, 2e-3)


def frame_jacobian(q, name, model=MODEL):
    """Jacobian (6, nv) of a frame in the axes of the world, and the frame's placement, by Pinocchio."""
    data = model.createData()
    i = model.getFrameId(name)
    J = pin.computeFrameJacobian(model, data, q, i, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    pin.framesForwardKinematics(model, data, q)
    return J, data.oMf[i]


@pytest.mark.parametrize("force", SPRINGS.values(), ids=SPRINGS.keys())
def test_torque_is_minus_the_gradient_of_the_potential(force):
    for q, v in states():
        conservative, other = parts(force, 0.3, q, v)
        assert np.abs(conservative).max() > 0.1
        np.testing.assert_allclose(conservative, -gradient(force, q), atol=2e-8)
        assert not other.any()


@pytest.mark.parametrize("kind", JOINTS)
def test_bushing_on_every_kind_of_joint(kind):
    model = tree(["free", kind, "spherical"], [0, 1, 2])
    bushing = Bushing(frames=("tip_2", "tip_0"), stiffness=SIX)
    angle = lambda q: np.linalg.norm(  # noqa: E731
        pin.log3(frame_jacobian(q, "tip_2", model)[1].rotation.T @ frame_jacobian(q, "tip_0", model)[1].rotation)
    )
    near = [(q, v) for q, v in states(model, 12) if angle(q) < 2.9]
    assert len(near) > 2
    for q, v in near[:3]:
        np.testing.assert_allclose(parts(bushing, 0, q, v, model)[0], -gradient(bushing, q, model), atol=2e-8)


def ball():
    """One link on a spherical joint."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return model


def turned(angle):
    """Torque of a bushing on the ball's link, rotated by an angle about a fixed axis; the rotation vector."""
    model, theta = ball(), angle * np.array([2.0, -1.0, 2.0]) / 3
    bushing = Bushing(frames=("world", "tip"), stiffness=(0, 0, 0, 3.0, 0.7, 5.0), name="rubber")
    return parts(bushing, 0, pin.integrate(model, pin.neutral(model), theta), np.zeros(3), model)[0], theta


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-5, 1e-2, 1.0, 2.9])
def test_bushing_turned_by_any_angle(angle):
    """The torque in the joint's axes is -J_r(theta)^-T K theta, J_r from the series of exp."""
    tau, theta = turned(angle)
    X, term, right = pin.skew(theta), np.eye(3), np.eye(3)
    for k in range(1, 40):
        term = -term @ X / (k + 1)
        right = right + term  # J_r = sum (-X)^k/(k + 1)!
    np.testing.assert_allclose(tau, -np.linalg.solve(right.T, np.array([3.0, 0.7, 5.0]) * theta), atol=1e-12)


@pytest.mark.parametrize("angle", [3.01, 3.14, 3.2])
def test_a_bushing_rotated_by_half_a_turn_is_rejected(angle):
    with pytest.raises(StepError, match=r"'rubber' rotates by more than 3.0 rad") as e:
        turned(angle)
    assert e.value.status == "chart"


@pytest.mark.parametrize("axes", ["world", "frame"])
def test_wrench_by_the_frame_jacobian(axes):
    force, torque = np.array([1.0, -2.0, 3.0]), np.array([0.4, 0.1, -0.7])
    wave = Harmonic(amplitude=1, omega=np.pi, offset=-0.9)  # 0.1 at t = 0.5
    wrench = Wrench(frame="tip_5", force=force, torque=(0.4, wave, -0.7), axes=axes)
    for q, v in states():
        J, at = frame_jacobian(q, "tip_5")
        R = at.rotation if axes == "frame" else np.eye(3)
        tau = sum(parts(wrench, 0.5, q, v))
        np.testing.assert_allclose(tau, J.T @ np.concatenate([R @ force, R @ torque]), atol=1e-12)


def test_bushing_damping_by_frame_jacobians():
    damping = np.array([2.0, 3.0, 5.0, 0.2, 0.3, 0.5])
    bushing = Bushing(frames=("tip_1", "tip_5"), damping=damping)
    for q, v in states():
        (Ja, A), (Jb, B) = frame_jacobian(q, "tip_1"), frame_jacobian(q, "tip_5")
        carry = -pin.skew(B.translation - A.translation) @ Ja[3:]  # a's body moved to the origin of b
        J = np.vstack([A.rotation.T @ (Jb[:3] - Ja[:3] - carry), A.rotation.T @ (Jb[3:] - Ja[3:])])
        conservative, other = parts(bushing, 0, q, v)
        assert not conservative.any()
        np.testing.assert_allclose(other, -J.T @ (damping * (J @ v)), atol=1e-11)
        assert other @ v < 0


def test_thrust_and_damper_between_points():
    """The power is (force - damping d') d', d' the rate of the distance by differences."""
    force = SpringDamper(frames=("tip_3", "tip_5"), damping=2.0, force=Polynomial(coefficients=(1.0, 4.0)))
    for q, v in states():
        gap = lambda h: np.linalg.norm(  # noqa: E731
            frame_jacobian(pin.integrate(MODEL, q, h * v), "tip_5")[1].translation  # noqa: B023
            - frame_jacobian(pin.integrate(MODEL, q, h * v), "tip_3")[1].translation  # noqa: B023
        )
        rate = finite_differences.numerical_derivative(gap, 1e-3)
        other = parts(force, 0.5, q, v)[1]
        assert other @ v == pytest.approx((3.0 - 2.0 * rate) * rate, abs=1e-9)


def test_joint_forces_by_hand():
    q, v = states()[0]
    spring = JointSpring(joint=SINGLE[0], stiffness=3.0, damping=0.5)
    friction = JointFriction(joint=SINGLE, friction=2.0, velocity=0.1)
    j = MODEL.joints[MODEL.getJointId(SINGLE[0])]
    expected = np.zeros(MODEL.nv)
    expected[j.idx_v] = -0.5 * v[j.idx_v]
    np.testing.assert_allclose(parts(spring, 0, q, v)[1], expected)
    expected = np.zeros(MODEL.nv)
    for name in SINGLE:
        i = MODEL.joints[MODEL.getJointId(name)].idx_v
        expected[i] = -2.0 * np.tanh(10 * v[i])
    np.testing.assert_allclose(parts(friction, 0, q, v)[1], expected)
    pd = JointPID(joint=SINGLE[0], kp=4.0, kd=0.3, reference=Harmonic(amplitude=0.5, omega=2.0))
    expected = np.zeros(MODEL.nv)
    r, dr = 0.5 * np.sin(1.4), np.cos(1.4)
    expected[j.idx_v] = 4.0 * (r - q[j.idx_q]) + 0.3 * (dr - v[j.idx_v])
    np.testing.assert_allclose(parts(pd, 0.7, q, v)[1], expected)
    tau = parts(JointTorque(joint="planar_5", torque=(1.0, lambda t: t**2, -3.0)), 0.5, q, v)[1]
    at = MODEL.joints[MODEL.getJointId("planar_5")].idx_v
    np.testing.assert_allclose(tau[at : at + 3], [1.0, 0.25, -3.0])
    assert np.count_nonzero(tau) == 3


def test_spring_table_goes_through_its_points_and_on_straight():
    model = tree(["prismatic"], [0])
    for interpolation in ("spline", "monotone"):
        spring = JointSpring(joint="prismatic_0", table=TABLE, interpolation=interpolation)
        torque = lambda x: -parts(spring, 0, np.array([x]), np.zeros(1), model)[0][0]  # noqa: B023, E731
        np.testing.assert_allclose([torque(x) for x, _ in TABLE], [y for _, y in TABLE], atol=1e-14)
        out = [torque(x) for x in (2.0, 3.0, 4.0, 5.0)]
        np.testing.assert_allclose(np.diff(out, 2), 0, atol=1e-13)
        assert out[1] > out[0]
    grid = np.linspace(-2, 2, 200)
    assert (np.diff([torque(x) for x in grid]) >= -1e-14).all()  # the monotone one does not overshoot


URDF = """<robot name="arm"><link name="base"/><link name="link"><inertial><mass value="1"/><origin xyz="0.2 0 0"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="base"/><child link="link"/><axis xyz="0 1 0"/>
<limit lower="-9" upper="9" effort="9" velocity="9"/><dynamics damping="0.0" friction="{}"/></joint></robot>"""


@pytest.mark.filterwarnings("ignore:.*limits of joints")
def test_friction_of_the_urdf_counts_when_asked_for(tmp_path):
    for value in ("0.3", "0"):
        (tmp_path / f"arm{value}.urdf").write_text(URDF.format(value))
    path = tmp_path / "arm0.3.urdf"
    free, with_friction = mbdae.load(path), mbdae.load(path, forces=[JointFriction(velocity=0.5)])
    assert "friction of joints hinge" in free.left_out
    assert not any("friction" in text for text in with_friction.left_out)
    q, v = np.zeros(1), np.array([0.4])
    assert not free.system().laws.acting
    assert with_friction.system().laws.generalized_force(0.0, q, v, q[:0])[0][0] == pytest.approx(-0.3 * np.tanh(0.8))
    with pytest.raises(InputError, match="model has no friction"):
        mbdae.load(tmp_path / "arm0.urdf", forces=[JointFriction()])


class Undeclared(PythonForce):
    """A spring beyond 0.4 rad whose element has no potential energy."""

    name = "catch"

    def bind(self, model, data):
        class Spring(JointElement):
            def effort(self, q, v):
                return np.where(np.real(q) > 0.4, -3.0 * (q - 0.4), 0.0), 0.0

        return Spring(self.name, [0], [0])


def test_a_conservative_part_without_a_potential_is_rejected_by_name(monkeypatch):
    """The run ends where this part first acts, and keeps the steps before."""
    monkeypatch.setattr(forces, "PYTHON_FORCES", (*forces.PYTHON_FORCES, Undeclared))
    mech = mbdae.load("four_bar", forces=[Undeclared()])
    q, v = mech.assemble(q={"crank": 0.3}, v={"crank": 2.0})
    for method in ("pherk5", "radau5"):
        sol = mbdae.solve(mech, (0, 1), q, v, method=method)
        assert sol.status == "force"
        assert "force 'catch' has a conservative part without a potential" in sol.message
        assert "potential(q)" in sol.message
        assert 0 < sol.t[-1] < 1
        assert 0.3 < sol.q[-1, 0] <= 0.4 + 1e-9
