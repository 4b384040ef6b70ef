"""Curves of poses: against closed forms, at dead points and branch points, and invalid input."""

import json

import numpy as np
import pinocchio as pin
import pytest
from four_bar_angles import angles, derivatives
from linkages import bar, four_bar, parallelogram, point

import mbdae
from mbdae import Closure, Driver, Mechanism, kinematics
from mbdae.errors import AssemblyError, InputError, StepError
from mbdae.mechanism.closures.constraints import Constraints
from mbdae.mechanism.tree.frames import frame_paths
from mbdae.mechanism.tree.joints import angle_components
from mbdae.studies.kinematics.curve.pose_curve import PoseCurve
from mbdae.studies.kinematics.driven_mechanism import driven_mechanism

COMMANDS = ("kinematics four_bar --drive rocker --points 20", "assembly-modes four_bar --drive crank")
LEGS = [f"piston_{i}" for i in range(2, 7)]


def closed_form(theta):
    """Angles of coupler and rocker, their rates and accelerations per unit of the crank, and the angle between them."""
    phi, psi = angles(theta)
    return phi, psi, *derivatives(theta, phi, psi), abs(np.sin(phi - psi))


def test_a_curve_has_no_point_where_closures_lose_rank():
    """The flat parallelogram: exactly there the curvature is that of no branch, 1e-9 rad beside it there is one."""
    mech, q = parallelogram(), np.array([5e-10, -5e-10, 5e-10])
    curve = PoseCurve(driven_mechanism(mech, "crank", (), q).system(), angle_components(mech.model))
    close = curve.set_start(q, q[0])
    assert curve.at_input(close, 0.0) is None
    assert curve.at_input(close, 4e-10) is not None


def test_four_bar_over_two_turns():
    found = kinematics(mbdae.load("four_bar"), "crank", turns=2, points=92)
    assert len(found.u) == 92
    np.testing.assert_allclose(np.diff(found.u), 4 * np.pi / 91, atol=1e-13)
    phi, psi, p, s, dp, ds, mu = np.array([closed_form(u) for u in found.u]).T
    angles = np.unwrap([phi, psi])
    np.testing.assert_allclose(found.q, np.array([found.u, angles[0] - found.u, angles[1]]).T, rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.rates, np.array([p**0, p - 1, s]).T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.accelerations, np.array([0 * p, dp, ds]).T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.sin(found.transmission), mu, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.ratio("rocker"), s, rtol=0, atol=1e-12)
    assert found.segments[0].ended == "range"
    assert not found.dead_points


def test_points_of_numpy_and_one_frame():
    found = kinematics(mbdae.load("four_bar"), "crank", points=np.int64(5))
    np.testing.assert_array_equal(found.frames("coupler_tip"), found.frames(["coupler_tip"]))
    with pytest.raises(InputError, match="names is a list of frames, got 5"):
        found.frames(5)


def test_frames_move_as_difference_quotients_say():
    mech, h = mbdae.load("four_bar"), 1e-4
    found = kinematics(mech, "crank", span=(1.0, 1.0 + 8 * h), points=9)
    position, velocity, acceleration = found.frames(["coupler_tip"])
    np.testing.assert_allclose(position, frame_paths(mech.model, ["coupler_tip"], found.q), atol=1e-15)
    np.testing.assert_allclose(velocity[0, 4], (position[0, 5] - position[0, 3]) / (2 * h), atol=1e-7)
    np.testing.assert_allclose(acceleration[0, 4], (velocity[0, 5] - velocity[0, 3]) / (2 * h), atol=1e-7)


def test_rocker_driven_turns_back_at_dead_points():
    found = kinematics(mbdae.load("four_bar"), "rocker")
    dead = sorted(u for u, _ in found.dead_points)
    np.testing.assert_allclose(dead, [np.arccos(2.75 / 6), np.arccos(-0.875)], rtol=0, atol=1e-12)
    x = found.segments[0]
    assert (x.ended, x.low, x.high) == ("closed", pytest.approx(dead[0]), pytest.approx(dead[1]))
    assert not np.isfinite(found.rates).all()
    assert np.isfinite(found.tangent).all()
    at = [np.abs(found.u - u).argmin() for u in dead]
    np.testing.assert_allclose(np.sin(found.transmission[at]), 0, atol=1e-9)  # crank and coupler in line
    assert np.ptp(found.q[:, 0]) == pytest.approx(2 * np.pi)


