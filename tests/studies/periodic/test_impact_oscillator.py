"""Motions of the impact oscillator, in closed form."""

import numpy as np
import pytest
from impact_oscillator import E, S, T, Z, impact_motion, oscillator

import mbdae
from mbdae.errors import InputError


@pytest.mark.parametrize("speed", [0.3, 1.0, 3.0])
def test_one_impact_per_period(speed):
    """Half a period after the impact; det = e^2 exp(-2 z T), whatever the motion."""
    exact = impact_motion(speed)
    x, v = exact.start
    found = mbdae.periodic(oscillator(exact.force, exact.phase + np.pi), q=[x + 1e-4], v=[v - 1e-4], rtol=1e-11)
    assert pytest.approx(T, rel=1e-14) == found.T
    np.testing.assert_allclose([found.q[0], found.v[0]], exact.start, atol=1e-9)
    (impact,) = found.run.impacts
    assert impact.t == pytest.approx(T / 2, abs=1e-10)
    assert np.prod(found.multipliers).real == pytest.approx(E**2 * np.exp(-2 * Z * T), rel=1e-9)
    np.testing.assert_allclose(np.poly(found.multipliers), np.poly(exact.monodromy), rtol=1e-9, atol=1e-9)
    assert found.stability == ("stable" if np.abs(np.linalg.eigvals(exact.monodromy)).max() < 1 else "unstable")


def test_an_impact_where_the_period_begins_is_one_line():
    """From the exact state after the impact at t = 0."""
    exact = impact_motion(1.0)
    with pytest.raises(InputError, match="'stop' is hit where a segment of the period begins or ends: begin at"):
        mbdae.periodic(oscillator(exact.force, exact.phase), q=[-S], v=[1.0], rtol=1e-9)


def test_slow_impacts_are_found_wherever_they_are_in_a_step():
    """The gap is negative for 2 u/(e a), 1e-4 of a period; the impact moves through a step of 0.02 s."""
    exact = impact_motion(0.0011)
    (x, v), mech = exact.start, oscillator(exact.force, exact.phase + np.pi)
    for h in np.linspace(0.02, 0.0204, 24):
        sol = mbdae.solve(mech, (0, 0.51 * T), [x], [v], rtol=1e-9, max_step=float(h))
        assert [impact.t for impact in sol.impacts] == pytest.approx([T / 2], abs=1e-6)
