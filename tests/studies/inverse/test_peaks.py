"""Peaks between samples, and delivered and absorbed energies, against closed forms."""

import numpy as np
import pinocchio as pin
import pytest
from linkages import bar

from mbdae import Mechanism, inverse_dynamics, kinematics
from mbdae.studies.inverse.peaks import delivered_and_absorbed, located_peak


def test_a_bar_lifted_at_constant_speed():
    """tau = m g l/2 cos theta, largest at theta = 0 between the samples, absorbed while the bar falls."""
    model = pin.Model()
    bar(model, 0, (0, 0), 1.4, "lever", mass=2.0)
    size, low, high, speed = 2.0 * 9.81 * 0.7, -1.0, 2.2, 3.0
    curve = kinematics(Mechanism(model), "lever", span=(low, high), points=361)
    demand = inverse_dynamics(Mechanism(model), curve, speed=speed).demands[0]
    assert demand.peak == pytest.approx(size, rel=1e-12)
    assert demand.at == pytest.approx(0.0, abs=1e-8)
    assert demand.delivered == pytest.approx(size * (1 - np.sin(low)), rel=1e-6)
    assert demand.absorbed == pytest.approx(size * (1 - np.sin(high)), rel=1e-5)
    assert demand.energy == pytest.approx(demand.delivered - demand.absorbed, rel=1e-12)


def test_a_bar_that_is_only_lifted_takes_no_braking_power():
    model = pin.Model()
    bar(model, 0, (0, 0), 1.4, "lever", mass=2.0)
    curve = kinematics(Mechanism(model), "lever", span=(-1.0, 1.0), points=21)
    assert "power 0 to 41.2 W" in str(inverse_dynamics(Mechanism(model), curve, speed=3.0))  # 2 kg 9.81 m/s^2 0.7 m 3/s


def test_next_to_jumps_and_corners_the_largest_sample_counts():
    t = np.linspace(0, 1, 101)
    whole = [np.arange(101)]
    assert located_peak(np.minimum(t, 0.708 - t) * 1.0, t, t, whole)[0] == pytest.approx(0.354, abs=0.01)
    corner = 1 - np.abs(t - 0.503)
    assert located_peak(corner, t, t, whole) == (corner.max(), t[corner.argmax()])
    assert located_peak(t, t, t, whole) == (1.0, 1.0)
    parts = [np.arange(51), np.arange(51, 101)]
    jump = np.where(t <= 0.5, t, 0.0)
    assert located_peak(jump, t, t, parts) == (0.5, 0.5)
    smooth = -np.exp(-((t - 0.4321) ** 2))
    assert located_peak(smooth, t, 2 * t, whole) == (pytest.approx(1.0, rel=1e-12), pytest.approx(0.8642, abs=1e-9))


def test_a_power_that_rests_and_changes_its_sign():
    t = np.linspace(0, 3, 301)
    power = np.where(t < 1, 0.0, np.sin(np.pi * (t - 1)))
    given, taken = delivered_and_absorbed(power, t, [np.arange(301)])
    assert (given, taken) == (pytest.approx(2 / np.pi, rel=1e-4), pytest.approx(2 / np.pi, rel=1e-4))