def test_slider_driven():
    found = kinematics(mbdae.load("slider_crank"), "slider")
    assert found.unit == "m"
    np.testing.assert_allclose([u for u, _ in found.dead_points], [0.45, 0.25], rtol=0, atol=1e-14)
    cranks = [q[0] for _, q in found.dead_points]
    np.testing.assert_allclose(cranks, [0, -np.pi], rtol=0, atol=1e-12)


def test_parallelogram_has_two_branches_through_pi():
    mech = parallelogram()
    found = kinematics(mech, "crank", span=(0.5, 5.5), branches=True, points=51)
    (crossing,) = found.branch_points
    np.testing.assert_allclose([crossing.u, *crossing.q], [np.pi, np.pi, -np.pi, np.pi], rtol=0, atol=1e-12)
    first, *others = (slice(x.first, x.last) for x in found.segments)
    np.testing.assert_allclose(found.q[first, 2], found.u[first], atol=1e-12)  # rocker and crank stay parallel
    assert len(others) == 2
    for part in others:  # tan(rocker/2) = -(ground + crank)/(ground - crank) tan(crank/2)
        inside = np.abs(found.u[part] - np.pi) > 1e-3
        u, rocker = found.u[part][inside], found.q[part, 2][inside]
        assert np.abs(rocker - u).max() > 1
        np.testing.assert_allclose(np.tan(rocker / 2), -3.0 * np.tan(u / 2), rtol=1e-8)
    low, high = sorted((x.low, x.high) for x in found.segments[1:])
    np.testing.assert_allclose([low, high], [[0.5, np.pi], [np.pi, 5.5]], atol=1e-12)
    for q in found.q:
        assert np.abs(mech.residual(q, np.zeros(3))[0]).max() < 1e-12


@pytest.mark.parametrize("longer", [1e-2, 1e-3, 1e-5, 1e-8])
def test_where_branches_pass_each_other_the_curve_turns_back(longer, monkeypatch):
    """A parallelogram with a slightly longer ground: its crank stops short of pi, cos u = (d^2 + 1 - 9) / 2 d.

    Steps that jump to the other branch are repeated, and leave no branch points.
    """
    curves, set_start = [], PoseCurve.set_start
    monkeypatch.setattr(PoseCurve, "set_start", lambda self, *pose: curves.append(self) or set_start(self, *pose))
    d = 2.0 + longer
    mech = four_bar((1.0, 2.0, 1.0, d), {"q": {"crank": 1.0}, "guess": {"coupler": -1.0, "rocker": 1.0}})
    found = kinematics(mech, "crank")
    limit = np.arccos((d**2 - 8) / (2 * d))
    np.testing.assert_allclose(np.sort([u for u, _ in found.dead_points]), [-limit, limit], rtol=0, atol=1e-9)
    assert not found.branch_points
    assert found.segments[0].ended == "closed"
    assert all(c.nodes[i].sigma * c.nodes[i + 1].sigma < 0 for c in curves for i in c.branch_points)


def test_a_dead_point_where_the_curve_begins():
    """Bars of 0.1 m and 0.3 m in line: the slider begins at its farthest position."""
    mech = mbdae.load("slider_crank")
    found = kinematics(mech, "slider", q=mech.assemble({"crank": 0.0})[0])
    np.testing.assert_allclose([u for u, _ in found.dead_points], [0.45, 0.25], rtol=0, atol=1e-12)
    assert len(np.unique(found.s)) == len(found.s)


def test_several_branches_at_once_are_reported():
    found = kinematics(mbdae.load("n_four_bar?N=2"), "crank_0", points=31)
    np.testing.assert_allclose(found.hidden, [np.pi, 2 * np.pi], atol=1e-4)
    assert not found.branch_points
    assert "more than two branches intersect near 3.1415" in str(found)
    np.testing.assert_allclose(np.cos(found.q[:, 2] - found.u), 1, atol=1e-9)


def test_a_pose_of_lost_rank_on_the_grid_is_the_branch_point():
    found = kinematics(parallelogram(), "crank", span=(np.pi - 1, np.pi + 1), points=3)
    np.testing.assert_allclose(found.q[1], [np.pi, -np.pi, np.pi], atol=1e-12)
    np.testing.assert_allclose(found.rates[1], [1, -1, 1], atol=1e-12)
    assert np.isnan(found.accelerations[1]).all()
    assert np.isnan(found.transmission[1])


@pytest.mark.parametrize("n", [2, 3, 4, 5])
def test_a_pose_where_several_branches_cross_on_the_grid(n):
    """All loops are flat at u = 0, where no tangent exists: the sample there lies at most 1e-5 of a step beside it."""
    found = kinematics(mbdae.load(f"n_four_bar?N={n}"), "crank_0", span=(-0.5, 0.5), points=51)
    i = int(np.abs(found.u).argmin())
    assert abs(found.u[i]) < 1e-5
    np.testing.assert_allclose(found.q[i], found.u[i] * (-1.0) ** np.arange(found.q.shape[1]), rtol=0, atol=1e-9)


