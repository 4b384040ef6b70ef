"""Inverse dynamics with stops, clutches and dry friction: closed rows are active in a run, none in a given motion."""

import numpy as np
import pinocchio as pin
import pytest
from linkages import bar

import mbdae
from mbdae import Clutch, JointFriction, JointTorque, Mechanism, Stop, inverse_dynamics, kinematics
from mbdae.errors import InputError
from mbdae.mechanism.model_settings import Start

COMMANDS = (
    "solve slider_crank_with_stop -t 0.3 -o stopped.npz",
    "inverse-dynamics slider_crank_with_stop stopped.npz -a crank",
    "inverse-dynamics slider_crank_with_stop --drive crank --speed 5 --points 20",
)
G = 9.81


@pytest.fixture(scope="module")
def pressed():
    """A rod of 1 kg at 1 m falls on its stop at 0.3 rad without a bounce, and stays."""
    given = mbdae.load("pendulum_on_stop")
    mech = Mechanism(given.model, stops=[Stop(joint="rod", lower=0.3)], start=given.start_values)
    return mech, mbdae.solve(mech, (0, 0.8), rtol=1e-8)


@pytest.mark.parametrize("sampled", [False, True])
def test_a_closed_stop_carries_load_in_a_run(pressed, tmp_path, sampled):
    """At rest the rod presses on its stop with m g l sin(0.3); its motor has zero torque, before and after."""
    mech, sol = pressed
    if sampled:
        sol = mbdae.solve(mech, (0, 0.8), rtol=1e-8, t_eval=np.linspace(0, 0.8, 33))
    found = inverse_dynamics(mech, sol, "rod")
    (hit,) = sol.impacts
    assert found.impacts == (hit.t,)
    assert found.violations == ()
    np.testing.assert_allclose(found.efforts, 0, atol=1e-12)
    rests = found.t > hit.t
    rests[np.flatnonzero(found.t == hit.t)[1:]] = True
    assert rests.any()
    np.testing.assert_allclose(found.lam[~rests], 0, atol=0)
    np.testing.assert_allclose(found.lam[rests, 0], G * np.sin(0.3), rtol=1e-12)
    assert f"impulses of impacts are not included in efforts: t = {hit.t:.6g} s" in str(found)
    sol.save(tmp_path / "run.npz")
    np.testing.assert_array_equal(inverse_dynamics(mech, tmp_path / "run.npz", "rod").lam, found.lam)


def test_without_the_stop_the_motor_holds(pressed):
    """The same motion of a mechanism without a stop, and of the same one as arrays: the motor replaces the stop."""
    mech, sol = pressed
    free = Mechanism(mech.model, start=mech.start_values)
    at_rest = np.abs(sol.q[:, 0] - 0.3) < 1e-9
    at_rest[: np.flatnonzero(at_rest)[0] + 1] = False  # the impact itself
    for found in (
        inverse_dynamics(free, sol, "rod"),
        inverse_dynamics(mech, (np.asarray(sol.t), sol.q, sol.v, sol.vdot), "rod"),
    ):
        np.testing.assert_allclose(found.efforts[at_rest, 0], G * np.sin(0.3), rtol=1e-9)
        np.testing.assert_allclose(found.efforts[~at_rest][:-1], 0, atol=1e-9)
        assert not found.lam.any()
        assert found.violations == ()


def test_a_motion_through_a_stop_is_reported_with_its_effort():
    """m g l sin(u) at constant speed; the stop at 0.3 rad is passed from there on."""
    mech = mbdae.load("pendulum_on_stop")
    found = inverse_dynamics(mech, kinematics(mech, "rod", span=(1.0, 0.0), points=41), speed=-2.0)
    np.testing.assert_allclose(found.efforts[:, 0], G * np.sin(found.over), rtol=1e-12, atol=1e-12)
    (violation,) = found.violations
    np.testing.assert_allclose(violation[1:4], (0.3, 0.0, 0.3), atol=1e-12)
    assert "violates 'rod stop', which does not act, by up to 0.3 rad: rod = 0.3 to 0 rad" in str(found)
    assert found.to_dict()["violations"][0]["name"] == "rod stop"


