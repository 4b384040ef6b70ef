"""Bodies that roll and slide on edges against closed forms, and inconsistent models.

J. I. Neimark, N. A. Fufaev, Dynamics of Nonholonomic Systems (1972); formulas are written out in each test.
"""

import re

import numpy as np
import pytest
from bodies import body, load
from numpy import cos, pi, sin
from shared import shared_model

import mbdae
from mbdae import Closure
from mbdae.integrate.steppers.native import NativeStepper
from mbdae.mechanism.signals.contacts import first_negative

G = 9.81


def test_a_nodding_disc_obeys_eulers_equations():
    mech = mbdae.load("rolling_disc", inclination=1.0, nod=0.5, precession=2.0, spin=-6.0)
    sol = mbdae.solve(mech, (0, 2), rtol=1e-11)
    a = pi / 2 - sol.q[-1, 5]
    assert a == pytest.approx(0.983026617938, abs=2e-11)
    assert sol.v[-1, 5] + sol.v[-1, 3] * cos(a) == pytest.approx(-6.02030686056, abs=2e-11)
    contact = sol.contact("ground")
    path = sol.q[:, :3] - contact.point
    np.testing.assert_allclose(np.linalg.norm(path, axis=1), 0.3, atol=1e-12)
    np.testing.assert_allclose(contact.point[:, 2], 0, atol=1e-12)
    names = sol.signals()
    np.testing.assert_array_equal(names["normal.ground"], contact.normal)
    np.testing.assert_array_equal(names["contact.ground.x"], contact.point[:, 0])


def test_a_disc_circles_steadily():
    sol = mbdae.solve(shared_model("rolling_disc"), (0, 5), rtol=1e-10)
    np.testing.assert_allclose(pi / 2 - sol.q[:, 5], 1.1, atol=1e-12)
    contact, n = sol.contact("ground"), -2.47147875926918
    assert sol.v[0, 5] + 4 * cos(1.1) == pytest.approx(n, abs=1e-14)
    np.testing.assert_allclose(contact.normal, G, rtol=1e-11)  # 1 kg, at one height
    np.testing.assert_allclose(np.abs(contact.lateral), 0.3 * abs(n) * 4, rtol=1e-9)  # the centre's circle: R n/W
    assert contact.lifts_off is None


@pytest.mark.parametrize(
    ("normal", "time"),
    [
        ([1.0, -1e-16, 1.0, 0.5, -0.5], 3.5),
        ([0.0, -1e-16, 2.0], None),
        ([-1.0, 1.0], 0.0),
        ([np.nan, -1.0], 1.0),
        ([np.nan, np.nan], None),
    ],
)
def test_normal_forces_of_rounding_do_not_lift_off(normal, time):
    assert first_negative(np.arange(5.0)[: len(normal)], np.array(normal)) == time


@pytest.mark.parametrize(("spin", "root"), [(5.0, 5.8172158288996j), (1.0, 4.87442304278158)])
def test_a_straight_disc_wobbles_or_falls(spin, root):
    """lam^2 = (m g R - C (C + m R^2) n^2/A)/(A + m R^2), C = 2 A = m R^2/2; all others are 0."""
    found = mbdae.modes(straight(spin)).eigenvalues
    assert np.sort(np.abs(found - root))[0] < 1e-12
    assert np.sort(np.abs(found + root))[0] < 1e-12
    assert np.count_nonzero(found == 0) == len(found) - 2


def test_critical_speed_of_a_straight_disc():
    """v^2 = g R/3; lam^2 is linear in v^2."""
    below, above = ((root**2).real for root in (mbdae.modes(straight(n)).eigenvalues[-1] for n in (2.0, 4.0)))
    assert 0.3**2 * (4 + 12 * below / (below - above)) == pytest.approx(G * 0.3 / 3, abs=1e-12)


def straight(spin):
    return mbdae.load("rolling_disc", inclination=pi / 2, precession=0.0, spin=spin)


