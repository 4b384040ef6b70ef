"""Andrews' squeezing mechanism: accuracy and work against a reference in quadruple precision and the Fortran codes."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import mbdae
from mbdae.studies.drift.drift import drift

DATA = json.loads((Path(__file__).parents[1] / "data" / "andrews_squeezer.json").read_text())
END = 0.03  # s
FORTRAN = {  # error of q and solves of PHEM56 and HEM5, full linear algebra; rows with an error above 1e-8
    "pherk5": [(3.2e-5, 607), (2.6e-7, 1273)],
    "herk5": [(2.2e-5, 768), (1.3e-7, 1840)],
}
TOLERANCES = {"pherk5": np.logspace(-5, -9, 9), "herk5": np.logspace(-3, -5.5, 6)}


def reference(mech):
    """End values q and v in the mechanism's order of joints."""
    order = [DATA["coordinates"].index(name) for name in mech.joint_names]
    return (np.array([float(x) for x in DATA["end"][key]])[order] for key in "qv")


both = pytest.mark.parametrize("backend", ["native", "python"])


@cache
def run(backend, method, rtol, atol=None):
    mech = mbdae.load("andrews_squeezer")
    sol = mbdae.solve(mech, (0, END), method=method, rtol=rtol, atol=atol, project=False, backend=backend)
    q, v = reference(mech)
    return sol, np.abs(sol.q[-1] - q).max(), np.abs(sol.v[-1] - v).max()


@both
def test_pherk5_reaches_the_quadruple_reference(backend):
    sol, error_q, error_v = run(backend, "pherk5", 1e-10)
    assert sol.success
    assert error_q <= 1e-8
    assert error_v <= 1e-5
    d = drift(sol)
    assert d.Gv_max <= 1e-9
    assert d.energy_relative < 1e-9
    turned = (sol.q[-1] - sol.q[0])[sol.mechanism.joint_names.index("beta")]
    assert d.work_end == pytest.approx(0.033 * turned, rel=1e-9)


@both
@pytest.mark.parametrize("method", ["herk5", "pherk6", "hedop5"])
def test_other_methods_reach_it_too(method, backend):
    _, error_q, error_v = run(backend, method, 1e-8 if method == "herk5" else 1e-11)
    assert error_q <= 1e-8
    assert error_v <= 1e-5


@both
def test_fixed_steps_reach_it(backend):
    mech = mbdae.load("andrews_squeezer")
    q, _ = reference(mech)
    sol = mbdae.solve(mech, (0, END), method="pherk5", step=END / 1000, backend=backend)
    assert np.abs(sol.q[-1] - q).max() < 1e-8


@pytest.mark.slow
@both
@pytest.mark.parametrize("method", FORTRAN)
def test_work_at_equal_error_is_that_of_the_fortran_codes(method, backend):
    # at equal error, never at equal tolerance; atol = rtol as there
    points = []
    for rtol in TOLERANCES[method]:
        sol, error, _ = run(backend, method, rtol, rtol)
        points.append((np.log(error), np.log(sol.stats["solves"])))
    errors, solves = np.array(sorted(points)).T
    for error, theirs in FORTRAN[method]:
        ours = np.exp(np.interp(np.log(error), errors, solves))
        assert errors[0] < np.log(error) < errors[-1]
        assert ours <= 1.1 * theirs, (error, ours, theirs)


@both
def test_work_is_counted_as_the_tableau_says(backend):
    sol, _, _ = run(backend, "pherk5", 1e-8)
    tableau = mbdae.METHODS["pherk5"]
    stages = tableau.solves * (sol.stats["steps"] + sol.stats["rejected"])
    assert 0 <= sol.stats["solves"] - stages <= 2  # consistent start, guess of the first step
