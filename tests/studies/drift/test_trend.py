"""Linear trends of oscillating quantities, and of the energy in long runs."""

import numpy as np
import pytest

import mbdae
from mbdae.studies.drift.trend import linear_trend


def test_a_line_under_an_oscillation():
    t = np.sort(np.random.default_rng(0).uniform(0, 100, 4000))
    trend, error = linear_trend(t, 3e-3 * t + np.sin(20 * t))
    assert abs(trend - 3e-3) < 3 * error < 3e-3


def test_backward_in_time():
    t = np.linspace(10, 0, 1000)
    assert linear_trend(t, 2 * t)[0] == pytest.approx(2, rel=1e-12)


def test_the_standard_error_is_that_of_correlated_noise():
    """Random walks of first order: three of four trends lie within 1.15 standard errors, nearly all within three."""
    rng, t, found = np.random.default_rng(1), np.arange(1000.0), []
    for _ in range(200):
        noise = rng.standard_normal(1000)
        for i in range(1, 1000):
            noise[i] += 0.97 * noise[i - 1]
        trend, error = linear_trend(t, noise)
        found.append(abs(trend) / error)
    assert np.mean(np.array(found) < 3) > 0.97
    assert 0.55 < np.mean(np.array(found) < 1.15) < 0.95


def test_short_runs_have_no_trend():
    assert linear_trend(np.arange(99.0), np.ones(99)) is None
    assert mbdae.drift(mbdae.solve("pendulum", (0, 0.1))).energy_trend is None


def test_symplectic_methods_have_no_trend_where_others_have():
    """200 s of the four-bar: the energy of RATTLE oscillates, that of a half-explicit method grows in proportion."""
    found = {m: mbdae.drift(mbdae.solve("four_bar", (0, 200), method=m, step=0.025)) for m in ("rattle4", "pherk6")}
    assert abs(found["rattle4"].energy_trend) < 3 * found["rattle4"].energy_trend_error
    assert found["pherk6"].energy_trend > 3 * found["pherk6"].energy_trend_error
    assert "energy trend" in str(found["pherk6"])
