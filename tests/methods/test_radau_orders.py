"""Orders of radau1 to radau9 in q, v, hidden lam and lam of the method, on both back ends, on flat joints and with
quaternions.

The reference is pherk6. q, v and lam of the highest orders soon reach rounding; lam of the method needs finer steps.

The reference is pherk6. q, v and lam of the highest orders soon meet rounding; the own lam needs finer steps.
"""

from functools import cache

import numpy as np
import pytest
from shared import shared_model

import mbdae
from mbdae.methods import method

SPANS = {"four_bar": 0.44, "heavy_top": 0.04}  # s; revolute joints, and a free one
STEPS = {  # by stages: for q, v and lam, and for lam of the method
    "four_bar": {1: (128, 128), 2: (32, 128), 3: (16, 64), 4: (16, 64), 5: (8, 32)},
    "heavy_top": {1: (128, 128), 2: (32, 32), 3: (16, 16), 4: (8, 8), 5: (4, 4)},
}
MARGIN = {5: 0.5}  # steps that show order 9 to 0.2 leave errors of rounding alone; 0.2 for the others
ENDS = 4  # common times
BACKENDS = [pytest.param("native", marks=pytest.mark.native), "python"]


def sample(name, n, run):
    """q, v, both lam at common times."""
    sol = mbdae.solve(shared_model(name), (0, SPANS[name]), step=SPANS[name] / n, **run)
    assert sol.ended, sol.message
    at = np.arange(1, ENDS + 1) * (n // ENDS)
    hidden = [sol.at(int(i)).derivative(sol.t[i], sol.y[i], sol.z_own[i])[1] for i in at]
    return sol.q[at], sol.v[at], sol.z_own[at], np.array(hidden)


@cache
def reference(name):
    q, v, _, lam = sample(name, 800, {"method": "pherk6"})
    return q, v, lam, lam


def errors(name, n, run):
    manifold, found, best = shared_model(name).manifold, sample(name, n, run), reference(name)
    turned = [manifold.difference(b, a) for a, b in zip(found[0], best[0], strict=True)]
    return np.array([np.abs(turned).max(), *(np.abs(a - b).max() for a, b in zip(found[1:], best[1:], strict=True))])


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("stages", range(1, 6))
@pytest.mark.parametrize("name", SPANS)
def test_orders(name, stages, backend):
    m = method(f"radau{2 * stages - 1}")
    run, slopes = {"method": m.name, "backend": backend}, []
    for n in dict.fromkeys(STEPS[name][stages]):
        coarse, fine = errors(name, n, run), errors(name, 2 * n, run)
        slopes.append(np.log2(coarse / fine))
    q, v, _, lam = slopes[0]
    assert min(q, v, lam) > m.order - MARGIN.get(stages, 0.2), (q, v, lam)
    assert max(q, v, lam) < m.order + 0.6, (q, v, lam)
    assert max(s[2] for s in slopes) > m.order_own - 0.2, slopes
