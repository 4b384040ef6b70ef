"""Derivatives with respect to parameters that are differenced: high frequencies, starts that jump, small bodies."""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from closure_kinds import BODY
from frozen import assert_derivative
from unit_systems import UNIT_SYSTEMS, UnitSystem

import mbdae
from mbdae import Closure, Mechanism
from mbdae.errors import InputError
from mbdae.finite_differences import converged_difference
from mbdae.mechanism.formats.mechanism_file.loaded_model import parameter_value
from mbdae.mechanism.formats.mechanism_file.template import Template
from mbdae.mechanism.model_settings import Start

OMEGA = 10.0
SLIDES = f"""
title = "two slides"
{{more}}
[[body]]
name = "driven"
parent = "world"
joint = "prismatic"
mass = 1.0
[[body]]
name = "pushed"
parent = "world"
joint = "prismatic"
mass = 2.0
[[force]]
name = "push"
kind = "joint_torque"
joint = "pushed"
torque = {{torque}}
[[driver]]
name = "drive"
joint = "driven"
motion = {{{{kind = "harmonic", amplitude = 0.1, omega = {OMEGA}}}}}
[start]
v = {{{{driven = {0.1 * OMEGA}}}}}
"""
WAVE = f'{{kind = "harmonic", amplitude = 3.0, omega = {OMEGA}}}'
LOOSE = f"""
title = "a free body on a hinge, which its guess does not place"
{BODY}kind = "revolute"
axis = [0.3, -0.5, 0.8]
second_axis = [-0.4, 0.7, 0.2]
"""


@pytest.fixture
def slides(tmp_path):
    def write(torque=WAVE, more=""):
        (tmp_path / "slides.toml").write_text(SLIDES.format(torque=torque, more=more))
        return Template(str(tmp_path / "slides.toml"))

    return write


@pytest.mark.usefixtures("back_end")
def test_a_frequency_acts_with_the_time(slides):
    """The derivative of the motion itself: x = a sin(w t), and v = (cos w t_0 - cos w t) 3/(2 w)."""
    model, (t0, t) = slides(), (30.0, 30.4)
    driven = [0.1 * np.sin(OMEGA * t0), 0.1 * OMEGA * np.cos(OMEGA * t0)]
    mech = model.make({})
    sol = mbdae.solve(mech, (t0, t), [driven[0], 0.0], [driven[1], 0.0], method="pherk6", step=0.005)
    found = mbdae.sensitivity(sol, ["force.push.torque.omega", "driver.drive.motion.omega"], model=model)
    phase0, phase = OMEGA * t0, OMEGA * t
    expected = 1.5 * ((t * np.sin(phase) - t0 * np.sin(phase0)) / OMEGA - (np.cos(phase0) - np.cos(phase)) / OMEGA**2)
    assert found.v[-1, 1, 0] == pytest.approx(expected, rel=1e-8)
    assert found.q[-1, 0, 1] == pytest.approx(0.1 * t * np.cos(phase), rel=1e-8)


def test_a_start_that_its_guess_does_not_decide(tmp_path):
    """The path from the initial estimate jumps between poses where the socket rotates by some hundredths."""
    (tmp_path / "loose.toml").write_text(LOOSE)
    model, name = Template(str(tmp_path / "loose.toml")), "frame.socket.rpy.2"

    @cache
    def run(x):
        return mbdae.solve(model.make({name: x}), (0.0, 0.02), step=0.01, method="pherk5")

    value = parameter_value(model, name)
    sol = run(value)
    found = mbdae.sensitivity(sol, {name: value}, model=model).dy[..., 0]
    assert_derivative(found, lambda x: run(x).y, value, 1e-9, (1e-5, 1e-4, 1e-3), mech=sol.mechanism)


def test_times_at_which_a_signal_jumps_are_rejected(slides):
    model = slides('{kind = "steps", points = [[0.0, 0.0], [0.5, 3.0]]}')
    sol = mbdae.solve(model.make({}), (0.0, 1.0), step=0.1)
    with pytest.raises(InputError, match=r"'force\.push\.torque\.points\.1\.0' changes the times of jumps of 'push'"):
        mbdae.sensitivity(sol, ["force.push.torque.points.1.0"], model=model)
    assert mbdae.sensitivity(sol, ["force.push.torque.points.1.1"], model=model).q[-1, 1, 0] == pytest.approx(0.0625)