def test_a_disc_that_falls_ends_by_name():
    mech = mbdae.load("rolling_disc", inclination=1.5, precession=0.0, spin=0.0)
    sol = mbdae.solve(mech, (0, 2), rtol=1e-6)
    assert sol.status == "singular"
    assert "closure 'ground': the wheel lies flat" in sol.message


def turntable(tmp_path, W=3.0, b=0.1, r=0.1):
    """A driven table tilted by b, and a ball at rest in its middle."""
    bodies = [
        body("table", "continuous", inertia=1.0, rpy=[0.0, b, 0.0], axis=[0.0, 0.0, 1.0]),
        body("ball", "free", inertia=0.4 * r * r),
    ]
    up = np.array([sin(b), 0, cos(b)])
    start = {"guess": {"ball": [*(r * up), 0, 0, 0, 1]}, "v": {"table": W}}
    drive = [{"joint": "table", "speed": W}]
    return load(tmp_path, bodies, [Closure.rolling("table", "ball", r)], start=start, driver=drive)


def test_a_ball_on_a_tilted_turntable_drifts_across(tmp_path):
    """v' = 2/7 W z x v + 5/7 g sin b x: from rest a cycloid, with a period of 7 pi/W and a drift 5 g sin b/(2 W)."""
    W, b = 3.0, 0.1
    mech = turntable(tmp_path, W, b)
    sol, k, drift = mbdae.solve(mech, (0, 1.5), rtol=1e-10), 2 * W / 7, 5 * G * sin(b) / (2 * W)
    along = np.array([cos(b), 0, -sin(b)])
    x = sol.q[:, 2:5] - sol.q[0, 2:5]
    np.testing.assert_allclose(x @ along, drift / k * (1 - cos(k * sol.t)), atol=1e-9)
    np.testing.assert_allclose(x[:, 1], drift * (sol.t - sin(k * sol.t) / k), atol=1e-9)


def test_a_ball_far_out_stays_in_the_core(monkeypatch, tmp_path):
    """Its row has a large norm there, and pivots differ, but nothing becomes singular."""
    asked = []
    advance = NativeStepper.advance
    monkeypatch.setattr(NativeStepper, "advance", lambda *args: asked.append(1) or advance(*args))
    sol = mbdae.solve(turntable(tmp_path, b=0.4), (0, 3), rtol=1e-7, backend="native")
    assert np.abs(sol.q[:, 2:5]).max() > 7
    assert len(sol.t) > 500
    assert len(asked) < 100


def test_a_ball_climbs_and_falls_in_a_cylinder(tmp_path):
    """Driven round at W its height oscillates at W sqrt(2/7), and N = m (R - r) W^2."""
    R, r, W = 0.5, 0.1, 12.0
    roll = Closure.rolling("world", "ball", r, surface="cylinder", surface_radius=-R)
    v = {"ball": [0, (R - r) * W, 0, 0, 0, -(R - r) * W / r]}
    start = {"guess": {"ball": [R - r, 0, 0, 0, 0, 0, 1]}, "guess_v": v}
    mech = load(tmp_path, [body("ball", inertia=0.4 * r * r)], [roll], start=start)
    T = 2 * pi / (W * np.sqrt(2 / 7))
    sol = mbdae.solve(mech, (0, T), rtol=1e-10)
    assert abs(sol.q[-1, 2]) < 1e-8
    assert np.abs(sol.q[:, 2]).max() > 0.3
    np.testing.assert_allclose(sol.contact("world-ball").normal, (R - r) * W**2, rtol=1e-9)


def ball_on_a_ball(tmp_path, **more):
    """At rest at theta_0 = 0.1: it lifts off at cos theta = 10/17 cos theta_0."""
    r, R, start = 0.1, 0.5, 0.1
    roll = Closure.rolling("world", "ball", r, surface="sphere", surface_radius=R, name="top", **more)
    guess = {"ball": [(R + r) * sin(start), 0, (R + r) * cos(start), 0, 0, 0, 1]}
    return load(tmp_path, [body("ball", inertia=0.4 * r * r)], [roll], start={"guess": guess})


