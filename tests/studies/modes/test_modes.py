"""Modes: published and closed-form values, the flow of runs, and errors by name."""

import json

import numpy as np
import pytest
from browser import Chromium
from click.testing import CliRunner
from motions import frozen
from scipy.linalg import expm

import mbdae
from mbdae import Closure, Mechanism
from mbdae.__main__ import cli
from mbdae.errors import InputError
from mbdae.mechanism.formats.mechanism_file.template import Template

COMMANDS = (
    "modes double_pendulum --html modes.html --plot modes.png",
    "root-locus double_pendulum gravity.2=-20:-5:4 --plot locus.png",
    "linearize double_pendulum --inputs joint1 --outputs q.joint2",
)
SPEED = 2 * np.pi


def pairs(values):
    """Eigenvalues above the real axis, by their imaginary part."""
    return sorted((z for z in values if z.imag > 0), key=lambda z: z.imag)


def test_four_bar_with_a_diagonal_spring():
    """IFToMM's benchmark: the closed form in one coordinate, and the published damped root."""
    found = mbdae.modes(mbdae.load("spring_four_bar"))
    assert abs(pairs(found.eigenvalues)[0] - 2.14767663850228j) < 1e-12
    damped = Template("spring_four_bar").make({"force.diagonal.damping": 1.0})
    assert abs(pairs(mbdae.modes(damped).eigenvalues)[0] - (-0.2423858093 + 2.1339550282j)) < 1e-9
    assert found.frequencies[0] == pytest.approx(2.14767663850228 / (2 * np.pi))


def test_a_governor_with_a_free_shaft():
    """The reduced closed form; the free shaft leaves two zeros, which rounding does not split."""
    found = mbdae.modes(mbdae.load("flyball_governor"), v={"shaft": SPEED})
    slow = min(pairs(found.eigenvalues), key=abs)
    assert abs(slow.real - -9.117964e-6) < 1e-11
    assert abs(slow.imag - 6.45591416) < 1e-8
    assert np.count_nonzero(found.eigenvalues == 0) == 2
    held = mbdae.modes(mbdae.load("flyball_governor"), v={"shaft": SPEED}, hold="shaft")
    assert np.count_nonzero(held.eigenvalues == 0) == 0
    assert len(held.eigenvalues) == 6


@pytest.mark.parametrize("spin", [150.0, 250.0])
def test_a_sleeping_top(spin):
    """lambda = i (spin - a) +- sqrt(m g l/I_1 - a^2), a = I_3 spin/(2 I_1), in the axes of the body."""
    I1, I3, couple = 15.0 + 0.234375, 0.46875, 15 * 9.81
    a = I3 * spin / (2 * I1)
    root = np.sqrt(complex(couple / I1 - a * a))
    expected = [1j * (spin - a) + s * root for s in (1, -1)]
    found = mbdae.modes(mbdae.load("sleeping_top", spin=spin))
    assert found.around == "start"
    for z in expected:
        assert np.abs(found.eigenvalues - z).min() < 1e-9
    assert np.count_nonzero(found.eigenvalues == 0) == 2
    assert found.stable == (spin > 2 * np.sqrt(couple * I1) / I3)


WHIPPLE = {  # Meijaard, Papadopoulos, Ruina, Schwab, Proc. R. Soc. A 463 (2007), table 2: weave, capsize, castering
    1: (3.52696170990070 + 0.80774027519930j, -3.13423125066578, -7.11008014637442),
    4: (0.41325331521125 + 3.07910818603206j, -1.42944427361326, -12.15861426576447),
    5: (-0.77534188219585 + 4.46486771378823j, -0.32286642900409, -14.07838969279822),
    6: (-1.52644486584142 + 5.87673060598709j, -0.00406690076970, -16.08537123098026),
    10: (-3.72016840437287 + 10.90681139476287j, 0.16105338653172, -24.62459635017404),
}


@pytest.mark.parametrize("speed", WHIPPLE)
def test_a_bicycle_rolls(speed):
    """Velocity rows leave more positions than speeds; six zeros are positions, wheel angles, and the speed itself."""
    found = mbdae.modes(mbdae.load("bicycle", speed=float(speed))).eigenvalues
    for root in WHIPPLE[speed]:
        assert np.abs(found - root).min() < 1e-12
    assert np.count_nonzero(found == 0) == 6
    assert len(found) == 10


FLOWS = {"four_bar": 0.6, "bricard": 0.6, "panda_handle": 0.2, "stewart_platform": 0.06, "delta_robot": 0.06}


