"""Random chains fall on a plane and against their stops: nothing goes through, gains energy or hangs."""

import numpy as np
import pytest
from bouncing import dropped_chain, gaps

import mbdae
from mbdae.errors import STATUS
from mbdae.solution.columns import residuals

LEAST = 1e-3  # J: what lies still from the start has no energy of its own to compare with


@pytest.mark.parametrize("seed", [*range(12), 38, 51, 239])  # lies still; a stop without load; an end that hardly turns
def test_a_chain_that_falls(seed):
    mech, q, v = dropped_chain(np.random.default_rng(seed))
    sol = mbdae.solve(mech, (0, 1.0), q, v, rtol=1e-8)
    assert sol.success or (sol.status in STATUS and sol.message)
    assert min(gaps(mech, y[: mech.nq]).min() for y in sol.y) > -1e-9
    r = residuals(sol)
    energy, scale = r.kinetic + r.potential, max(r.kinetic.max(), np.ptp(r.potential), LEAST)
    assert (energy - energy[0]).max() < 1e-8 * scale
    assert np.abs(energy - energy[0] - sol.work + sol.work[0]).max() < 1e-6 * scale
    if sol.success and sol.impacts:
        assert sum(x.loss for x in sol.impacts) == pytest.approx(-sol.work[-1], abs=1e-9 * scale)


if __name__ == "__main__":  # a thousand of them: python -m tests.integrate.modes.test_random_drops
    for number in range(1000):
        test_a_chain_that_falls(number)
