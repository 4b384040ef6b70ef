"""The pivot ratio of many rows, by which runs see singular configurations."""

import numpy as np
import pytest

import mbdae
from mbdae import backend


@pytest.mark.parametrize("N", [17, 60])
def test_many_rows_have_the_same_pivot_ratio_in_both_back_ends(N):
    """Sparse elimination in the core, pivoted QR in Python: off the closures, on them, and next to a singular place."""
    mech = mbdae.load("n_four_bar", N=N)
    core, python = mech.system(native=backend.load()), mech.system()
    rng, flat = np.random.default_rng(0), mech.start[0]
    for system in (core, python):
        system.rank = 2 * N  # of 3 N: the loops are planar
    for turn, away in ((0.0, 0.3), (0.0, 0.01), (np.pi / 2 - 1e-3, 1e-4)):  # equal loops would tie pivots
        q = flat + turn * np.array([1.0 if "coupler" in name else -1.0 for name in list(mech.model.names)[1:]])
        y = np.concatenate([q + away * rng.standard_normal(mech.nq), np.zeros(mech.nv + 1)])
        a, b = core.pivot_ratio(0.0, y), python.pivot_ratio(0.0, y)
        assert 1e-5 < b < 1
        U, G = python.inertia(0.0, y[: mech.nq]), python.jacobian(y[: mech.nq])
        singular = np.linalg.svd(np.linalg.solve(U.T, G.T), compute_uv=False)
        assert 1 <= b * singular[0] / singular[2 * N - 1] < 20, "pivots overestimate the smallest singular value"
        assert a == pytest.approx(b, rel=1e-6, abs=3e-8)
