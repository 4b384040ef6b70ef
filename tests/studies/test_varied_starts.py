"""Start values that vary between runs: the bits of a new variant each, one mechanism for all, and failures."""

import numpy as np
import pytest

import mbdae
from mbdae.errors import AssemblyError, InputError
from mbdae.mechanism.assembly.position_search import is_closed
from mbdae.studies.factories import factory_of
from mbdae.studies.varied_starts import VariedStarts

CASES = {  # model, start values of three runs
    "a speed": ("slider_crank", "v.crank", (1.0, -3, 0.0)),
    "an angle": ("slider_crank", "q.crank", (0.1, 0.2, 1)),
    "redundant rows": ("bricard", "v.rod_1", (0.5, 1.0, 1.5)),
    "modes": ("pendulum_on_stop", "v.rod", (0.5, 0.25, 0.0)),
    "a flexible body": ("flexible_four_bar", "v.crank", (1.0, 2.0, 3.0)),
    "states of forces": ("flyball_governor", "v.shaft", (9.0, 10.0, 11.0)),
    "an estimate": ("slider_crank", "guess.slider", (0.44, 0.45, 0.46)),
    "a driven joint": ("cam_follower", "v.cam", (10.0, 20.0, 30.0)),
    "a body with six coordinates": ("ball_on_turntable", "q.ball", ([0.6, 0, 0.1, 0, 0, 0, 1],) * 3),
}


def begun(model, *runs):
    """Return the mechanism and the point of each run; None for those that cannot begin."""
    columns, made = {name: [run[name] for run in runs] for name in runs[0]}, [None] * len(runs)
    for group in VariedStarts(factory_of(model), len(runs), lambda mech: 0.0).groups(columns, len(runs)):
        which, y, _ = group.begin()
        for i, point in zip(which.tolist(), y, strict=True):
            made[i] = group.mech, point
    return made


@pytest.mark.parametrize("case", CASES)
def test_points_have_the_bits_of_new_variants(case):
    model, name, values = CASES[case]
    reference, made = factory_of(model), begun(model, *({f"start.{name}": x} for x in values))
    for x, (mech, point) in zip(values, made, strict=True):
        np.testing.assert_array_equal(point, reference.make({f"start.{name}": x}).point())
        assert mech is made[0][0]


def test_points_satisfy_the_closures_and_the_values():
    for angle, speed in ((0.1, 2.0), (0.7, -1.0)):
        ((mech, y),) = begun("slider_crank", {"start.q.crank": angle, "start.v.crank": speed, "gravity.2": -1.6})
        q, v = y[: mech.nq], y[mech.nq : mech.nq + mech.nv]
        assert (q[0], v[0], mech.model.gravity.linear[2]) == (angle, speed, -1.6)
        assert is_closed(mech.system(), q, 0.0)
        assert np.abs(mech.residual(q, v)[1]).max() < 1e-13
        slider = 0.1 * np.cos(angle) + np.sqrt(0.35**2 - 0.1**2 * np.sin(angle) ** 2)
        assert q[2] == pytest.approx(slider, abs=1e-12)


@pytest.mark.parametrize("value", [np.nan, "fast", [1.0, 2.0], True])
@pytest.mark.parametrize("position", [0, 1])
def test_invalid_values_fail_alone(value, position):
    with pytest.raises(InputError):
        factory_of("slider_crank").make({"start.v.crank": value}).point()
    values = [1.0, 2.0]
    values.insert(position, value)
    made = begun("slider_crank", *({"start.v.crank": x} for x in values))
    assert made.pop(position) is None
    assert made[0][0] is made[1][0]


@pytest.mark.parametrize(("table", "other"), [("q", 2.0), ("v", 0.3)])
def test_a_value_that_opens_a_loop_fails_alone(table, other):
    closed = float(mbdae.load("slider_crank").start["qv".index(table)][2])
    runs = [{f"start.{table}.slider": x} for x in (closed, closed, other, closed)]
    made = begun("slider_crank", *runs)
    assert made.pop(2) is None
    for mech, point in made:
        np.testing.assert_array_equal(point, made[0][1])
        assert mech is made[0][0]
    with pytest.raises(AssemblyError, match="wrist pin"):
        factory_of("slider_crank").make(runs[2]).point()


def test_a_function_makes_each_of_its_mechanisms():
    lengths = []

    def model(length):
        lengths.append(length)
        return mbdae.load("slider_crank")

    (_, slow), (_, fast) = begun(model, *({"length": 1.0, "start.v.crank": speed} for speed in (1.0, 2.0)))
    assert lengths == [1.0, 1.0]
    assert fast[3] == 2 * slow[3] == 2.0