def test_a_ball_in_the_centre_of_a_ball_cannot_be_assembled(tmp_path):
    roll = Closure.rolling("world", "ball", 0.1, surface="sphere", surface_radius=0.5, name="top")
    with pytest.raises(mbdae.MbdaeError, match="'top': the centre of a rolling body is at the centre of its sphere"):
        _ = load(tmp_path, [body("ball")], [roll]).start


def test_a_ball_that_may_lift_leaves_a_ball(tmp_path):
    sol = mbdae.solve(ball_on_a_ball(tmp_path, unilateral=True), (0, 0.9), rtol=1e-10)
    assert sol.success
    assert [mode for _, mode in sol.modes] == [(1,), (0,)]
    i = sol.modes[1][0]
    assert sol.t[i] == pytest.approx(0.865443990528504, abs=1e-11)
    assert np.arctan2(sol.q[i, 0], sol.q[i, 2]) == pytest.approx(0.945550554159228, abs=1e-11)
    z = [sol(t).q[2] for t in (0.87, 0.88, 0.89)]
    assert np.diff(z, 2) == pytest.approx(-G * 0.01**2, rel=1e-9)


def test_a_bilateral_ball_on_a_ball_warns_of_lift_off(tmp_path):
    sol = mbdae.solve(ball_on_a_ball(tmp_path), (0, 1.0), rtol=1e-10)
    x, _, z = sol(0.865443990528504).q[:3]
    assert np.arctan2(x, z) == pytest.approx(0.945550554159228, abs=1e-9)
    assert sol.status == "doubtful"
    assert "'top' is held on its surface from t = 0.8654" in sol.message
    assert sol.contact("top").lifts_off == pytest.approx(0.86544399, abs=1e-3)


def test_a_sleigh_turns_round(tmp_path):
    """Chaplygin: u = V tanh s, w = V/k sech s, s' = a V/k^2, turned by k/a (gd s - gd s_0)."""
    m, moment, a, V, s0 = 2.0, 0.3, 0.4, 1.5, -3.0
    k = np.sqrt(moment / m + a * a)
    v = {"sleigh": [V * np.tanh(s0), 0.0, V / k / np.cosh(s0)]}
    sleigh = body("sleigh", "planar", mass=m, inertia=moment, com=[a, 0, 0])
    edge = Closure.knife_edge("world", "sleigh", (0.0, 1.0, 0.0), "edge")
    mech = load(tmp_path, [sleigh], [edge], start={"v": v})
    sol = mbdae.solve(mech, (0, 3.1), rtol=1e-11)
    assert np.unwrap(np.arctan2(sol.q[:, 3], sol.q[:, 2]))[-1] == pytest.approx(4.09593793867471, abs=2e-10)
    assert sol.q[-1, 0] == pytest.approx(-2.889075124839, abs=2e-10)
    u, w = sol.v[:, 0], sol.v[:, 2]
    np.testing.assert_allclose(sol.lam[:, 0], m * u * w * moment / (moment + m * a * a), atol=1e-9)


