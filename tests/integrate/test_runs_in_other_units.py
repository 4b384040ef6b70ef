"""Runs of five mechanisms in (mm, t, s), (km, g, h), Ms and us: the same motion and the same steps."""

import numpy as np
import pytest
from unit_systems import UNIT_SYSTEMS

import mbdae

MECHANISMS = ("four_bar", "slider_crank", "spatial_slider_crank", "stewart_platform", "andrews_squeezer")
WITHIN = 1e-9


def differs(found, expected, factor):
    return np.abs(found / factor - expected).max() / np.abs(expected).max()


@pytest.mark.parametrize(("backend", "method"), [("native", "herk5"), ("native", "pherk5"), ("python", "pherk5")])
@pytest.mark.parametrize("name", MECHANISMS)
def test_runs_of_fixed_steps_know_no_units(name, backend, method):
    """Nor does the size of a projection behind which the derivative that pherk5 carries is evaluated again."""
    mech, steps = mbdae.load(name), 100 if backend == "native" else 10
    end = min(mech.duration, 1.0) * steps / 200

    def run(mech, time):
        return mbdae.solve(mech, (0, end * time), method=method, step=end * time / steps, project=True, backend=backend)

    expected = run(mech, 1.0)
    for units in UNIT_SYSTEMS[1:]:
        found = run(units.mechanism(mech), units.time)
        assert found.status == expected.status == "finished"
        assert found.stats["f"] == expected.stats["f"]
        assert differs(found.q, expected.q, units.configuration(mech)) < WITHIN, units.name
        assert differs(found.v, expected.v, units.speeds(mech)) < WITHIN, units.name
        assert differs(found.lam, expected.lam, units.multipliers(mech)) < WITHIN, units.name


@pytest.mark.parametrize("name", MECHANISMS)
def test_runs_under_step_size_control_know_no_units(name):
    """With atol in the units of each component, error norms are equal; dense output shows the same motion."""
    mech = mbdae.load(name)
    end = min(mech.duration, 1.0)
    times = np.linspace(0.0, end, 21)

    def run(mech, time, atol, first):
        return mbdae.solve(mech, (0, end * time), rtol=1e-7, atol=atol, first_step=first * time)

    expected = run(mech, 1.0, np.full(2 * mech.nv, 1e-9), 1e-3 * end)
    for units in UNIT_SYSTEMS[1:]:
        atol = 1e-9 * np.concatenate([units.coordinates(mech), units.speeds(mech)])
        found = run(units.mechanism(mech), units.time, atol, 1e-3 * end)
        assert found.status == expected.status == "finished"
        assert len(found.t) == pytest.approx(len(expected.t), rel=0.01)  # rounding in error estimates changes steps
        q = found(times * units.time).q
        assert differs(q, expected(times).q, units.configuration(mech)) < WITHIN, units.name