def sliders(forces=(), **parts):
    """Two blocks of 2 kg and 3 kg on one rail."""
    model = pin.Model()
    model.gravity.linear[:] = 0
    for name, mass in (("one", 2.0), ("two", 3.0)):
        j = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(j, pin.Inertia(mass, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    return Mechanism(model, (), forces, **parts)


def test_dry_friction_in_a_run_and_in_a_motion():
    """A push 3 t sticks up to 6 N, then slides against 4 N: friction carries the push, then 4 N; the motor nothing.

    For the same motion as a table the motor needs 2 a + 4 while it slides; at rest, friction may hold 6 N.
    """
    push = {"kind": "polynomial", "coefficients": (0.0, 3.0)}
    dry = JointFriction(joint="one", friction=4.0, static=6.0)
    mech = sliders([dry, JointTorque(joint="one", torque=push, name="push")])
    sol = mbdae.solve(mech, (0, 3.0), rtol=1e-9)
    free = sliders([dry])
    found = inverse_dynamics(free, sol, ["one", "two"])
    sticks = np.arange(len(found.t)) < sol.modes[1][0]
    np.testing.assert_allclose(sol.lam[sticks, 0], -3 * found.t[sticks], atol=1e-9)
    # the push is replaced by the motor: motor force and friction are not separable while it sticks
    np.testing.assert_allclose(found.efforts[sticks, 0] + found.lam[sticks, 0], 0, atol=1e-12)
    slides = found.v[:, 0] > 1e-6
    np.testing.assert_allclose(found.efforts[slides, 0], 3 * found.t[slides], rtol=1e-9)
    t = np.linspace(0, 2, 101)
    moved = inverse_dynamics(free, {"t": t, "one": 0.5 * t**2 - 1e-3, "two": 0 * t}, ["one", "two"])
    np.testing.assert_allclose(moved.efforts[1:-1, 0], 2 * 1.0 + 4.0, atol=1e-9)
    assert moved.static_friction == {}
    back = inverse_dynamics(free, {"t": t, "one": -0.5 * t**2, "two": 0 * t}, ["one", "two"])
    np.testing.assert_allclose(back.efforts[1:-1, 0], -6.0, atol=1e-9)
    at_rest = inverse_dynamics(free, (t[:2], np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2))), ["one", "two"])
    assert at_rest.static_friction == {"one": 6.0}
    assert "'one' is at rest: its static friction can balance up to 6 N" in str(at_rest)


def test_a_locked_clutch_transmits_load_in_a_run():
    """Two blocks, the second may not lag the first: pushed by 10 N they move together, the clutch transmits 6 N."""
    clutch = Clutch(joints=("two", "one"), name="pawl")
    parts = {"clutches": [clutch], "start": Start()}
    mech = sliders([JointTorque(joint="one", torque=10.0, name="push")], **parts)
    sol = mbdae.solve(mech, (0, 1.0))
    found = inverse_dynamics(mech, sol, "one")
    np.testing.assert_allclose(found.efforts, 10.0, rtol=1e-9)
    np.testing.assert_allclose(np.abs(found.lam[:, 0]), 6.0, rtol=1e-9)
    t = np.linspace(0, 1, 51)
    alone = inverse_dynamics(mech, {"t": t, "one": t**2, "two": 0.5 * t**2}, ["one", "two"])
    np.testing.assert_allclose(alone.efforts, [[4.0, 3.0]] * 51, rtol=1e-9)
    (violation,) = alone.violations
    assert (violation.name, violation.first, violation.last) == ("pawl", pytest.approx(0, abs=1e-9), 1.0)
    assert violation.most == pytest.approx(0.5, rel=1e-3)
    assert not inverse_dynamics(mech, {"t": t, "one": 0.5 * t**2, "two": t**2}, ["one", "two"]).violations


def test_a_commanded_clutch_transmits_load_in_a_prescribed_motion():
    """Engaged up to 1 s, both blocks are moved by one motor, 5 a; then by two motors, 2 a and 3 a."""
    steps = {"kind": "steps", "points": [[0.0, 1.0], [1.0, 0.0]]}
    mech = sliders(clutches=[Clutch(joints=("one", "two"), engaged=steps)])
    t = np.linspace(0, 0.9, 10)
    together = np.column_stack([t**2, t**2]), np.column_stack([2 * t, 2 * t]), np.full((10, 2), 2.0)
    found = inverse_dynamics(mech, (t, *together), "one")
    np.testing.assert_allclose(found.efforts, 10.0, rtol=1e-12)
    later = inverse_dynamics(mech, (t + 1, *together), ["one", "two"])
    np.testing.assert_allclose(later.efforts, [[4.0, 6.0]] * 10, rtol=1e-12)