def test_an_edge_under_the_centre_drifts_across_an_incline(tmp_path):
    """x = c sin^2 wt down the incline, y = c (wt - sin 2wt/2) across, c = g sin b/(2 w^2), force 2 m g sin b sin wt."""
    m, b, w = 2.0, 0.4, 2.0
    pull, c = 9.81 * np.sin(b), 0.477524242255983
    skate = body("skate", "planar", mass=m, inertia=0.3)
    edge = Closure.knife_edge("world", "skate", (0.0, 1.0, 0.0), "edge")
    tables = {"gravity": [pull, 0.0, -9.81 * np.cos(b)], "start": {"v": {"skate": [0.0, 0.0, w]}}}
    sol = mbdae.solve(load(tmp_path, [skate], [edge], **tables), (0, 5), rtol=1e-11)
    assert c == pytest.approx(pull / (2 * w * w), rel=1e-14)
    np.testing.assert_allclose(sol.q[:, 0], c * np.sin(w * sol.t) ** 2, atol=2e-10)
    np.testing.assert_allclose(sol.q[:, 1], c * (w * sol.t - np.sin(2 * w * sol.t) / 2), atol=2e-10)
    np.testing.assert_allclose(np.abs(sol.lam[:, 0]), np.abs(2 * m * pull * np.sin(w * sol.t)), atol=1e-8)


def test_a_nut_falls_along_its_screw(tmp_path):
    """a = -g/(1 + I/(m lead^2)), lead in m per radian."""
    lead, m, moment = 0.02, 0.5, 1e-3
    bodies = [body("nut", mass=m, inertia=moment)]
    closures = [Closure.cylindrical("world", "nut", name="rod"), Closure.screw("world", "nut", lead, name="thread")]
    sol = mbdae.solve(load(tmp_path, bodies, closures), (0, 2), rtol=1e-9)
    per = lead / (2 * pi)
    assert sol.q[-1, 2] == pytest.approx(-G / (1 + moment / (m * per * per)) * 2, rel=1e-9)


def test_a_planet_between_sun_and_ring(tmp_path):
    """Ring at rest: the carrier turns at w_sun r_sun/(r_sun + r_ring)."""
    hinge = {"joint": "continuous", "axis": [0.0, 0.0, 1.0]}
    bodies = [
        body("sun", **hinge), body("carrier", **hinge), body("planet", parent="carrier", xyz=[0.3, 0.0, 0.0], **hinge),
    ]  # fmt: skip
    closures = [Closure.gear("sun", "planet", (0.2, 0.1)), Closure.gear("world", "planet", (-0.4, 0.1), name="ring")]
    mech = load(tmp_path, bodies, closures, start={"v": {"sun": 3.0}})
    v = mbdae.solve(mech, (0, 3), rtol=1e-8).v
    np.testing.assert_allclose(v[:, 1], 3.0 * 0.2 / 0.6, rtol=1e-12)
    np.testing.assert_allclose(v[:, 2] + v[:, 1], -3.0 * 0.2 / (2 * 0.1), rtol=1e-12)


def car(tmp_path):
    bodies, closures = [body("car", "planar", mass=100.0, inertia=20.0)], []
    for x, y in ((0.0, 0.6), (0.0, -0.6), (1.5, 0.6), (1.5, -0.6)):
        name, parent, place = f"{'front' if x else 'rear'} {'left' if y > 0 else 'right'}", "car", [x, y, 0.3]
        if x:
            bodies.append(body(f"{name} steer", "revolute", "car", xyz=place, inertia=0.01))
            parent, place = f"{name} steer", [0.0, 0.0, 0.0]
        bodies.append(body(name, "continuous", parent, 5.0, 0.2, axis=[0.0, 1.0, 0.0], xyz=place))
        closures.append(Closure.rolling("world", name, 0.3, (0.0, 1.0, 0.0), name, contact=False))
    closures.append(Closure.coupling("front left steer", "front right steer", (0.0, 1.0), "rod"))
    steer = {"joint": "front left steer", "motion": {"kind": "polynomial", "coefficients": [0.0, 0.0, 0.2]}}
    return load(tmp_path, bodies, closures, driver=[steer], start={"guess_v": {"car": [2.0, 0.0, 0.0]}})


@pytest.mark.parametrize("options", [{"step": 0.01}, {"rtol": 1e-6, "project": False}])
def test_front_wheels_that_steer_in_parallel_are_doubted_by_name(options, tmp_path):
    sol = mbdae.solve(car(tmp_path), (0, 1), **options)
    assert sol.status == "doubtful"
    assert re.search("'front (left|right)' (slips by|depended on other closures)", sol.message)