def test_times_between_pieces_of_a_curve(slides):
    model = slides('{kind = "table", points = [[0.0, 0.0], [0.5, 3.0], [0.52, -3.0], [3.0, 0.0]]}')
    name = "force.push.torque.points.2.0"

    @cache
    def run(x):
        return mbdae.solve(model.make({name: x}), (0.0, 1.0), step=0.05)

    sol = run(0.52)
    found = mbdae.sensitivity(sol, [name], model=model).dy[..., 0]
    assert_derivative(found, lambda x: run(x).y, 0.52, 1e-9, (1e-6, 1e-5, 1e-4), mech=sol.mechanism)


def test_inertias_of_small_bodies():
    """Products of inertia are 0, and stay within the valid range."""
    model, name = Template("delta_robot"), "body.arm_1.inertia.3"

    @cache
    def run(x):
        return mbdae.solve(model.make({name: x}), (0.0, 0.04), step=0.01, method="pherk5")

    sol = run(0.0)
    found = mbdae.sensitivity(sol, [name], model=model).dy[..., 0]
    assert_derivative(found, lambda x: run(x).y, 0.0, 1e-9, (1e-5, 1e-4), mech=sol.mechanism)


@pytest.mark.parametrize(("model", "ends"), [("four_bar", ["coupler_tip"]), ("andrews_squeezer", ["P2", "P3", "P4"])])
@pytest.mark.usefixtures("back_end")
def test_what_opens_nothing_is_not_rejected(model, ends):
    """Point closures are invariant under rotations of their frames."""
    sol = mbdae.solve(mbdae.load(model), (0.0, 1e-3), step=5e-4, method="pherk5")
    names = [f"frame.{end}.rpy.{k}" for end in ends for k in range(3)]
    assert np.abs(mbdae.sensitivity(sol, names).dy).max() < 1e-9


def test_widths_shrink_until_differences_agree():
    def values(of, h):
        return {k: np.array([of(k * h), 2 * of(k * h)]) for k in (-3, -2, -1, 1, 2, 3)}

    def edge(x):
        if abs(x) > 0.01:
            raise InputError("too far")
        return 5 * x

    assert converged_difference(lambda h: values(lambda x: x**2 + 7 * x, h), 0.1).h == 0.1
    waves = converged_difference(lambda h: values(lambda x: np.sin(200 * x), h), 0.1)
    np.testing.assert_allclose(waves.derivative, [200, 400], rtol=1e-9)
    assert waves.h < 0.01
    np.testing.assert_allclose(converged_difference(lambda h: values(edge, h), 1.0).derivative, [5, 10], rtol=1e-12)
    assert converged_difference(lambda h: values(lambda x: float(x > 0), h), 0.1).discrepancy > 0.1
    with pytest.raises(InputError, match="too far"):
        converged_difference(lambda h: values(edge, h), 1e9)


def test_widths_exceed_the_tolerance_of_assembly():
    """Where wheels are tilted the start slips by 3 % of that: below some 1e-7 assembly ignores it."""
    model = Template("mecanum_platform")
    sol = mbdae.solve(model.make({}), (0.0, 0.1), step=0.05, method="pherk5")
    with pytest.raises(InputError, match="start cannot be assembled near this value"):
        mbdae.sensitivity(sol, ["closure.front_left wheel.axis.2"], model=model)
    tilted = mbdae.sensitivity(sol, ["body.platform.rpy.0"], model=model)  # slips by its square
    assert np.abs(tilted.dy).max() > 0.1


def test_rows_that_a_mode_leaves_out_do_not_count():
    """The free pawl's gap jumps by a tooth at the start of the run."""
    sol = mbdae.solve(mbdae.load("ratchet"), (0.0, 0.03), step=0.01, method="pherk5")
    assert not mbdae.sensitivity(sol, ["clutch.driving pawl.pitch", "clutch.driving pawl.tooth"]).dy.any()


@pytest.mark.parametrize("units", [*UNIT_SYSTEMS, UnitSystem("Gm, kg, s", length=1e-9)], ids=lambda units: units.name)
def test_starts_in_other_units(units):
    """Two coupled sliders, of which one is guessed at sin(w p): both start at half of it."""
    model, frequency = pin.Model(), 300.0
    for name in "ab":
        joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3(np.eye(3), np.eye(3)[0]))
    closures = [Closure.coupling("a", "b", (0.0, 1.0))]

    def make(p):
        guess = {"a": float(np.sin(frequency * p)), "b": 0.0}
        return units.mechanism(Mechanism(model, closures, start=Start(guess=guess)))

    sol = mbdae.solve(make(0.0), (0, 1e-3 * units.time), step=1e-3 * units.time)
    found = mbdae.sensitivity(sol, {"p": 0.0}, model=make).q[0, :, 0] / units.length
    assert found == pytest.approx([frequency / 2] * 2, rel=1e-9)
