"""Guards against a wrong crossing of a singular configuration: falling parallelograms.

Their cranks rotate together, and one along x loses rank. The balance of energy, which no crossing computes, and all
rows at all nodes verify the point after the crossing.
"""

import numpy as np
import pytest

import mbdae
from mbdae import JointTorque
from mbdae.integrate.events import singularity
from mbdae.mechanism.time_functions.time_functions import Harmonic


def shaken(omega):
    """A parallelogram whose driving torque oscillates several times before the singular configuration."""
    force = JointTorque(joint="crank_0", torque=Harmonic(amplitude=20.0, omega=omega, phase=0.3))
    return mbdae.load("n_four_bar", N=1, forces=[force])


def crossed(mech, **options):
    sol = mbdae.solve(mech, (0, 1), project=True, **options)
    assert sol.success, sol.message
    assert len(sol.singular) == 1
    return sol


@pytest.mark.parametrize(("omega", "rtol", "lost"), [(150.0, 1e-3, 3e-3), (400.0, 1e-3, 3e-3)])
def test_at_loose_tolerances_the_singularity_is_located_before_it_is_crossed(omega, rtol, lost):
    """Polynomials through such distant states miss the oscillations, by less than the tolerance and more than 1e-5."""
    assert mbdae.drift(crossed(shaken(omega), method="herk3", rtol=rtol)).energy_relative < lost


@pytest.mark.parametrize("method", ["pherk5", "radau5"])
def test_a_crossing_is_located_to_the_tolerance(method):
    assert mbdae.drift(crossed(shaken(60.0), method=method, rtol=1e-7)).energy_relative < 1e-6


@pytest.mark.parametrize("loops", [1, 2])
def test_the_point_after_a_crossing_satisfies_all_rows(loops):
    mech = mbdae.load("n_four_bar", N=loops)
    system = mech.system()
    for rtol in (1e-4, 1e-6, 1e-9):
        ts, ys, _ = crossed(mech, rtol=rtol).nodes
        rows = [system.residual(t, *system.split(y)) for t, y in zip(ts, ys, strict=True)]
        assert max(np.abs(g).max() for g, _ in rows) < 1e-12
        assert max(np.abs(rate).max() for _, rate in rows) < 1e-13


def test_a_crossing_projected_too_far_is_rejected(monkeypatch):
    """Projection of the point after the crossing may lead elsewhere: here a thousandth of a second further."""
    mech, honest, tried = mbdae.load("n_four_bar", N=1), singularity.cross_singularity, []

    def counted(system, *args):
        found = honest(system, *args)
        tried.append(found)
        return found

    def beside(system, *args):
        found = counted(system, *args)
        if len(tried) != accepted:
            return found
        q, v = system.split(found.y)
        y = np.concatenate([system.manifold.integrate(q, 1e-3 * v), found.y[system.nq :]])
        return found._replace(y=y, correction=found.correction + system.difference(found.y, y))

    monkeypatch.setattr(singularity, "cross_singularity", counted)
    expected = crossed(mech, rtol=1e-8)
    accepted = len(tried)
    assert tried[-1].t in expected.nodes[0]
    tried.clear()
    monkeypatch.setattr(singularity, "cross_singularity", beside)
    sol = crossed(mech, rtol=1e-8)
    assert len(tried) > accepted
    assert sol.singular[0].t == pytest.approx(expected.singular[0].t, abs=1e-7)
    np.testing.assert_allclose(sol.q[-1], expected.q[-1], atol=1e-6)
