"""Closures that are active within windows of a joint: a Geneva drive against its geometry."""

import numpy as np
import pytest

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism.closures.active_range import ActiveRange

RATIO = np.sqrt(0.5)  # of the pin's radius to the distance of the centres


def wheel(crank):
    """Angle of the wheel: it follows the pin's direction within an eighth of a turn, and dwells elsewhere."""
    turns = np.floor((crank + np.pi) / (2 * np.pi))
    near = np.clip(crank - 2 * np.pi * turns, -np.pi / 4, np.pi / 4)
    return -(np.pi / 2) * turns - np.pi / 4 + np.arctan2(-RATIO * np.sin(near), 1 - RATIO * np.cos(near))


def test_a_geneva_drive_turns_its_wheel_by_quarters(back_end):
    until = 5.0 if back_end == "native" else 1.3
    sol = mbdae.solve(mbdae.load("geneva_drive"), (0, until), rtol=1e-9)
    assert sol.success
    np.testing.assert_allclose(sol.q[:, 1], wheel(sol.q[:, 0]), atol=1e-10)
    assert len(sol.modes) == (11 if back_end == "native" else 4)
    ends = [sol.q[i, 0] for i, _ in sol.modes[1:]]
    known = np.sort(np.concatenate([2 * np.pi * np.arange(6) + s * np.pi / 4 for s in (-1, 1)]))
    np.testing.assert_allclose(ends, known[: len(ends)], atol=1e-10)
    assert mbdae.drift(sol).energy_relative < 1e-10


@pytest.mark.parametrize("driven", [False, True])
@pytest.mark.parametrize("crank", [0.3, -1.0, 2 * np.pi - 0.5])
def test_a_start_within_a_window_satisfies_its_closures(crank, driven):
    """The crank keeps its start; an estimate of the wheel is corrected. The window is that of the driven crank."""
    drivers = [mbdae.Driver.at_speed("crank", 6.0, start=crank)] if driven else []
    mech = mbdae.load("geneva_drive", drivers=drivers)
    known = {} if driven else {"crank": crank}
    q, v = mech.assemble(known, {} if driven else {"crank": 6.0}, guess={"wheel": wheel(crank) + 0.02})
    rate = 6.0 * (wheel(crank + 1e-5) - wheel(crank - 1e-5)) / 2e-5
    at_rest = crank == -1.0  # the locking disc does not know the angle at which it holds the wheel
    np.testing.assert_allclose(q, [crank, wheel(crank) + 0.02 * at_rest], atol=1e-12)
    np.testing.assert_allclose(v, [6.0, rate], atol=1e-8)
    assert not mbdae.solve(mech, (0, 0.01), q, v).impacts


def test_windows_are_among_the_signals():
    """The pin enters the first slot an eighth of a turn before its middle. Several rows have no single impulse."""
    sol = mbdae.solve(mbdae.load("geneva_drive"), (0, 0.1))
    known = sol.signals()
    at = int(np.argmax(known["mode.slot 1"]))
    assert known["q.crank"][at] == pytest.approx(-np.pi / 4, abs=1e-12)
    np.testing.assert_array_equal(known["mode.slot 1"], np.arange(len(sol.t)) >= at)
    np.testing.assert_array_equal(known["mode.dwell"], np.arange(len(sol.t)) < at)
    assert not any(name.startswith("impulse.") for name in known)


@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
def test_a_window_that_begins_removes_inconsistent_speeds(rtol):
    """Without projection the wheel drifts, and is not quite at rest when its dwell begins: no step can correct that."""
    sol = mbdae.solve(mbdae.load("geneva_drive"), (0, 5), rtol=rtol, project=False)
    assert sol.success, sol.message
    assert len(sol.modes) == 11
    np.testing.assert_allclose(sol.q[:, 1], wheel(sol.q[:, 0]), atol=1e3 * rtol)
    assert mbdae.drift(sol).energy_relative < 10 * rtol
    assert not sol.impacts


def test_depth_of_windows():
    some = ActiveRange(joint="a", windows=((-1, 1), (3, 4)), period=10)
    places = {0: 1, 0.75: 0.25, 10.75: 0.25, -9.5: 0.5, 2: -1, 3.5: 0.5, 5: -1}
    assert {x: some.depth(x) for x in places} == pytest.approx(places)
    assert some.shortest == 1
    assert ActiveRange(joint="a", windows=((0, 5),)).shortest == 5
    other_periods = ActiveRange(joint="a", windows=((0.5, 1), (-2.8, -2.4)), period=4)
    assert other_periods.shortest == pytest.approx(0.2), "from 1 to 1.2"


def test_wrong_windows_are_rejected():
    with pytest.raises(InputError, match=r"a window is a pair .lower, upper., lower below upper"):
        ActiveRange(joint="a", windows=((1, 0),))
    with pytest.raises(InputError, match="a window is shorter than the period"):
        ActiveRange(joint="a", windows=((0, 7),), period=6)
    for windows, period in [
        (((0, 1), (0.5, 2)), None),
        (((1, 2), (0, 1)), None),
        (((0, 1), (10, 10.5)), 2),
        (((0.5, 1), (-1, 0.5)), 2),
        (((-3.1415926, 3.1415926),), 2 * np.pi),
    ]:
        with pytest.raises(InputError, match="windows overlap or touch: join them into one"):
            ActiveRange(joint="a", windows=windows, period=period)
