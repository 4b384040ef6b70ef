"""Balls and wheels that slide and stick with Coulomb friction: closed forms."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import quad

import mbdae
from mbdae import Closure, CoulombFriction, JointTorque, Mechanism
from mbdae.errors import InputError
from mbdae.mechanism.hybrid.mode_point import AllRows, ModePoint
from mbdae.mechanism.time_functions.time_functions import Polynomial

R, M, MU, GRAVITY = 0.1, 1.5, 0.3, 9.81


def ball(angle=0.0, **friction):
    """A ball on a plane inclined down along x."""
    model = pin.Model()
    model.gravity.linear = GRAVITY * np.array([np.sin(angle), 0, -np.cos(angle)])
    j = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(j, pin.Inertia(M, np.zeros(3), 0.4 * M * R * R * np.eye(3)), pin.SE3.Identity())
    model.addBodyFrame("centre", j, pin.SE3.Identity(), 0)
    floor = Closure.rolling("world", "centre", radius=R, name="floor")
    return Mechanism(model, [floor], [CoulombFriction(closure="floor", coefficient=MU, **friction)])


def slide_on_a_ball(backend, angle=0.6):
    """Return the solution of a ball that slides down a fixed one of radius 0.9 m, and the angles of its path."""
    near = ball(exact=True)
    top = Closure.rolling("world", "centre", radius=R, surface="sphere", surface_radius=1.0 - R, name="floor")
    s, c = np.sin(angle), np.cos(angle)
    start = {"guess": {"ball": [s, 0, c, 0, 0, 0, 1]}, "guess_v": {"ball": [1.5 * c, 0, -1.5 * s, 0, 0, 0]}}
    sol = mbdae.solve(Mechanism(near.model, [top], near.forces, start=start), (0, 0.06), rtol=1e-9, backend=backend)
    return sol, np.arctan2(sol.q[:, 0], sol.q[:, 2])


PEBBLE = """
[[body]]
name = "pebble"
parent = "world"
joint = "free"
mass = 1.0
inertia = [0.02, 0.03, 0.025, 0.0, 0.0, 0.0]
[[closure]]
name = "floor"
kind = "rolling"
frames = ["world", "pebble"]
semi_axes = [0.2, 0.25, 0.22]
[[force]]
kind = "coulomb_friction"
closure = "floor"
coefficient = 0.5
exact = true
[start]
guess = {{ pebble = [0, 0, 0.23, 0, 0, 0, 1] }}
guess_v = {{ pebble = {} }}
"""
START = np.array([0, 0, R, 0, 0, 0, 1.0])


@pytest.mark.parametrize(("heading", "backend"), [(0.0, "native"), (0.7, "native"), (0.7, "python"), (2.5, "native")])
def test_a_ball_slides_until_it_rolls(heading, backend):
    """v = v_0 - mu g t and R w = 5/2 mu g t become equal at 2 v_0/(7 mu g), where v = 5/7 v_0."""
    speed = 2.0
    v = speed * np.array([np.cos(heading), np.sin(heading), 0, 0, 0, 0])
    sol = mbdae.solve(ball(exact=True), (0, 0.4), START, v, rtol=1e-10, backend=backend)
    assert [m for _, m in sol.modes] == [(2,), (1,)]
    assert sol.t[sol.modes[1][0]] == pytest.approx(2 * speed / (7 * MU * GRAVITY), abs=1e-12)
    assert np.linalg.norm(sol.v[-1, 3:]) * R == pytest.approx(5 / 7 * speed, abs=1e-11)
    report = mbdae.drift(sol)
    assert report.energy_relative < 1e-10
    assert report.work_end == pytest.approx(-M * speed**2 / 7, rel=1e-10)
    ahead = v[:2] / speed
    for t in (0.03, 0.1):  # between steps, in any order
        assert sol(t).q[:2] == pytest.approx((speed - MU * GRAVITY * t / 2) * t * ahead, abs=1e-10)
        assert np.linalg.norm(sol(t).v[:3]) == pytest.approx(speed - MU * GRAVITY * t, abs=1e-9)
        assert sol.multipliers(t)[1:] == pytest.approx(-MU * M * GRAVITY * ahead, abs=1e-9)


@pytest.mark.parametrize("v", [[-0.91, -0.65, 0, 0.22, -0.29, 2.74], [0.72, 0.46, 0, -1.27, 1.7, -1.49]])
@pytest.mark.parametrize("method", ["pherk5", "herk5"])
def test_friction_never_drives_an_ellipsoid_whose_slip_turns(v, method, back_end, tmp_path):
    """Near rest the slip turns within a step: friction that followed rejected steps added up to 0.4 J of 1.2 J."""
    (tmp_path / "pebble.toml").write_text(PEBBLE.format(v))
    sol = mbdae.solve(tmp_path / "pebble.toml", (0, 0.12), rtol=1e-6, method=method)
    assert sol.status == "finished"
    assert np.diff(sol.signals(["energy"])["energy"]).max() < 1e-7
    assert mbdae.drift(sol).energy_relative < 1e-4
    assert back_end == sol.stats["backend"]


@pytest.mark.parametrize("down", [1, -1])
@pytest.mark.parametrize(("tangent", "mode", "acceleration"), [(1.04, 1, 5 / 7), (1.06, 2, None)])
def test_a_ball_on_an_incline_rolls_up_to_seven_halves_of_mu(tangent, mode, acceleration, down):
    angle = np.arctan(tangent)  # 7/2 mu = 1.05
    sol = mbdae.solve(ball(down * angle, exact=True), (0, 0.3), START, np.zeros(6), rtol=1e-10)
    a = GRAVITY * np.sin(angle) * acceleration if acceleration else GRAVITY * (np.sin(angle) - MU * np.cos(angle))
    assert {m for _, m in sol.modes} == {(mode,)}
    assert sol.q[-1, 0] == pytest.approx(down * a * 0.3**2 / 2, rel=1e-11)
    t = sol.t[1] / 2  # at the start the slip has no direction yet
    assert sol(t).q[0] == pytest.approx(down * a * t**2 / 2, rel=1e-8)
    assert sol.vdot[0, :3] == pytest.approx([down * a, 0, 0], abs=1e-9)


def launched_across(ratio, **given):
    """A block launched across an incline of tangent ratio mu, and its displacement to rest, after 2/3 of the run.

    v = v_0 tan(p/2)^k / sin p, k = mu/tan(incline), at the angle p to the line of greatest descent, into which it
    rotates; displacements are integrals of v^2 (cos p, sin p)/(g sin(incline) sin p) over p.
    """
    angle, speed = np.arctan(MU * ratio), 0.7
    model = pin.Model()
    model.gravity.linear = GRAVITY * np.array([np.sin(angle), 0, -np.cos(angle)])
    j = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "block")
    model.appendBodyToJoint(j, pin.Inertia(M, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    model.addBodyFrame("centre", j, pin.SE3.Identity(), 0)
    floor = Closure.rolling("world", "centre", radius=R, name="floor")
    mech = Mechanism(model, [floor], [CoulombFriction(closure="floor", coefficient=MU, exact=True)])
    end = 1.5 * speed / (GRAVITY * np.cos(angle) * MU * (1 - ratio**2))
    step = {"step": end / given.pop("steps")} if "steps" in given else {}
    sol = mbdae.solve(mech, (0, end), np.array([0, 0, R]), np.array([0, speed, 0]), **given, **step)

    def displacement(function):
        v = lambda p: speed * np.tan(p / 2) ** (1 / ratio) / np.sin(p)  # noqa: E731
        return quad(lambda p: v(p) ** 2 * function(p) / (GRAVITY * np.sin(angle)), 0, np.pi / 2, epsabs=1e-13)[0]

    return sol, (displacement(lambda p: 1 / np.tan(p)), displacement(lambda _: 1.0))


@pytest.mark.parametrize(("ratio", "method", "rtol", "backend"), [
    (0.5, "pherk5", 1e-6, "native"), (0.9, "pherk6", 1e-8, "native"), (0.97, "pherk5", 1e-6, "native"),
    (0.97, "pherk6", 1e-4, "native"), (0.6, "pherk5", 1e-5, "python")])  # fmt: skip
def test_a_block_launched_across_an_incline_comes_to_rest(ratio, method, rtol, backend):
    sol, exact = launched_across(ratio, method=method, rtol=rtol, backend=backend, max_steps=800)
    assert (sol.status, sol.modes[-1][1]) == ("finished", (1,))
    assert sol.t[sol.modes[-1][0]] == pytest.approx(2 / 3 * sol.t[-1], rel=30 * rtol / (1 - ratio))
    assert sol.q[-1, :2] == pytest.approx(exact, abs=10 * rtol)
    assert np.abs(sol.v[-1]).max() < 1e-12


@pytest.mark.parametrize(("ratio", "method", "steps", "error", "backend"), [
    (0.5, "pherk5", 50, 1e-5, "native"), (0.97, "pherk6", 50, 1e-3, "python"), (0.97, "herk3", 300, 3e-5, "native")])
def test_fixed_steps_of_a_block_end_in_rest(ratio, method, steps, error, backend):
    """They chatter where h mu g > 2 |v|; then the block crept on at up to 0.1 m/s."""
    sol, exact = launched_across(ratio, method=method, steps=steps, backend=backend)
    assert sol.modes[-1][1] == (1,)
    assert sol.status == "finished" or "'floor' slips" in sol.message
    assert sol.q[-1, :2] == pytest.approx(exact, abs=error)
    assert np.abs(sol.v[-1]).max() < 1e-12


def test_a_ball_slides_down_a_ball(back_end):
    """(w^2)' = 2 g (sin p - mu cos p) + 2 mu w^2 over the angle p, on a circle of 1 m; tangents vary continuously."""
    sol, p = slide_on_a_ball(back_end)
    assert [m for _, m in sol.modes] == [(2,)]
    assert p[0] < np.arccos(0.8) < p[-1]
    a = GRAVITY * (4 * MU**2 - 2) / (1 + 4 * MU**2)
    particular = a * np.cos(p) + 2 * MU * (a - GRAVITY) * np.sin(p)
    squares = particular + (1.5**2 - particular[0]) * np.exp(2 * MU * (p - p[0]))
    assert (sol.v[:, :3] ** 2).sum(1) == pytest.approx(squares, rel=1e-8)


