"""Periodic motions without events: Mathieu's equation, a rolling disc, a driven linkage, a pendulum."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import add_body, empty
from scipy.special import ellipk, mathieu_a, mathieu_b

import mbdae
from mbdae import Driver, JointDamping, JointTorque, Mechanism
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.equations.invariance import MotionPoint, symmetries_of
from mbdae.mechanism.time_functions.time_functions import Harmonic
from mbdae.studies.factories import factory_of
from mbdae.studies.periodic.branch_path import BranchPath, Range

G = 9.81


def pendulum(tmp_path, amplitude, omega):
    """A pendulum of 1 m whose pivot moves up and down."""
    path = tmp_path / "pendulum.toml"
    path.write_text(f"""
title = "Pendulum on a shaken pivot"
gravity = [0.0, 0.0, -{G}]
body = [
  {{ name = "pivot", parent = "world", joint = "prismatic", mass = 1.0 }},
  {{ name = "rod", parent = "pivot", axis = [0.0, 1.0, 0.0], mass = 1.0, com = [0.0, 0.0, -1.0] }},
]
[[driver]]
joint = "pivot"
motion = {{ kind = "harmonic", amplitude = {amplitude!r}, omega = {omega!r}, phase = {np.pi / 2!r} }}
""")
    return path


@pytest.mark.parametrize(("characteristic", "m"), [(mathieu_b, 1), (mathieu_a, 2)])
def test_mathieu(tmp_path, characteristic, m):
    """On the characteristic curves x'' + (a - 2 q cos 2 tau) x = 0 has multipliers (-1)^m, twice."""
    q = 0.4
    a = float(characteristic(m, q))
    omega = float(np.sqrt(4 * G / a))
    found = mbdae.periodic(pendulum(tmp_path, q / 2, omega))
    assert pytest.approx(2 * np.pi / omega, rel=1e-14) == found.T
    assert abs(found.multipliers.sum() - 2 * (-1) ** m) < 1e-10
    assert abs(np.prod(found.multipliers) - 1) < 1e-10
    assert found.neutral == ()


def test_a_rolling_disc_has_neutral_multipliers_of_its_symmetries():
    """Upright, lean'' = -(12/5 n^2 - 4 g/(5 R)) lean; heading and its rate, place, phase and energy are neutral."""
    name = "rolling_disc?inclination=1.5707963267948966&precession=0&spin=5"
    found = mbdae.periodic(name, 1.3, symmetry=["x", "y", "turn"])
    assert [x.name for x in found.neutral] == ["time", "x", "y", "turn", "energy"]
    assert max(x.error for x in found.neutral) < 1e-9
    n = 2 * np.pi / found.T
    lean = np.exp(1j * np.sqrt(12 / 5 * n**2 - 4 * G / (5 * 0.3)) * found.T)
    lean = complex(lean.real, abs(lean.imag))
    for z in (1.0, lean, lean.conjugate()):
        assert np.abs(found.multipliers - z).min() < 1e-9
    assert len(found.multipliers) == 3
    assert found.advances["x"] == pytest.approx(2 * np.pi * 0.3, rel=1e-11)


def test_a_driven_linkage_converges_to_the_periodic_motion():
    """The motion after many periods, and the determinant of the monodromy matrix against damping (Liouville)."""
    torque = JointTorque(joint="crank", torque=Harmonic(amplitude=3.0, omega=2 * np.pi))
    forces = [torque, JointDamping(joint=["crank", "coupler", "rocker"], damping=4.0)]
    mech = mbdae.load("four_bar", forces=forces)
    rest = mbdae.equilibrium(mbdae.load("four_bar"), q={"crank": -1.5})
    late = mbdae.solve(mech, (0, 12), rest.q, 0 * rest.v, rtol=1e-8)
    found = mbdae.periodic(mech, q=late.q[-1], v=late.v[-1])
    assert pytest.approx(1.0, rel=1e-14) == found.T
    assert found.stability == "stable"
    later = mbdae.solve(mech, (0, 40), late.q[-1], late.v[-1], rtol=1e-10)
    np.testing.assert_allclose(later.q[-1], found.q, atol=1e-8)
    h = 1e-5
    ends = []
    for sign in (1, -1):
        q, v = mech.assemble({"crank": found.start["q.crank"] + sign * h}, {"crank": found.start["v.crank"]},
                             guess=dict(zip(mech.joint_names, found.q, strict=True)))  # fmt: skip
        end = mbdae.solve(mech, (0, 1), q, v, rtol=1e-12)
        ends.append([end.q[-1][0], end.v[-1][0]])
    column = (np.array(ends[0]) - ends[1]) / (2 * h)  # of (crank, its speed) after a period by the crank
    z = found.multipliers
    for sign in (1, -1):
        q, v = mech.assemble({"crank": found.start["q.crank"]}, {"crank": found.start["v.crank"] + sign * h},
                             guess=dict(zip(mech.joint_names, found.q, strict=True)))  # fmt: skip
        end = mbdae.solve(mech, (0, 1), q, v, rtol=1e-12)
        ends.append([end.q[-1][0], end.v[-1][0]])
    M = np.column_stack([column, (np.array(ends[2]) - ends[3]) / (2 * h)])
    assert abs(z.sum() - np.trace(M)) < 1e-6
    assert abs(np.prod(z) - np.linalg.det(M)) < 1e-6


def test_a_free_pendulum_has_its_period_and_only_neutral_multipliers(tmp_path):
    """T = 4 K(sin(a/2)) sqrt(L/g) of the amplitude at the start; the section counts one direction."""
    mech = Mechanism(mbdae.load(pendulum(tmp_path, 0.0, 1.0)).model, drivers=[Driver(joint="pivot", motion=0.0)])
    found = mbdae.periodic(mech, q=np.array([0.0, 1.0]), v=np.zeros(2), section="q.rod > 0.5")
    swing = np.arccos(np.cos(found.start["q.rod"]) - found.start["v.rod"] ** 2 / (2 * G))
    assert pytest.approx(4 * ellipk(np.sin(swing / 2) ** 2) / np.sqrt(G), rel=1e-10) == found.T
    assert len(found.multipliers) == 0
    assert found.stability == "stable"
    assert {x.name for x in found.neutral} == {"time", "energy"}
    assert found.start["q.rod"] == pytest.approx(0.5, abs=1e-10)
    again = mbdae.periodic(mech, found.T * 1.01, q=found.q, v=found.v, segments=4)
    assert again.stability == "stable"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"T": -1.0}, "period T must be a positive number"),
        ({"segments": 0}, "segments must be a positive whole number"),
        ({"section": "q.rod > 0.5", "segments": 1}, "at least 2 segments"),
        ({"rtol": 0.0}, "rtol is a number between 0 and 1"),
        ({}, "give an estimate of the period, T, or a section"),
        ({"section": "q.rod > 2.5"}, "does not reach the section"),
    ],
)
def test_wrong_input_is_one_line(tmp_path, arguments, message):
    mech = mbdae.load("double_pendulum") if not arguments else mbdae.load(pendulum(tmp_path, 0.0, 1.0))
    with pytest.raises(InputError, match=message):
        mbdae.periodic(mech, **arguments)


def test_unknown_names_are_listed(tmp_path):
    mech = mbdae.load(pendulum(tmp_path, 0.0, 1.0))
    with pytest.raises(UnknownNameError, match=r"symmetry 'up'.*turn"):
        mbdae.periodic(mech, 1.0, symmetry=["up"])
    with pytest.raises(InputError, match=r"joints of .* do not allow it"):
        mbdae.periodic(mbdae.load("double_pendulum"), 1.0, symmetry=["x"])


def test_a_swing_at_rest_keeps_its_energy_and_an_equilibrium_is_no_motion(tmp_path):
    """T = 4 K(sin(a/2)) sqrt(L/g), from a period that is wrong by 2 %: swings of all energies are periodic."""
    mech = Mechanism(mbdae.load(pendulum(tmp_path, 0.0, 1.0)).model, drivers=[Driver(joint="pivot", motion=0.0)])
    T = 4 * ellipk(np.sin(0.5) ** 2) / np.sqrt(G)
    whole = mbdae.periodic(mech, 0.98 * T, q={"rod": -1.0})
    half = mbdae.periodic(mech, 0.49 * T, q={"rod": -1.0}, exchange={"rod": "-rod"})
    for found in (whole.T, 2 * half.T):
        assert abs(found / T - 1) < 1e-11
    assert whole.start["q.rod"] == pytest.approx(-1.0, abs=1e-11)
    with pytest.raises(InputError, match="ends at an equilibrium"):
        mbdae.periodic(mech, T, q={"rod": 0.0})


def test_the_opposite_point_of_a_sphere_is_not_the_start():
    """Half a swing from the horizontal ends there, with the same coordinates in the tangent plane."""
    T = 4 * ellipk(0.5) / np.sqrt(G)
    with pytest.raises(InputError, match="at another point of the closures"):
        mbdae.periodic("pendulum", 2.0)
    assert abs(mbdae.periodic("pendulum", 2.1).T / T - 1) < 1e-11


def test_a_family_of_energies_has_no_branch():
    with pytest.raises(InputError, match="the motion conserves its energy"):
        mbdae.periodic_branch("pendulum", "closure.string.length", 1.0, 1.1, T=2.1)


Y = np.array([0.2, 0.1, 0.0, 0.0])  # position, speed, torque held, work
FORCED = """
[[body]]
name = "slide"
parent = "world"
joint = "prismatic"
axis = [1, 0, 0]
mass = 1.0
[[force]]
kind = "joint_pid"
name = "servo"
joint = "slide"
kp = 9.0
kd = 2.0
reference = { kind = "harmonic", amplitude = 0.1, omega = 6.283185307179586 }
"""


@pytest.fixture(scope="module")
def servos(tmp_path_factory):
    """A mass with a continuous controller, and with one that samples at 10 Hz."""
    out = []
    for rate in ("", "rate = 10.0"):
        path = tmp_path_factory.mktemp("servo") / "servo.toml"
        path.write_text(FORCED + rate)
        out.append(str(path))
    return out


def test_multipliers_of_a_sampled_controller_are_those_of_its_discrete_system(servos):
    """x+ = x + h v + h^2 u / 2, v+ = v + h u, u = -kp x - kd v: ten instants per period; the torque is forgotten."""
    h, kp, kd = 0.1, 9.0, 2.0
    step = np.array([[1 - kp * h * h / 2, h - kd * h * h / 2], [-kp * h, 1 - kd * h]])
    found = mbdae.periodic(servos[1])
    assert pytest.approx(1.0, rel=1e-14) == found.T
    expected = np.linalg.eigvals(np.linalg.matrix_power(step, 10))
    assert np.sort_complex(found.multipliers) == pytest.approx(np.sort_complex([*expected, 0.0]), abs=1e-9)


def test_the_start_of_a_branch_does_not_follow_a_gain_that_samples_there(servos):
    """Over a gain the first node is given; its torque is that before the instant."""
    over = Range("force.servo.kp", 9.0, 10.0)
    flow = BranchPath(factory_of(servos[1]), over, {}, {"method": "pherk6", "rtol": 1e-9}, 1e-7).flow(9.0, 0.0, Y)
    tangent = flow.tangent(flow.run(0.0, Y, 0.05, None), np.zeros((len(Y), 1)), None)
    assert not tangent.start.any()
    assert tangent.fixed[1] == pytest.approx(0.05 * (0.0 - Y[0]), rel=1e-9)


@pytest.mark.parametrize("arguments", [{"T": 0.7}, {"section": "q.slide > 0.01"}, {"T": 1.05}])
def test_a_motion_without_the_period_of_its_forces_is_rejected(servos, arguments):
    """After such a time the state is back, but the reference or the instants are not."""
    for path in servos:
        with pytest.raises(InputError, match="do not repeat themselves after"):
            mbdae.periodic(path, **arguments)


@pytest.mark.parametrize("name", ["spin", "turn", "x"])
def test_a_joint_with_the_name_of_a_motion_is_cyclic(name):
    """A wheel that turns beside an oscillator: it has neither the axis nor the bodies of that motion."""
    model = empty(0.0)
    add_body(model, 0, pin.JointModelPX(), "mass")
    add_body(model, 0, pin.JointModelRY(), name, inertia=(0.1, 0.1, 0.1))
    mech = mbdae.Mechanism(model, forces=[mbdae.JointSpring(joint="mass", stiffness=1.0)])
    found = mbdae.periodic(mech, 2 * np.pi, q=[0.3, 0.0], v=[0.1, 0.4], rtol=1e-9)
    ((key, advance),) = found.advances.items()
    assert key == (name if name == "spin" else f"{name} (joint)")
    assert advance == pytest.approx(2 * np.pi * found.v[1])
    assert found.v[1] > 0.1


def test_a_fast_joint_does_not_hide_the_spring_of_another_one():
    """3e-4 rad/s^2 of a spring besides 1e3 rad/s^2: the joint is not cyclic."""
    model = empty(0.0)
    for name in ("slow", "fast"):
        add_body(model, 0, pin.JointModelRY(), name, inertia=(1.0, 1.0, 1.0))
    spring, torque = mbdae.JointSpring(joint="slow", stiffness=4e-4), JointTorque(joint="fast", torque=1e3)
    mech = mbdae.Mechanism(model, forces=[spring, torque])
    assert symmetries_of(mech, [MotionPoint(0.0, mech.point(), ())]) == ("fast",)
