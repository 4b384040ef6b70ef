"""Start values that vary between runs: the bits of a new variant each, one mechanism for all, and failures."""

import numpy as np
import pytest

import mbdae
from mbdae.errors import AssemblyError, InputError
from mbdae.mechanism.assembly.position_search import is_closed
from mbdae.studies.factories import factory_of
from mbdae.studies.varied_starts import VariedStarts

CASES = {  # model, start values of three runs, whether they share a mechanism
    "a speed": ("slider_crank", "v.crank", (1.0, -3, 0.0), True),
    "an angle": ("slider_crank", "q.crank", (0.1, 0.2, 1), True),
    "redundant rows": ("bricard", "v.rod_1", (0.5, 1.0, 1.5), True),
    "modes": ("pendulum_on_stop", "v.rod", (0.5, 0.25, 0.0), True),
    "a flexible body": ("flexible_four_bar", "v.crank", (1.0, 2.0, 3.0), True),
    "states of forces": ("flyball_governor", "v.shaft", (9.0, 10.0, 11.0), True),
    "an estimate": ("slider_crank", "guess.slider", (0.44, 0.45, 0.46), False),
    "a driven joint": ("cam_follower", "v.cam", (10.0, 20.0, 30.0), False),
    "a body with six coordinates": ("ball_on_turntable", "q.ball", ([0.6, 0, 0.1, 0, 0, 0, 1],) * 3, False),
}


def varied(model):
    return VariedStarts(factory_of(model), lambda mech: 0.0)


@pytest.mark.parametrize("case", CASES)
def test_points_have_the_bits_of_new_variants(case):
    model, name, values, shared = CASES[case]
    starts, reference = varied(model), factory_of(model)
    made = [*starts.make([{f"start.{name}": x} for x in values])]
    for x, found in zip(values, made, strict=True):
        np.testing.assert_array_equal(found.point, reference.make({f"start.{name}": x}).point())
    assert len({id(found.mech) for found in made}) == (1 if shared else 3)


def test_points_satisfy_the_closures_and_the_values():
    starts = varied("slider_crank")
    for angle, speed in ((0.1, 2.0), (0.7, -1.0)):
        (found,) = starts.make([{"start.q.crank": angle, "start.v.crank": speed, "gravity.2": -1.6}])
        mech, y = found.mech, found.point
        q, v = y[: mech.nq], y[mech.nq : mech.nq + mech.nv]
        assert (q[0], v[0], mech.model.gravity.linear[2]) == (angle, speed, -1.6)
        assert is_closed(mech.system(), q, 0.0)
        assert np.abs(mech.residual(q, v)[1]).max() < 1e-13
        slider = 0.1 * np.cos(angle) + np.sqrt(0.35**2 - 0.1**2 * np.sin(angle) ** 2)
        assert q[2] == pytest.approx(slider, abs=1e-12)


@pytest.mark.parametrize("value", [np.nan, "fast", [1.0, 2.0], True])
def test_invalid_values_are_rejected_as_those_of_a_mechanism(value):
    with pytest.raises(InputError) as of_variant:
        factory_of("slider_crank").make({"start.v.crank": value}).point()
    first, found, last = varied("slider_crank").make([{"start.v.crank": x} for x in (1.0, value, 2.0)])
    assert isinstance(found, InputError)
    assert str(found) == str(of_variant.value)
    assert first.mech is last.mech


@pytest.mark.parametrize(("table", "other"), [("q", 2.0), ("v", 0.3)])
def test_a_value_that_opens_a_loop_fails_alone(table, other):
    closed = float(mbdae.load("slider_crank").start["qv".index(table)][2])
    made = [*varied("slider_crank").make([{f"start.{table}.slider": x} for x in (closed, closed, other, closed)])]
    assert isinstance(made[2], AssemblyError)
    assert "wrist pin" in str(made[2])
    for found in (made[0], made[1], made[3]):
        np.testing.assert_array_equal(found.point, made[0].point)
        assert found.mech is made[0].mech


def test_a_function_makes_each_of_its_mechanisms():
    lengths = []

    def model(length):
        lengths.append(length)
        return mbdae.load("slider_crank")

    made = [*varied(model).make([{"length": 1.0, "start.v.crank": speed} for speed in (1.0, 2.0)])]
    assert lengths == [1.0, 1.0]
    assert made[1].point[3] == 2 * made[0].point[3] == 2.0