def test_no_slip_begins_where_tangents_are_undefined():
    """Its direction would be another one along the tangents of the next step: a wrong friction without a message."""
    sol, _ = slide_on_a_ball("native", np.pi)
    assert (sol.status, len(sol.t)) == ("singular", 1)
    assert "'floor grip' begins to slide where the normal is -z of its first frame" in sol.message


def test_the_guard_of_a_slip_keeps_its_first_direction():
    """From rest it is the direction of the impending slip, which later steps change."""
    mech = ball(exact=True)
    system, (grip,) = mech.system(), mech.switches
    value, directions = grip.slip_guard().value, system.closure_friction.directions[0]
    rest, moves = (ModePoint(system, AllRows(system), 0.0, np.array([*START, *6 * [v], 0.0])) for v in (0.0, 1.0))
    directions[:] = [0.6, 0.8]
    assert value(rest) == 0.0
    before = value(moves)
    directions[:] = [0.8, -0.6]
    assert value(moves) == before != 0.0


def test_a_driven_wheel_slips_above_its_friction_limit():
    """lam = torque m R/(I + m R^2) reaches mu_s m g; then the angular acceleration is (torque - mu m g R)/I."""
    inertia, ramp, static = 0.02, 3.0, 0.5
    model = pin.Model()
    model.gravity.linear = np.array([0, 0, -GRAVITY])
    cart = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "cart")
    wheel = model.addJoint(cart, pin.JointModelPZ(), pin.SE3.Identity(), "height")
    wheel = model.addJoint(wheel, pin.JointModelRUBY(), pin.SE3.Identity(), "wheel")
    body = pin.Inertia(M, np.zeros(3), np.diag([0.01, inertia, 0.01]))
    model.appendBodyToJoint(wheel, body, pin.SE3.Identity())
    model.addBodyFrame("hub", wheel, pin.SE3.Identity(), 0)
    road = Closure.rolling("world", "hub", radius=R, axis=(0, 1, 0), name="road", grip="longitudinal")
    friction = CoulombFriction(closure="road", coefficient=MU, static=static)
    torque = JointTorque(joint="wheel", torque=Polynomial(coefficients=(0.0, ramp)))
    mech = Mechanism(model, [road], [friction, torque])
    slips = static * M * GRAVITY * (inertia + M * R * R) / (ramp * M * R)
    sol = mbdae.solve(mech, (0, slips + 0.2), np.array([0, R, 1, 0]), np.zeros(3), rtol=1e-10)
    assert [m for _, m in sol.modes] == [(1,), (2,)]
    assert sol.t[sol.modes[1][0]] == pytest.approx(slips, abs=1e-12)
    before = ramp * slips**2 / 2 * R / (inertia + M * R * R)
    assert sol.v[-1, 0] == pytest.approx(before + MU * GRAVITY * 0.2, abs=1e-10)
    turned = (ramp * ((slips + 0.2) ** 2 - slips**2) / 2 - MU * M * GRAVITY * R * 0.2) / inertia
    assert sol.v[-1, 2] == pytest.approx(before / R + turned, rel=1e-10)


def test_wrong_grip_is_rejected():
    with pytest.raises(InputError, match="the grip of 'floor' needs exact = true, or grip = 'none'"):
        ball()
    with pytest.raises(InputError, match="velocity belongs to regularized friction"):
        ball(exact=True, velocity=0.1)
    with pytest.raises(InputError, match=r"static is at least coefficient, 0.3, got 0.2"):
        ball(static=0.2)
