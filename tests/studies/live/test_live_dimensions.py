"""Lengths as sliders: loops are closed again as in closed form, paths follow, and a live view goes on."""

import time

import numpy as np
import pytest

import mbdae
from mbdae.errors import AssemblyError, InputError, UnknownNameError
from mbdae.studies.live.dimensions import Dimensions

COMMANDS = ("live four_bar --seconds 0.2 --parameter frame.coupler_tip.xyz.0=1.5,2.5 --trace coupler_tip",)
COUPLER, GROUND = "frame.coupler_tip.xyz.0", 2.0
CRANK, ROCKER = 1.0, 1.5


def rocker_angle(crank, coupler):
    """By the triangle of the crank pin, the rocker's bearing and its tip; the tip above."""
    pin = CRANK * np.array([np.cos(crank), np.sin(crank)])
    d = pin - [GROUND, 0.0]
    r = np.hypot(*d)
    return np.arctan2(d[1], d[0]) - np.arccos((r * r + ROCKER**2 - coupler**2) / (2 * r * ROCKER))


@pytest.fixture(scope="module")
def four_bar():
    return mbdae.load("four_bar")


def test_a_length_closes_the_loop_again(four_bar):
    found = Dimensions(four_bar, {COUPLER: (1.2, 2.8)}, ["coupler_tip", "coupler_bar"])
    q, v = found.mechanism.start
    assert q[2] == pytest.approx(rocker_angle(q[0], 2.0), abs=1e-12)
    for length in (1.9, 1.7, 2.3):
        crank = q[0]
        q, v = found.change(COUPLER, length, q, v)
        assert (q[0], found.values[COUPLER]) == (crank, length)
        assert q[2] == pytest.approx(rocker_angle(crank, length), abs=1e-12)
        assert np.abs(found.mechanism.residual(q, v)).max() < 1e-12
    with pytest.raises(AssemblyError):
        found.change(COUPLER, 5.0, q, v)
    assert found.values[COUPLER] == 2.3


def test_paths_are_those_of_the_present_lengths(four_bar, monkeypatch):
    found, drawn = Dimensions(four_bar, {COUPLER: (1.2, 2.8)}, ["coupler_tip", "coupler_bar"]), {}
    monkeypatch.setattr(
        "mbdae.studies.live.dimensions.path_commands",
        lambda path, points, colour, radius: drawn.update({path: points}) or [],
    )
    q, _ = found.change(COUPLER, 1.8, *found.mechanism.start)
    list(found.paths(q, 1.0))
    tip, pin = drawn["/mechanism/path coupler_tip"], drawn["/mechanism/path coupler_bar"]
    flat = np.ptp(tip, axis=0) > 1e-9
    assert flat.sum() == 2
    np.testing.assert_allclose(np.linalg.norm(pin, axis=1), CRANK, atol=1e-10)
    np.testing.assert_allclose(np.linalg.norm(tip - pin, axis=1), 1.8, atol=1e-10)
    np.testing.assert_allclose(np.linalg.norm(tip - [GROUND, 0, 0], axis=1), ROCKER, atol=1e-10)


def test_a_live_view_goes_on_with_another_length(four_bar):
    def waited(what):
        end = time.monotonic() + 60.0
        while not what():
            assert time.monotonic() < end, "it does not happen"
            time.sleep(0.01)

    with mbdae.live(four_bar, parameters={COUPLER: (1.2, 2.8)}, traces="coupler_tip") as view:
        waited(lambda: view.t > 0.02)
        view.set(COUPLER, 1.8)
        waited(lambda: view._dimensions.values[COUPLER] == 1.8)
        t = view.t
        waited(lambda: view.t > t + 0.02)
        view.play(False)
        waited(lambda: not view.playing)
        assert view.q[2] == pytest.approx(rocker_angle(view.q[0], 1.8), abs=1e-9)
        view.set(COUPLER, 1e3)
        waited(lambda: "closure" in view.message)
    assert [run.t[0] for run in view.runs] == [0.0]


@pytest.mark.parametrize(
    ("parameters", "error", "words"),
    [
        ({"frame.tip.xyz.0": (0, 1)}, UnknownNameError, "tip"),
        ({COUPLER: (0.1, 1.0)}, InputError, "is outside of its range, 0.1 to 1"),
        ({COUPLER: (3, 1)}, InputError, "two increasing numbers"),
        ({"frame.coupler_tip.xyz": (0, 1)}, InputError, "is not a number"),
    ],
)
def test_wrong_parameters_are_one_line(four_bar, parameters, error, words):
    with pytest.raises(error, match=words):
        mbdae.live(four_bar, parameters=parameters)


def test_parameters_are_those_of_files(four_bar):
    mech = mbdae.Mechanism(four_bar.model, four_bar.closures)
    with pytest.raises(InputError, match="not read from files"):
        mbdae.live(mech, parameters={COUPLER: (1, 3)})
