"""The acceleration form with scipy's solvers: agreement with the index-2 methods, stabilisation, what is kept."""

import numpy as np
import pinocchio as pin
import pytest
from test_formulations import distance, free_loop, levels, model, run, start_of

import mbdae
from mbdae import Mechanism

FLAT = [(n, m) for n in ("four_bar", "slider_crank") for m in ("RK45", "DOP853", "Radau", "LSODA")]
CURVED = [(n, m) for n in ("heavy_top", "free_loop") for m in ("RK45", "DOP853")]


@pytest.mark.parametrize(("name", "method"), FLAT + CURVED)
def test_index1_agrees_with_index2(name, method):
    mech = model(name)
    T = 0.1 if name == "heavy_top" else 0.5  # it spins fast
    reference = run(mech, T, method="pherk6", rtol=1e-12)
    sol = run(mech, T, method=method, formulation="index1", rtol=1e-10 if method != "Radau" else 1e-8)
    assert max(distance(mech, reference, sol)) < 1e-7
    assert pin.isNormalized(mech.model, sol.q[-1], 1e-14)
    np.testing.assert_allclose(sol.lam_own[-1], sol.lam[-1], rtol=1e-9, atol=1e-9)
    assert (sol.stats["rejected"] is None) == (method in ("Radau", "LSODA"))
    middle, near = sol(0.6 * T), reference(0.6 * T)
    assert np.abs(mech.manifold.difference(middle.q, near.q)).max() < 1e-6
    assert np.abs(middle.v - near.v).max() < 1e-5


def test_index1_raw_coordinates_move_with_the_tangent_map():
    mech = free_loop()
    system = mech.system("index1")
    y = np.concatenate([*start_of(mech), [0.0]])
    rate = system.rate(0.0, y)[0][: mech.nq]
    q, v, h = y[: mech.nq], y[mech.nq : mech.nq + mech.nv], 1e-5
    ahead, behind = pin.integrate(mech.model, q, h * v), pin.integrate(mech.model, q, -h * v)
    np.testing.assert_allclose(rate, (ahead - behind) / (2 * h), atol=1e-9)


def test_baumgarte_reduces_the_drift():
    mech = mbdae.load("four_bar")
    options = {"method": "RK45", "formulation": "index1", "rtol": 1e-6}
    plain, stabilised = run(mech, 10.0, **options), run(mech, 10.0, baumgarte=(10.0, 10.0), **options)
    assert levels(plain)[0] > 20 * levels(stabilised)[0]
    assert stabilised.settings["baumgarte"] == (10.0, 10.0)


def test_index1_counts_steps_and_stops_by_name():
    mech = mbdae.load("four_bar")
    options = {"method": "RK45", "formulation": "index1"}
    sol = run(mech, 1.0, **options)
    assert sol.stats["f"] == 6 * (sol.stats["steps"] + sol.stats["rejected"]) + 3  # the start, scipy's, its guess of h
    short = mbdae.solve(mech, (0.0, 1.0), max_steps=7, **options)
    assert (short.status, len(short.t)) == ("max_steps", 8)
    largest = run(mech, 1.0, max_step=0.01, first_step=1e-3, **options)
    assert np.diff(largest.t).max() <= 0.01 * (1 + 1e-12)
    assert largest.t[1] == pytest.approx(1e-3)
    there = run(mech, 1.0, rtol=1e-10, **options)
    back = mbdae.solve(mech, (1.0, 0.0), there.q[-1], there.v[-1], rtol=1e-10, **options)
    assert np.abs(back.q[-1] - there.q[0]).max() < 1e-7


@pytest.mark.parametrize("method", ["RK45", "LSODA"])
def test_index1_keeps_what_was_computed(method):
    def interrupt(done):
        if done > 0.5:
            raise KeyboardInterrupt

    options = {"method": method, "formulation": "index1"}
    sol = mbdae.solve(mbdae.load("pendulum"), (0.0, 1.0), progress=interrupt, **options)
    assert (sol.status, sol.success) == ("interrupted", False)
    assert 0.5 < sol.t[-1] < 1

    def broken(t, q, v):
        return np.full(3, np.nan if t > 0.5 else 0.0)

    pendulum = mbdae.load("pendulum")
    bad = Mechanism(pendulum.model, pendulum.closures, [broken], start=pendulum.start_values)
    sol = mbdae.solve(bad, (0.0, 1.0), **options)
    assert (sol.status, sol.success) == ("nonfinite", False)
    assert "broken" in sol.message
    assert 0.1 < sol.t[-1] <= 0.5
