"""Random chains fall on a plane and against their stops: no penetration, no energy gain, no stalled run.

Of the seeds to 999 five end before 1 s, by name: chains that lie on the plane and roll, where a hinge is upright and
contact rows become dependent. All keep the balance of energy to 5e-11, most to 1e-12, and gain 1e-13.
"""

import numpy as np
import pytest
from bouncing import dropped_chain, gaps

import mbdae
from mbdae.solution.columns import residuals

LEAST = 1e-3  # J: a chain at rest from the start has no energy to compare with


# at rest; a stop without normal force; an end that hardly rotates; one that rolls over an upright hinge
@pytest.mark.parametrize("seed", [*range(12), 38, 51, 239, 21])
def test_a_chain_that_falls(seed):
    mech, q, v = dropped_chain(np.random.default_rng(seed))
    sol = mbdae.solve(mech, (0, 1.0), q, v, rtol=1e-11)
    assert sol.status in ("finished", "step_size", "rank")  # the run is checked up to this time
    assert gaps(mech, *sol.q).min() > -1e-11
    r = residuals(sol)
    energy, scale = r.kinetic + r.potential, max(r.kinetic.max(), np.ptp(r.potential), LEAST)
    assert (energy - energy[0]).max() < 1e-11 * scale
    assert np.abs(energy - energy[0] - sol.work + sol.work[0]).max() < 1e-10 * scale
    if sol.success and sol.impacts:
        assert sum(x.loss for x in sol.impacts) == pytest.approx(-sol.work[-1], abs=1e-9 * scale)


if __name__ == "__main__":  # a thousand of them: python -m tests.integrate.events.test_random_drops
    for number in range(1000):
        test_a_chain_that_falls(number)