@pytest.mark.parametrize("name", FLOWS)
def test_runs_flow_as_the_linear_system_says(name):
    """exp(A T) is the derivative of the end of runs with respect to their start: differences of four runs."""
    mech, T, a = frozen(mbdae.load(name)), FLOWS[name], 2e-4
    rest = mbdae.equilibrium(mech)
    motion = mbdae.modes(mech, rest.q).motion
    system, nv = mech.system(), mech.nv
    columns = []
    for change in motion.perturbation_map.T:
        ends = {}
        for k in (-2, -1, 1, 2):
            q = mech.manifold.integrate(rest.q, k * a * change[:nv])
            y = system.project_state(0.0, np.concatenate([q, k * a * change[nv : 2 * nv], rest.s, [0.0]]), tight=True)
            s = rest.s + k * a * change[2 * nv :]
            sol = mbdae.solve(mech, (0, T), *system.split(y), s=s, method="pherk6", step=T / 200)
            ends[k] = motion.state(mech.manifold.difference(rest.q, sol.q[-1]), sol.v[-1], sol.s[-1] - rest.s)
        columns.append((8 * (ends[1] - ends[-1]) - (ends[2] - ends[-2])) / (12 * a))
    expected = expm(motion.A * T)
    assert np.abs(np.array(columns).T - expected).max() < 1e-9 * np.abs(expected).max()


def test_shapes_move_along_the_closures_with_unit_mass():
    mech = mbdae.load("panda_handle")
    found = mbdae.modes(mech)
    system = mech.system()
    U, G = system.inertia(0.0, found.motion.q), system.closures(found.motion.q)[1]
    for root, shape in zip(found.roots, found.shapes, strict=True):
        assert np.linalg.norm(U @ shape) == pytest.approx(1.0)
        assert np.abs(G @ shape).max() < 1e-12
        z = np.concatenate([shape, root * shape])
        y = motion_state(found.motion, z, mech.nv)
        np.testing.assert_allclose(found.motion.A @ y, root * y, atol=1e-9 * np.abs(y).max() * (1 + abs(root)))


def motion_state(motion, z, nv):
    real, imag = (motion.state(part[:nv], part[nv:], np.empty(0)) for part in (z.real, z.imag))
    return real + 1j * imag


def test_many_loops_at_once():
    found = mbdae.modes(mbdae.load("n_four_bar", N=10))
    hanging = (11 / 2 + 10) * 9.81 / (11 / 3 + 10)  # bars of 1 m and 1 kg: cranks rotate, couplers only translate
    assert abs(pairs(found.eigenvalues)[0].imag - np.sqrt(hanging)) < 1e-10


# -- the command, and rejections --------------------------------------------------------------------------------------


def test_the_command_writes_eigenvalues_as_pairs():
    said = CliRunner().invoke(cli, ["modes", "sleeping_top", "--json"])
    data = json.loads(said.stdout)
    assert said.exit_code == 1  # it grows
    roots = [complex(*pair) for pair in data["eigenvalues"]]
    assert max(z.real for z in roots) == pytest.approx(2.0817380085, abs=1e-9)
    assert {"frequency", "damping", "shape", "eigenvalue"} == set(data["modes"][0])


CHOOSE = """
  const select = byId("choice"), moving = nodeOf(mbdae.viewer, "mechanism");
  log.names = [...select.options].map(option => option.text);
  log.places = [0, 1].map(k => {
    select.value = k;
    select.onchange();
    mbdae.seek(1.0);
    log.said = byId("clock").textContent;
    const out = [];
    moving.traverse(part => out.push(part.quaternion.x, part.quaternion.y, part.quaternion.z));
    return out;
  });
"""


@pytest.mark.slow
def test_the_page_shows_the_mode_that_is_chosen(tmp_path):
    found = mbdae.modes(mbdae.load("four_bar"))
    arm = mbdae.modes(mbdae.load("panda_handle"))
    log = Chromium().ask(arm.animate(tmp_path / "modes.html"), CHOOSE)
    assert log["names"] == [f"mode {i + 1}: {arm.describe(i)}" for i in range(4)]
    assert log["said"].endswith(f" s, {log['names'][1]}")
    first, second = np.array(log["places"])
    assert np.abs(first - second).max() > 0.01
    assert 'id="choice"' in found.animate(tmp_path / "one.html").read_text()


def test_a_cycle_of_a_mode_keeps_the_loops_closed():
    found = mbdae.modes(mbdae.load("panda_handle"))
    q = found.configurations(1, 0.05)
    moved = np.array([found.mechanism.manifold.difference(found.motion.q, x) for x in q])
    assert 0.045 < np.abs(moved).max() < 0.055
    assert max(np.abs(found.mechanism.residual(x, np.zeros(8))[0]).max() for x in q) < 1e-12
    np.testing.assert_allclose(q[0], q[-1], atol=1e-12)
    for wrong in (0, -0.1, np.nan, "x"):
        with pytest.raises(InputError, match="the amplitude must be a positive number in rad or m, got"):
            found.configurations(1, wrong)