@pytest.mark.parametrize(
    ("model", "end", "actuators"),
    [
        ("slider_crank_with_stop", 0.5, "crank"),
        ("stick_slip_slider", 0.5, "crank"),
        ("ratchet", 1.0, None),
        ("bouncing_chain", 0.3, ["across", "up", "head", "middle", "tail"]),
    ],
)
def test_efforts_of_shipped_models_are_those_of_their_runs(model, end, actuators):
    """The input's effort of the run, and the multipliers of all other rows, computed independently."""
    mech = mbdae.load(model)
    sol = mbdae.solve(mech, (0, end))
    found = inverse_dynamics(mech, sol, actuators)
    driven = [row for d in mech.drivers for row in mech.rows_of(d.name)]
    scale = np.abs(sol.lam).max() + 1
    if driven:
        np.testing.assert_allclose(found.efforts, sol.lam[:, driven], rtol=0, atol=1e-9 * scale)
    if model == "slider_crank_with_stop":
        np.testing.assert_allclose(found.efforts, 0.3, rtol=1e-9)
    rest = np.delete(sol.lam, driven, axis=1)
    if model != "stick_slip_slider":  # with the motor at a sticking joint: not unique
        np.testing.assert_allclose(found.lam, rest, rtol=0, atol=1e-9 * scale)
    assert found.impacts == tuple(x.t for x in sol.impacts)
    assert found.signals()[f"lam.{mech.row_names[-1]}.1"].shape == found.t.shape


def test_integrals_are_taken_between_jumps():
    """Effort 1 up to t = 1 and 0 after it, two nodes there: RMS over 2 s is sqrt(1/2)."""
    bar_ = pin.Model()
    bar(bar_, 0, (0, 0), 1.0, "bar")
    mech = Mechanism(bar_)
    t = np.array([0.0, 0.5, 1.0, 1.0, 1.5, 2.0])
    found = inverse_dynamics(mech, (t, np.zeros((6, 1)), np.ones((6, 1)), np.zeros((6, 1))), "bar")
    found.efforts[:, 0] = [1, 1, 1, 0, 0, 0]
    demand = found.demands[0]
    assert demand.rms == pytest.approx(np.sqrt(0.5), rel=1e-12)
    assert demand.energy == pytest.approx(1.0, rel=1e-12)


def test_rms_is_that_of_squares_on_any_grid():
    """Simpson's rule of squares is negative on grids that change abruptly: 1, 0, 0 at 0, 1e-3, 1 gave nan."""
    model = pin.Model()
    bar(model, 0, (0, 0), 1.0, "bar")
    t = np.array([0.0, 0.999, 1.0])
    found = inverse_dynamics(Mechanism(model), (t, np.zeros((3, 1)), np.ones((3, 1)), np.zeros((3, 1))), "bar")
    found.efforts[:, 0] = [0.0, 0.0, 1.0]
    demand = found.demands[0]
    assert 0 < demand.rms < np.sqrt(1e-3)
    assert 0 < demand.energy < 1e-3


def test_where_wheels_roll_to_is_no_table():
    """The position of a platform on wheels depends on the path: 1e-4 m off from 41 points of a table."""
    t = np.linspace(0, 2, 41)
    mech = mbdae.load("differential_drive")
    with pytest.raises(InputError, match="has nonholonomic rows: its position depends on the path, not on left_wheel"):
        inverse_dynamics(mech, {"t": t, "left_wheel": np.sin(t), "right_wheel": np.sin(2 * t)})


def test_closures_within_windows_carry_in_a_motion():
    """The slots and the locking disc of a Geneva drive are active by the angle of the crank, run or not."""
    mech = mbdae.load("geneva_drive")
    sol = mbdae.solve(mech, (0, 0.6))
    modes = np.array([sol.mode(i) for i in range(len(sol.t))])
    change = sol.t[1:][(np.diff(modes, axis=0) != 0).any(axis=1)]
    assert len(change) > 1
    inside = ~np.isin(sol.t, [*change, *(x.t for x in sol.impacts)])
    of_run = inverse_dynamics(mech, sol, "crank").efforts[inside]
    moved = inverse_dynamics(mech, tuple(np.asarray(x)[inside] for x in (sol.t, sol.q, sol.v, sol.vdot)), "crank")
    np.testing.assert_allclose(moved.efforts, of_run, atol=1e-9)
    with pytest.raises(InputError, match="'slot 1' is active only in ranges of 'crank'"):
        kinematics(mech, "crank")


def test_times_that_come_twice_are_named(tmp_path):
    mech = mbdae.load("pendulum_on_stop")
    mbdae.solve(mech, (0, 0.6)).save(tmp_path / "run.csv")
    with pytest.raises(InputError, match=r"got 0\.46492\d+ and then 0\.46492\d+ \(a run has the time"):
        inverse_dynamics(mech, tmp_path / "run.csv", "rod")
