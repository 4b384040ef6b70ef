"""Curves of poses with stops, contacts, clutches and friction: all are ignored, and violations are reported."""

import numpy as np
import pinocchio as pin
import pytest
from four_bar_angles import angles
from linkages import bar

import mbdae
from mbdae import Closure, Clutch, Driver, JointFriction, Mechanism, Stop, assembly_modes, kinematics
from mbdae.errors import AssemblyError, InputError
from mbdae.mechanism.model_settings import Start
from mbdae.studies.kinematics.violations import negative_intervals


def four_bar(**parts):
    mech = mbdae.load("four_bar")
    return Mechanism(mech.model, mech.closures, mech.forces, start=mech.start_values, **parts)


def test_a_stop_of_another_joint_is_passed_where_the_loop_says():
    """The rocker's angle of a four-bar is that of its closed form at both ends of the stop's range."""
    end = 1.6
    found = kinematics(four_bar(stops=[Stop(joint="rocker", upper=end)]), "crank", span=(0.0, 2 * np.pi), points=5)
    assert {(p.name, p.unit) for p in found.violations} == {("rocker stop", "rad")}
    (violation,) = found.violations
    for u in violation[1:3]:
        assert angles(u)[1] == pytest.approx(end, abs=1e-12)
    u = np.linspace(0, 2 * np.pi, 20001)
    over = np.array([angles(x)[1] for x in u]) - end
    assert violation.most == pytest.approx(over.max(), rel=1e-3)
    assert violation.first == pytest.approx(u[over > 0][0], abs=1e-3)
    assert "violates 'rocker stop', which does not act" in str(found)
    assert found.to_dict()["violations"][0]["name"] == "rocker stop"


def test_stops_that_are_not_passed_are_not_reported():
    found = kinematics(four_bar(stops=[Stop(joint="rocker", upper=4.0)]), "crank")
    assert found.violations == ()
    assert "passes" not in str(found)


def test_the_stop_of_the_slider():
    """A crank of 0.1 m and a rod of 0.35 m: x = 0.1 cos u + sqrt(0.35^2 - (0.1 sin u)^2)."""
    mech = mbdae.load("slider_crank_with_stop")
    (violation,) = kinematics(mech, "crank").violations
    (end,) = [x for x, _ in mech.stops[0].one_sided_limits]
    x = [0.1 * np.cos(u) + np.sqrt(0.35**2 - (0.1 * np.sin(u)) ** 2) for u in violation[1:3]]
    np.testing.assert_allclose(x, end, atol=1e-12)
    assert violation.most == pytest.approx(0.45 - end, abs=1e-6)


def test_friction_that_sticks_does_not_change_poses():
    plain, sticks = mbdae.load("four_bar"), mbdae.load("four_bar", forces=[JointFriction(friction=1.0, exact=True)])
    a, b = (kinematics(m, "crank", points=12) for m in (plain, sticks))
    np.testing.assert_array_equal(a.q, b.q)
    assert not b.violations
    both = [assembly_modes(m, "crank").to_dict()["modes"] for m in (plain, sticks)]
    assert both[0] == both[1]


def two_bars(**parts):
    model = pin.Model()
    bar(model, 0, (0, 0), 1.0, "one")
    bar(model, 0, (3, 0), 1.0, "two")
    return Mechanism(model, **parts)


@pytest.mark.parametrize(
    ("clutch", "span", "first", "most"),
    [
        (Clutch(joint="one"), (0.0, 2.0), None, 0),
        (Clutch(joint="one"), (0.0, -2.0), 0.0, 2.0),
        (Clutch(joint="one", direction=-1), (0.5, 2.0), 0.5, 1.5),
        (Clutch(joints=("one", "two"), ratio=2.0), (0.0, 1.0), None, 0),
    ],
)
def test_clutches_turned_backwards_are_reported(clutch, span, first, most):
    found = kinematics(two_bars(clutches=[clutch]), "one", span=span, hold="two", points=20)
    assert found.u[-1] == span[1]
    if first is None:
        assert found.violations == ()
    else:
        (violation,) = found.violations
        assert (violation.first, violation.last) == pytest.approx((first, span[1]), abs=1e-14)
        assert violation.most == pytest.approx(most, abs=1e-12)


def test_a_ratchet_runs_back_to_its_last_tooth():
    """Teeth at 0.1 + 0.3 k: from 0.8 it goes back to 0.7 and no further."""
    found = kinematics(
        two_bars(clutches=[Clutch(joint="one", pitch=0.3, tooth=0.1)]), "one", span=(0.8, 0.0), hold="two"
    )
    (violation,) = found.violations
    assert violation.first == pytest.approx(0.7, abs=0.02)
    assert violation.most == pytest.approx(0.7, abs=1e-12)
    assert not kinematics(
        two_bars(clutches=[Clutch(joint="one", pitch=0.3, tooth=0.1)]), "one", span=(0.8, 0.71), hold="two"
    ).violations


