"""The characteristic length of a mechanism: a distance in it, scaled with the unit and translation invariant."""

import numpy as np
import pinocchio as pin
import pytest
from linkages import LINK, bar, stephenson

from mbdae import Closure, Mechanism, load


def four_bar(scale=1.0, at=(0.0, 0.0)):
    model = pin.Model()
    crank = bar(model, 0, at, 0.1 * scale, "crank")
    bar(model, crank, (0.1 * scale, 0), 0.4 * scale, "coupler")
    bar(model, 0, (at[0] + 0.3 * scale, at[1]), 0.25 * scale, "rocker")
    return Mechanism(model, [Closure.point("coupler_tip", "rocker_tip")])


def sliding(inertia):
    model = pin.Model()
    model.addJoint(0, pin.JointModelPX(), pin.SE3(np.eye(3), np.array([7.0, 0, 0])), "slide")
    model.appendBodyToJoint(1, inertia, pin.SE3.Identity())
    return Mechanism(model)


def test_it_is_the_longest_link():
    assert four_bar().characteristic_length == pytest.approx(0.4)
    assert stephenson().characteristic_length == pytest.approx(np.hypot(3.2, 1.1))  # two pivots on the ground
    assert max(LINK.values()) < np.hypot(3.2, 1.1)


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e3, 1e9])
def test_it_goes_with_the_unit(scale):
    assert four_bar(scale).characteristic_length == pytest.approx(0.4 * scale, abs=0)


def test_the_position_of_the_mechanism_does_not_matter():
    assert four_bar(at=(1e5, -2e5)).characteristic_length == pytest.approx(0.4)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("rolling_disc", 0.3),  # the disc's radius
        ("car_axis", 1.0),  # the bar that is a closure of one length
    ],
)
def test_lengths_of_closures_count(name, expected):
    assert load(name).characteristic_length == pytest.approx(expected)


def test_a_body_without_links_has_the_size_of_its_inertia():
    moments = np.diag([0.02, 0.08, 0.05])
    assert sliding(pin.Inertia(2.0, np.zeros(3), moments)).characteristic_length == pytest.approx(0.2)
    assert sliding(pin.Inertia(2.0, np.array([0, 0.6, 0]), moments)).characteristic_length == pytest.approx(0.6)


def test_a_mass_point_has_none():
    assert sliding(pin.Inertia(2.0, np.zeros(3), np.zeros((3, 3)))).characteristic_length == 1.0