@pytest.mark.parametrize(
    "options", [{"method": "pherk5"}, {"method": "radau5"}, {"step": 0.01, "project": True}], ids=str
)
def test_they_end_a_run_that_would_brake_the_car_to_keep_them(options, tmp_path):
    """With all rows kept, wheels in parallel only turn about the rear axle where they are not steered."""
    sol = mbdae.solve(car(tmp_path), (0, 1), **options)
    assert sol.status in ("rank", "step_size", "driver")
    assert re.search("'front (left|right)'", sol.message)
    assert sol.v[-1, 0] == pytest.approx(sol.v[0, 0], rel=1e-3)


def test_a_wheel_lets_position_rows_alone_move_the_start(tmp_path):
    """Assembly with all coordinates except height and pitch of the bicycle held moves nothing else."""
    mech = shared_model("bicycle")
    q0 = mech.start[0].copy()
    q0[2] += 0.01
    q, _ = mech.assemble(q0, mech.start[1])
    assert np.abs(mech.residual(q, np.zeros(9))[0]).max() < 1e-12
    np.testing.assert_allclose(np.delete(q, [2, 4]), np.delete(mech.start[0], [2, 4]), atol=1e-7)
    card = mbdae.info(mech)
    assert (card.dof, card.position_dof) == (3, 7)
    assert "degrees of freedom 3, 7 of positions" in str(card)
    assert "over 2 of 6 rows, 4 have no position level" in str(mbdae.drift(mbdae.solve(mech, (0, 0.1))))
    with pytest.raises(mbdae.MbdaeError, match="closure 'rear_wheel' slips by 1 m/s"):
        mech.assemble(v={"frame": [1.0, 0, 0, 0, 0, 0], "rear_wheel": 0.0})


def test_a_continuously_variable_ratio_and_a_driven_speed(tmp_path):
    hinge = {"axis": [0.0, 0.0, 1.0], "joint": "continuous"}
    bodies = [body("in", **hinge), body("out", **hinge), body("belt", "prismatic", axis=[1.0, 0.0, 0.0])]
    ratio = Closure.ratio("out", "in", (1.0, 2.0), "belt")
    speed = {"kind": "harmonic", "amplitude": 1.0, "omega": 2.0, "offset": 3.0}
    drivers = [{"joint": "in", "speed": speed}, {"joint": "belt", "speed": 0.1}]
    sol = mbdae.solve(load(tmp_path, bodies, [ratio], driver=drivers), (0, 2), rtol=1e-9)
    expected = 3.0 + sin(2 * sol.t)
    np.testing.assert_allclose(sol.v[:, 0], expected, atol=1e-12)
    np.testing.assert_allclose(sol.v[:, 1], (1 + 0.2 * sol.t) * expected, atol=1e-9)
    np.testing.assert_allclose(sol.q[:, 4], 0.1 * sol.t, atol=1e-9)
    assert abs(mbdae.drift(sol).energy_relative) < 1e-8


@pytest.mark.parametrize("form", ["index2", "ggl"])
@pytest.mark.parametrize("method", ["pherk5", "radau5"])
def test_a_bicycle_is_the_same_in_all_formulations(form, method):
    mech = mbdae.load("bicycle", speed=4.6)
    q, v = mech.start
    q, v = mech.assemble(q, v + np.array([0, -0.15, 0, 0.5, 0, 0, 0, 0, 0]))
    known = mbdae.solve(mech, (0, 0.3), q, v, rtol=1e-11).y[-1]
    sol = mbdae.solve(mech, (0, 0.3), q, v, rtol=1e-7, method=method, formulation=form)
    np.testing.assert_allclose(sol.y[-1], known, atol=2e-7)
    assert mbdae.drift(sol).Gv_max < 1e-11
