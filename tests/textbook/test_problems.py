"""Every textbook problem: a consistent start, and slopes against difference quotients."""

import numpy as np
import pytest
from chains import difference_quotient

from mbdae.textbook.problems import TEXTBOOK


@pytest.mark.parametrize("name", TEXTBOOK)
def test_start_and_slopes(name):
    problem, rng, t, h = TEXTBOOK[name](), np.random.default_rng(3), 0.37, 1e-3
    assert problem.g(0.0, problem.point()) == pytest.approx(0, abs=1e-14)
    y = problem.point() + 0.01 * rng.normal(size=len(problem.y0))
    z, dy, dz = (rng.normal(size=n) for n in (len(problem.z0), len(y), len(problem.z0)))
    for slope, path in {
        "g_y": (problem.g_y(t, y) @ dy, lambda s: problem.g(t, y + s * dy)),
        "g_t": (problem.g_t(t, y), lambda s: problem.g(t + s, y)),
        "f_z": (problem.f_z(t, y, z) @ dz, lambda s: problem.f(t, y, z + s * dz)),
        "f_y": (problem.f_y and problem.f_y(t, y, z) @ dy, lambda s: problem.f(t, y + s * dy, z)),
    }.values():
        if slope is not None:
            assert slope == pytest.approx(difference_quotient(path, h), rel=1e-8, abs=1e-8)