@pytest.mark.parametrize(
    ("name", "named", "text"),
    [
        ("four_bar", {"hold": "crank"}, "has no degree of freedom left with crank locked"),
        ("four_bar", {"q": None, "v": {"crank": 1.0}}, "do not satisfy the closures|are not steady"),
        ("double_pendulum", {"v": {"joint1": 1.0}}, "not steady"),
    ],
)
def test_what_has_no_modes_says_why(name, named, text):
    with pytest.raises(mbdae.MbdaeError, match=text):
        mbdae.modes(mbdae.load(name), **named)


@pytest.mark.parametrize("study", [mbdae.equilibrium, mbdae.modes])
def test_a_speed_that_needs_a_varying_torque_is_not_steady(study):
    """A pendulum that turns at constant speed; without gravity the torque is that of its damping, b w."""
    arm = {"name": "arm", "parent": "world", "axis": [0, 1, 0], "mass": 1.0, "com": [0, 0, -0.5]}
    damping = {"kind": "joint_damping", "joint": "arm", "damping": 0.1}
    tables = {"body": [arm], "force": [damping], "start": {"q": {"arm": 1.0}}}
    with pytest.raises(InputError, match="not steady: the forces change along the motion, most at joint 'arm'"):
        study(tables, v={"arm": 3.0})
    found = study({**tables, "gravity": [0, 0, 0]}, v={"arm": 3.0})
    if study is mbdae.equilibrium:
        assert found.holding["arm"] == pytest.approx(0.1 * 3.0, rel=1e-12)
    else:
        assert found.eigenvalues == pytest.approx([0.0, -0.1 / 0.25], rel=1e-12)


def test_a_pose_that_is_no_equilibrium_is_rejected():
    mech = mbdae.load("four_bar")
    with pytest.raises(InputError, match=r"neither an equilibrium nor a steady motion: joint 'coupler' accelerates"):
        mbdae.modes(mech, mech.start[0])


def test_a_start_that_turns_its_coordinates_is_no_steady_motion():
    """The centre of a disc that rolls in a circle accelerates, and upright discs at rest are unstable."""
    text = r"no stable equilibrium found .*; the start moves, but this is neither an equilibrium nor a steady motion: j"
    with pytest.raises(mbdae.errors.EquilibriumError, match=text):
        mbdae.modes(mbdae.load("rolling_disc", inclination="1.0"))


def test_passing_an_equilibrium_is_no_steady_motion():
    """Upright and moving, the acceleration is zero for a moment; the modes are those of the pose found, at rest."""
    found = mbdae.modes(mbdae.load("n_four_bar"))
    assert found.around == "equilibrium"
    assert not found.motion.v.any()


def test_frozen_drivers_are_named_with_their_speeds():
    """A governor whose shaft is driven: its balls hang down unless the speed is given, and no force holds them up."""
    governor = mbdae.load("flyball_governor", drivers=[mbdae.Driver.at_speed("shaft", SPEED)])
    with pytest.warns(UserWarning, match=r"freezes 'shaft driver' at t = 0 s, without its speed of 6.28319 rad/s"):
        mbdae.modes(governor)
    assert "frozen: 'shaft driver' at t = 0 s, without its speed" in str(mbdae.equilibrium(governor))
    moving = mbdae.modes(governor, v={"shaft": SPEED})
    held = mbdae.modes(mbdae.load("flyball_governor"), v={"shaft": SPEED}, hold="shaft")
    assert moving.eigenvalues == pytest.approx(held.eigenvalues, rel=1e-9)


def test_a_pose_in_which_closures_lose_rank_is_rejected():
    mech = Template("n_four_bar?N=1").make({"gravity": [0.0, 0.0, 0.0]})
    with pytest.raises(InputError, match="lose rank"):
        mbdae.modes(mech, np.zeros(3))


def test_a_free_body_has_zero_eigenvalues():
    """A body in space: six degrees of freedom, twelve zeros and no vibration mode."""
    model = mbdae.load("heavy_top").model
    model = type(model)(model)
    model.gravity.linear = np.zeros(3)
    found = mbdae.modes(Mechanism(model))
    assert np.count_nonzero(found.eigenvalues == 0) == 12
    ball = Mechanism(model, [Closure.point("world", "tip")])
    assert np.count_nonzero(mbdae.modes(ball, ball.assemble(mbdae.load("heavy_top").start[0])[0]).eigenvalues == 0) == 6


def test_locked_joints_do_not_move_in_the_cycle_of_a_mode():
    """Closing the loops moves the others alone."""
    mech = mbdae.load("stewart_platform")
    found = mbdae.modes(mech, hold="leg_1")
    assert len(found.locked) == 2
    moved = np.array([mech.manifold.difference(found.motion.q, q) for q in found.configurations(0)])
    assert np.abs(moved[:, found.locked]).max() < 1e-14
    assert np.abs(moved).max() > 0.2