def test_stewart_platform_by_one_leg():
    mech = mbdae.load("stewart_platform")
    found = kinematics(mech, "piston_1", hold=LEGS)
    assert found.segments[0].ended == "closed"
    assert max(np.abs(mech.residual(q, np.zeros(mech.nv))[0]).max() for q in found.q) <= 1e-14
    for name in LEGS:
        np.testing.assert_allclose(np.ptp(found.signals()[f"q.{name}"]), 0, atol=1e-14)
    assert len(found.dead_points) == 4
    ahead = mech.manifold.difference(found.q[10], found.q[11])
    along = (found.u[11] - found.u[10]) * (found.rates[10] + found.rates[11]) / 2
    np.testing.assert_allclose(ahead, along, atol=1e-4)


def test_a_driver_of_a_length_is_a_drive():
    plain = mbdae.load("four_bar")
    (tip,) = frame_paths(plain.model, ["coupler_tip"], plain.start[0][None])
    length = Driver.at_speed(("world", "coupler_tip"), 0.1, start=float(np.linalg.norm(tip)), name="cylinder")
    mech = mbdae.load("four_bar", drivers=[length])
    found = kinematics(mech, "cylinder", span=(2.4, 2.6), points=21)
    tip = found.frames(["coupler_tip"])[0][0]
    np.testing.assert_allclose(np.linalg.norm(tip, axis=1), found.u, atol=1e-13)
    step = found.u[1] - found.u[0]
    rate = (found.q[2:] - found.q[:-2]) / (2 * step)
    np.testing.assert_allclose(found.rates[1:-1], rate, atol=5e-3)
    np.testing.assert_allclose(
        found.accelerations[1:-1], (found.rates[2:] - found.rates[:-2]) / (2 * step), rtol=0.05, atol=0.05
    )


def test_the_curve_is_the_same_backwards_and_from_another_start():
    mech = mbdae.load("four_bar")
    up, down = kinematics(mech, "crank", span=(0.5, 2.5)), kinematics(mech, "crank", span=(2.5, 0.5))
    np.testing.assert_allclose(up.q, down.q[::-1], atol=1e-13)
    np.testing.assert_allclose(up.accelerations, down.accelerations[::-1], atol=1e-11)


def test_a_run_follows_the_curve(tmp_path):
    found = kinematics(mbdae.load("four_bar"), "crank", points=61)
    run = found.run(speed=2.0)
    t = 0.5 * (run.t[3] + run.t[4])
    phi, psi, *_ = closed_form(found.u[0] + 2.0 * t)
    np.testing.assert_allclose(run(t).q, [found.u[0] + 2 * t, phi - found.u[0] - 2 * t, psi], atol=1e-6)
    mbdae.animate(kinematics(mbdae.load("four_bar"), "rocker").run(), tmp_path / "curve.html")
    assert (tmp_path / "curve.html").stat().st_size > 1e5
    with pytest.raises(InputError, match="reverses at dead points"):
        kinematics(mbdae.load("four_bar"), "rocker").run(speed=1.0)
    for speed in ("fast", 0.0):
        with pytest.raises(InputError, match=f"speed must be a number other than zero, got {speed!r}"):
            found.run(speed=speed)
    for segment in (1, -1, 0.5):
        with pytest.raises(InputError, match=f"segment must be a whole number from 0 to 0, got {segment}"):
            found.run(segment)


def test_a_table_is_written(tmp_path):
    found = kinematics(mbdae.load("slider_crank"), "crank", points=11)
    found.save(tmp_path / "poses.csv")
    names = (tmp_path / "poses.csv").read_text().splitlines()[0].split(",")
    assert {"u", "q.slider", "v.slider", "a.slider", "position.rod_tip.x", "transmission"} <= set(names)
    found.save(tmp_path / "poses.json")
    assert len(json.loads((tmp_path / "poses.json").read_text())["table"]["u"]) == 11
    with pytest.raises(InputError, match=r"\.csv or \.json"):
        found.save(tmp_path / "poses.txt")


