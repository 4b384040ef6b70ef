"""Half a period whose end exchanges a joint with its opposite: on the command line, and along a branch."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

import mbdae
from mbdae.__main__ import cli
from mbdae.errors import InputError

OMEGA, DAMPING, G = 2.0, 2.0, 9.81
AMPLITUDE = "force.motor.torque.amplitude"
SWING = """
title = "A damped pendulum under a harmonic torque"
gravity = [0.0, 0.0, -9.81]
[[body]]
name = "rod"
parent = "world"
axis = [0.0, 1.0, 0.0]
mass = 1.0
com = [0.0, 0.0, -1.0]
[[force]]
kind = "joint_damping"
joint = "rod"
damping = 2.0
[[force]]
name = "motor"
kind = "joint_torque"
joint = "rod"
torque = { kind = "harmonic", amplitude = 4.0, omega = 2.0 }
"""


@pytest.fixture(scope="module")
def swing(tmp_path_factory):
    path = tmp_path_factory.mktemp("swing") / "swing.toml"
    path.write_text(SWING)
    return str(path)


def test_half_a_swing_on_the_command_line(swing):
    """A whole period has the square of its monodromy matrix."""
    half = ["periodic", swing, "--exchange", "rod=-rod", "-t", repr(np.pi / OMEGA), "--json"]
    halves = json.loads(CliRunner().invoke(cli, half).stdout)
    whole = mbdae.periodic(swing)
    assert pytest.approx(2 * halves["T"], rel=1e-12) == whole.T
    multipliers = np.array([complex(*z) for z in halves["multipliers"]])
    np.testing.assert_allclose(np.poly(multipliers**2), np.poly(whole.multipliers), rtol=1e-8)
    wrong = CliRunner().invoke(cli, ["periodic", swing, "--exchange", "rod"])
    assert str(wrong.exception) == "--exchange takes name=text, got 'rod'"


def after_a_period(start, amplitude):
    """State and tangent (2, 2) after 2 pi/w, by DOP853 and the variational equations."""

    def rates(t, y):
        (x, v), M = y[:2], y[2:].reshape(2, 2)
        a = amplitude * np.sin(OMEGA * t) - DAMPING * v - G * np.sin(x)
        return np.concatenate([[v, a], (np.array([[0.0, 1.0], [-G * np.cos(x), -DAMPING]]) @ M).ravel()])

    begin = np.concatenate([start, np.eye(2).ravel()])
    end = solve_ivp(rates, (0, 2 * np.pi / OMEGA), begin, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    return end[:2], end[2:].reshape(2, 2)


@pytest.mark.slow
def test_a_swing_loses_its_symmetry_where_half_of_it_doubles(swing):
    """There the whole period has a multiplier 1, and a swing that is not symmetric begins."""
    half = {"T": np.pi / OMEGA, "exchange": {"rod": "-rod"}, "q": {"rod": -2.534}, "v": {"rod": -0.669}}
    branch = mbdae.periodic_branch(swing, AMPLITUDE, 11.0, 11.8, rtol=1e-9, **half)
    (at,) = branch.bifurcations
    assert at.kind == "doubling"
    end, M = after_a_period([*at.motion.q, *at.motion.v], at.value)
    np.testing.assert_allclose(end, [*at.motion.q, *at.motion.v], atol=1e-7)
    assert np.abs(np.linalg.eigvals(M) - 1).min() < 1e-6
    doubled = branch.doubled(at)
    last = doubled.points[-1]
    end, M = after_a_period([*last.motion.q, *last.motion.v], last.value)
    np.testing.assert_allclose(end, [*last.motion.q, *last.motion.v], atol=1e-6)
    np.testing.assert_allclose(np.poly(last.motion.multipliers), np.poly(np.linalg.eigvals(M)), atol=1e-5)
    low, high = last.motion.extrema("q.rod")
    assert abs(low + high) > 0.1
    assert last.motion.stability == "stable"


def test_a_branch_checks_the_exchange(tmp_path):
    """A constant torque beside the harmonic one has no symmetry."""
    (tmp_path / "bent.toml").write_text(SWING.replace("omega = 2.0 }", "omega = 2.0, offset = 1.0 }"))
    with pytest.raises(InputError, match=r"^the exchange of joints is not a symmetry|^no periodic motion found"):
        mbdae.periodic_branch(
            str(tmp_path / "bent.toml"), AMPLITUDE, 4.0, 5.0, T=np.pi / OMEGA, exchange={"rod": "-rod"}, rtol=1e-9
        )
