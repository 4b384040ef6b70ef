"""Singular configurations at tolerances close to the rounding of the states beside them."""

import numpy as np
import pytest

import mbdae


@pytest.mark.native
@pytest.mark.parametrize("rtol", [1e-10, 3e-11, 1e-13])
def test_loops_that_flatten_together_at_tight_tolerances(rtol):
    """Nine parallelograms beside eleven other loops: they stay parallelograms, or the run says that it cannot cross."""
    row = mbdae.load("n_four_bar", N=20)
    model = row.model.copy()
    for i in range(10, 21):
        model.jointPlacements[model.getJointId(f"crank_{i}")].translation[0] += 0.05 * (-1) ** i
    mech = mbdae.Mechanism(model, row.closures)
    guess = {name: np.pi / 2 * (-1) ** name.startswith("coupler") for name in mech.joint_names}
    start = mech.assemble(q={"crank_0": np.pi / 2}, v={"crank_0": -1.0}, guess=guess)
    sol = mbdae.solve(mech, (0, 0.95), *start, rtol=rtol, backend="native")
    turned = sol.q[:, [mech.joint_names.index(f"crank_{i}") for i in range(10)]]
    assert np.ptp(turned, axis=1).max() < 1e-8
    if rtol > 1e-12:
        assert sol.success, sol.message
        assert [(round(x.t, 6), len(x.closures)) for x in sol.singular] == [(0.863074, 9)]
    else:
        assert sol.status == "rank"
        assert "no step crosses the singular configuration near t = 0.86307" in sol.message
