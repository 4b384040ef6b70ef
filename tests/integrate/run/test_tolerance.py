"""The achieved error follows the tolerance, for every method on four models."""

from functools import cache

import numpy as np
import pytest

import mbdae

CASES = {"four_bar": 0.4, "pendulum": 0.7, "slider_crank": 0.3, "heavy_top": 0.03}  # s


def tolerances(method):
    """Low orders are not tested at tight tolerances: it would take a hundred thousand steps."""
    if method.order < 3:
        return [1e-3, 1e-4, 1e-5]
    return [1e-4, 1e-6, 1e-8, 1e-10]


@cache
def reference_of(model, method):
    """A tight reference at ten times, and the mechanism."""
    mech, T = mbdae.load(model), CASES[model]
    times = np.linspace(0, T, 11)[1:]
    return mech, mbdae.solve(mech, (0, T), method=method, rtol=1e-13, atol=1e-13, t_eval=times)


@pytest.mark.slow
@pytest.mark.parametrize("model", CASES)
@pytest.mark.parametrize("name", [name for name, m in mbdae.METHODS.items() if m.error_power])
def test_error_follows_tolerance(model, name):
    mech, reference = reference_of(model, "herk5" if name == "pherk6" else "pherk6")
    ratios = []
    for rtol in tolerances(mbdae.METHODS[name]):
        sol = mbdae.solve(mech, (0, CASES[model]), method=name, rtol=rtol, atol=rtol, t_eval=reference.t)
        assert sol.ended, sol.message
        pairs = zip(reference.q, sol.q, strict=True)
        error_q = max(np.abs(mech.manifold.difference(a, b)).max() for a, b in pairs)
        error_v = np.abs(sol.v - reference.v).max() / max(1.0, np.abs(reference.v).max())
        ratios.append(max(error_q, error_v) / rtol)
    assert max(ratios) / min(ratios) <= 100, ratios