@pytest.mark.parametrize(
    ("model", "arguments", "words"),
    [
        ("four_bar", {"drive": "crank", "hold": "rocker"}, "no degree of freedom is left for 'crank'"),
        ("stewart_platform", {"drive": "piston_1"}, "hold 5 joints besides 'piston_1', for instance piston_2"),
        ("stewart_platform", {"drive": "platform"}, "'platform' has 6 coordinates"),
        ("four_bar", {"drive": "crank", "hold": "crank"}, "'crank' is driven: it cannot be locked, too"),
        ("four_bar", {"drive": "crank", "span": (1, 1)}, "two different numbers"),
        ("four_bar", {"drive": "crank", "span": (1.2, 1.2 + 1e-9)}, "span is too short"),
        ("four_bar", {"drive": "crank", "turns": 0}, "turns must be"),
        ("four_bar", {"drive": "crank", "points": 1}, "at least 2"),
        ("four_bar", {"drive": "crank", "output_joint": "nosuch"}, "unknown joint 'nosuch'"),
        ("andrews_squeezer", {"drive": "nosuch"}, "unknown drive 'nosuch'"),
        ("four_bar", {"drive": ["crank"]}, r"unknown drive \['crank'\]"),
        ("four_bar", {"drive": "crank", "hold": [["rocker"]]}, r"hold is a list of joints, got \['rocker'\]"),
    ],
)
def test_wrong_input_is_one_line(model, arguments, words):
    with pytest.raises(InputError, match=words):
        kinematics(mbdae.load(model), **arguments)


def test_a_drive_that_cannot_move():
    mech = mbdae.load("four_bar")
    q = mech.start[0]
    both = mbdae.load("four_bar", closures=[Closure.coupling("crank", "rocker", (q[0] - q[2], 1.0))])
    with pytest.raises(InputError, match="no degree of freedom is left"):
        kinematics(both, "crank")
    model = pin.Model()
    bar(model, 0, (0, 0), 1.0, "pinned")
    bar(model, 0, (2, 0), 1.0, "free")
    point(model, 0, (1.0, 0.0), "peg")
    with pytest.raises(InputError, match="'pinned' cannot move"):
        kinematics(Mechanism(model, [Closure.point("peg", "pinned_tip")]), "pinned")


def test_a_singular_start_and_a_start_out_of_reach_are_rejected():
    with pytest.raises(InputError, match="lose rank in this pose"):
        kinematics(parallelogram(), "crank", q=np.zeros(3))
    with pytest.raises(AssemblyError, match="cannot start at 3"):
        kinematics(mbdae.load("four_bar"), "rocker", span=(3.0, 4.0))


@pytest.mark.parametrize("value", ["abc", True, 1j, 10**400, float("nan")])
def test_joints_are_locked_at_finite_numbers(value):
    with pytest.raises(InputError, match="'slider' is locked at a finite number in rad or m, got"):
        kinematics(mbdae.load("slider_crank"), "crank", hold={"slider": value})


def test_a_driver_that_is_undefined_at_the_time_of_its_lock():
    table = {"kind": "table", "points": [(1.0, 0.3), (2.0, 0.4)]}
    mech = mbdae.load("slider_crank", drivers=[Driver(joint="slider", motion=table, name="late")])
    with pytest.raises(InputError, match=r"'late' is known from t = 1 to 2 s only.*locked at its value at t = 0"):
        kinematics(mech, "crank", q=mech.assemble(t=1.0)[0])


def test_a_pose_costs_six_evaluations_of_the_closures(monkeypatch):
    """On average, 608 for a hundred; with Euler's predictor, which needs more corrections, 788."""
    evaluations, motion = [], Constraints.motion
    monkeypatch.setattr(Constraints, "motion", lambda self, t: evaluations.append(t) or motion(self, t))
    assert len(kinematics(mbdae.load("four_bar"), "crank", points=100).u) == 100
    assert len(evaluations) <= 7 * 100


def test_what_slides_away_is_named(monkeypatch):
    """Upright on the axle, the left wheel goes to infinity where the road comes to the height of the axle's length."""
    mech, seen, step = mbdae.load("car_axis"), [], PoseCurve.step
    monkeypatch.setattr(PoseCurve, "step", lambda *given: seen.append(given) or step(*given))
    with pytest.raises(StepError, match=r"'left_x' slides without bound as 'road' approaches 1: give a span that ends"):
        mbdae.kinematics(mech, "road", hold=["left", "right"])
    assert len(seen) < 500, "a hundred lengths in steps of 0.4"
    curve = mbdae.kinematics(mech, "road", hold=["left", "right"], span=(0.0, 0.9), points=10)
    at = list(mech.joint_names).index("left_x")
    y = curve.u
    np.testing.assert_allclose(curve.q[:, at], -0.5 * y / np.sqrt(1 - y**2), atol=1e-9)