def test_contacts_that_open_are_open():
    mech = mbdae.load("bouncing_chain")
    found = kinematics(mech, "up", span=(1.0, -1.0), hold=["across", "head", "middle", "tail"])
    nose = next(p for p in found.violations if p.name == "nose")
    np.testing.assert_allclose(nose[1:4], (0.0, -1.0, 1.0), atol=1e-12)
    with pytest.raises(InputError, match=r"5 degrees of freedom are left \(inactive: nose, first hinge, .*\): hold 4"):
        kinematics(mech, "up")


@pytest.mark.parametrize("name", ["rolling_disc", "bicycle"])
def test_what_rolls_is_rejected_with_its_name(name):
    mech = mbdae.load(name)
    with pytest.raises(InputError, match="has nonholonomic rows: its position"):
        kinematics(mech, mech.joint_names[-1])


def test_a_speed_driver_keeps_its_position_and_can_be_the_input():
    """It has no prescribed position: it stays at its start."""
    parts = {"drivers": [Driver(joint="two", speed={"kind": "constant", "value": 3.0}, name="motor")]}
    mech = two_bars(start=Start(q={"two": 0.4}), **parts)
    found = kinematics(mech, "one", span=(0.0, 1.0), points=3)
    np.testing.assert_allclose(found.q, [[0, 0.4], [0.5, 0.4], [1, 0.4]], atol=1e-15)
    found = kinematics(mech, "motor", span=(0.4, 1.0), hold="one", points=2)
    np.testing.assert_allclose(found.q, [[0, 0.4], [0, 1.0]], atol=1e-15)


def test_roots_of_cubics():
    """A parabola that dips below zero between two points, and a piecewise linear function."""
    x = np.array([0.0, 1.0, 4.0])
    (found,) = negative_intervals(x, (x - 2) ** 2 - 1e-2, 2 * (x - 2))
    np.testing.assert_allclose(found, (1.9, 2.1, 1e-2, 2.0), atol=1e-12)
    (found,) = negative_intervals(np.arange(4.0), np.array([0.0, 0.0, -1.0, 1.0]), None)
    np.testing.assert_allclose(found, (1.0, 2.5, 1.0, 2.0), atol=1e-15)
    assert negative_intervals(x, np.zeros(3), np.zeros(3)) == []
    assert negative_intervals(np.zeros(1), np.array([-1.0]), None) == [(0.0, 0.0, 1.0, 0.0)]


def test_a_rope_is_passed_where_it_is_too_short():
    """A bar of 1 m and a rope of 2 m from its tip to a post 2 m away: (cos u - 2)^2 + sin^2 u = 4."""
    model = pin.Model()
    bar(model, 0, (0, 0), 1.0, "bar")
    place = pin.SE3(np.eye(3), np.array([2.0, 0.0, 0.0]))
    model.addFrame(pin.Frame("post", 0, place, pin.FrameType.OP_FRAME))
    rope = Closure(kind="distance", frames=("post", "bar_tip"), length=2.0, unilateral=True, name="rope")
    (violation,) = kinematics(Mechanism(model, [rope]), "bar", span=(0.0, 2.0)).violations
    assert np.cos(violation.first) == pytest.approx(0.25, abs=1e-12)
    assert violation.last == 2.0


def test_an_input_that_cannot_begin_there_is_said():
    """A rod of Bricard's mechanism can turn from -pi/6 on; loops closed with flipped frames before do not count."""
    words = r"the input cannot start at -1 rad: it only reaches about -0\.[4-6]\d* rad"
    with pytest.raises(AssemblyError, match=words):
        kinematics(mbdae.load("bricard"), "rod_1", span=(-1.0, 1.0))


def test_a_motion_that_stays_in_contact():
    """A table holds the rod at its stop, which could carry any part of its moment."""
    mech, t = mbdae.load("pendulum_on_stop"), [0.0, 0.1, 0.2, 0.3]
    found = mbdae.inverse_dynamics(mech, {"t": t, "rod": [0.3] * 4}, "rod")
    (touching,) = found.violations
    assert touching == ("rod stop", 0.0, 0.3, 0.0, "rad")
    assert "is in contact with 'rod stop', which exerts no force here: t = 0 to 0.3 s" in str(found)
    assert mbdae.inverse_dynamics(mech, {"t": t, "rod": [0.6] * 4}, "rod").violations == ()
