"""Drivers that closures cannot follow beyond a dead point: a run ends there, and says when and why.

In the dead points crank and rod of the slider-crank are stretched, crank and coupler of the four-bar folded.
"""

import re

import numpy as np
import pytest
from bodies import body, load
from motions import FAR
from shared import shared_model
from unit_systems import UNIT_SYSTEMS

import mbdae
from mbdae import Driver, Mechanism

REACH = 0.45  # m: crank and rod of the slider-crank
FOLDED = np.pi - np.arccos((2.0**2 + 1.5**2 - (2.0 - 1.0) ** 2) / (2 * 2.0 * 1.5))  # rad: rocker of the four-bar
TEXT = "{} cannot be followed beyond a dead point at t = ([-.0-9e]+), where velocities are infinite"


def driven(name, joint, rate, **more):
    """A model with a joint at a constant speed from its start, that start, and the joint's value there."""
    plain = shared_model(name)
    q0, at = plain.start[0], list(plain.joint_names).index(joint)
    mech = mbdae.load(name, drivers=[Driver.polynomial(joint, [q0[at], rate], name="drive")], **more)
    return mech, *mech.assemble(q0), q0[at]


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"rtol": 1e-4},
        {"method": "radau5"},
        {"formulation": "ggl"},
        {"method": "radau5", "rtol": 1e-4, "backend": "python"},
    ],
    ids=str,
)
@pytest.mark.parametrize(("name", "joint", "rate", "end"), [
    ("slider_crank", "slider", 0.02, REACH), ("four_bar", "rocker", 0.5, FOLDED),
])  # fmt: skip
def test_a_run_ends_at_the_dead_point(name, joint, rate, end, options):
    mech, q, v, u = driven(name, joint, rate)
    sol = mbdae.solve(mech, (0, FAR), q, v, **options)
    time = (end - u) / rate
    assert sol.status == "driver"
    found = re.fullmatch(TEXT.format("'drive'"), sol.message)
    assert found, sol.message
    np.testing.assert_allclose([float(found[1]), sol.t[-1]], time, rtol=2e-6)


@pytest.mark.parametrize("options", [{"project": True}, {"method": "radau5"}], ids=str)
def test_fixed_steps_end_in_the_step_before_it(options):
    mech, q, v, u = driven("slider_crank", "slider", 0.02)
    sol = mbdae.solve(mech, (0, 10), q, v, step=1e-3, **options)
    assert "'drive' cannot be followed beyond a dead point in the step after t = 0.285," in sol.message
    assert 0.285 < (REACH - u) / 0.02 < 0.286


def test_backwards_in_time():
    mech, q, v, u = driven("slider_crank", "slider", -0.02)
    sol = mbdae.solve(mech, (0, -10), q, v)
    found = re.fullmatch(TEXT.format("'drive'"), sol.message)
    np.testing.assert_allclose(float(found[1]), -(REACH - u) / 0.02, rtol=2e-6)


@pytest.mark.parametrize("units", UNIT_SYSTEMS[1:], ids=lambda units: units.name)
def test_in_all_units(units):
    mech, q, _, u = driven("slider_crank", "slider", 0.02)
    other = units.mechanism(mech)
    sol = mbdae.solve(other, (0, FAR * units.time), *other.assemble(q * units.coordinates(mech)))
    found = re.fullmatch(TEXT.format("'drive'"), sol.message)
    assert found, sol.message
    np.testing.assert_allclose(float(found[1]), (REACH - u) / 0.02 * units.time, rtol=2e-6)


@pytest.mark.slow
def test_the_distance_of_an_arm_that_swings(tmp_path):
    """Two bars of 1 m are stretched; the arm has a degree of freedom left, and a driver that rests is not named."""
    along = {"axis": [0.0, 1.0, 0.0], "com": [0.5, 0.0, 0.0]}
    bars = [body("upper", "continuous", **along), body("lower", "continuous", "upper", xyz=[1.0, 0.0, 0.0], **along)]
    other = body("other", "prismatic", axis=[0.0, 0.0, 1.0])
    ends = [{"name": "end", "parent": "lower", "xyz": [1.0, 0.0, 0.0]}, {"name": "base", "parent": "world"}]
    mech = load(tmp_path, [*bars, other], [], frame=ends)
    reach = Driver.polynomial(("base", "end"), [1.5, 0.25], name="reach")
    mech = Mechanism(mech.model, drivers=[reach, Driver.polynomial("other", [0.1], name="rest")])
    sol = mbdae.solve(mech, (0, 5), *mech.assemble(guess={"lower": 1.0}))
    assert sol.status == "driver"
    found = re.fullmatch(TEXT.format("'reach'"), sol.message)
    assert found, sol.message
    np.testing.assert_allclose(float(found[1]), 2.0, rtol=2e-6)


def test_another_speed_without_bound_is_no_dead_point():
    plain = shared_model("slider_crank")
    u = plain.start[0][0] + 1
    motion = [lambda t: u - np.sqrt(1 - t), lambda t: 0.5 / np.sqrt(1 - t), lambda t: 0.25 / (1 - t) ** 1.5]
    mech = Mechanism(plain.model, plain.closures, drivers=[Driver.function("crank", *motion)])
    sol = mbdae.solve(mech, (0, 2), *mech.assemble(plain.start[0]), max_steps=5000)
    assert not sol.success
    assert "dead point" not in sol.message, sol.message


def test_closures_that_lose_rank_alone_are_no_dead_point():
    """The rods of two arms become parallel: the left null space has no component of a driver, except for rounding."""
    plain = shared_model("delta_robot")
    rates = {"arm_1": 1.0, "arm_2": 0.1, "arm_3": 0.1}
    drivers = [Driver.polynomial(arm, [0.35, rate]) for arm, rate in rates.items()]
    mech = Mechanism(plain.model, plain.closures, drivers=drivers)
    sol = mbdae.solve(mech, (0, 3), *mech.assemble(plain.start[0]), method="radau5")
    assert not sol.success
    if sol.t[-1] < 2.09:  # rounding decides whether steps lead beyond t = 2.0783
        np.testing.assert_allclose(sol.t[-1], 2.0783, rtol=1e-4)
        assert "dead point" not in sol.message, sol.message
    else:  # there velocities become infinite
        np.testing.assert_allclose(sol.t[-1], 2.1039, rtol=1e-4)
        assert "dead point at t = 2.1039" in sol.message


def test_a_driver_that_is_nearly_at_rest_there():
    """It would come to rest at t = 1, beyond the dead point by a millionth of its way."""
    plain = shared_model("slider_crank")
    q0, at = plain.start[0], list(plain.joint_names).index("slider")
    way = (REACH - q0[at]) * (1 + 1e-6)
    mech = mbdae.load("slider_crank", drivers=[Driver.polynomial("slider", [q0[at], 2 * way, -way], name="drive")])
    sol = mbdae.solve(mech, (0, 1), *mech.assemble(q0))
    found = re.fullmatch(TEXT.format("'drive'"), sol.message)
    assert found, sol.message
    np.testing.assert_allclose(float(found[1]), 1 - np.sqrt(1e-6 / (1 + 1e-6)), rtol=2e-6)
