"""Conserved momenta, against closed forms and difference quotients, and the error of the way back."""

import numpy as np
import pytest
from bodies import body, load
from commands import call

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism.signals.momentum import momenta

FREE = {f"momentum.{x}" for x in "xyz"} | {f"angular_momentum.origin.{x}" for x in "xyz"}
MOMENTS = [0.003, 0.004, 0.006, 0.0, 0.0, 0.0]


def free_body(folder, gravity):
    start = {"v": {"body": [0.3, -0.2, 0.5, 2.0, -1.0, 3.0]}}
    return load(folder, [body(inertia=MOMENTS)], [], gravity=gravity, start=start)


def test_momenta_of_a_body_are_those_of_the_closed_form(tmp_path):
    mech, rng = free_body(tmp_path, [0.0, 0.0, 0.0]), np.random.default_rng(3)
    x, quaternion, c, w, a = rng.standard_normal(3), rng.standard_normal(4), *rng.standard_normal((2, 3)), np.zeros(6)
    q = np.array([*x, *quaternion / np.linalg.norm(quaternion)])
    found = momenta(mech.model, q[None], np.array([[*c, *w]]), a[None])
    b, d = q[3:6], q[6]
    skew = np.cross(np.eye(3), b)
    R = np.eye(3) + 2 * d * skew + 2 * skew @ skew
    assert np.allclose(found.value[0, :3], R @ c)  # mass 1
    assert np.allclose(found.value[0, 3:6], R @ (MOMENTS[:3] * w) + np.cross(x, R @ c))
    assert np.allclose(found.value[0, 6:], [*c, *(MOMENTS[:3] * w)])


@pytest.mark.parametrize("model", ["four_bar", "heavy_top", "dual_arm", "n_four_bar?N=26"])  # nv = 53: more than 50
def test_rates_are_those_of_difference_quotients(model):
    mech, h = mbdae.load(model), 1e-4
    sol = mbdae.solve(mech, (0, 8 * h), method="pherk6", step=h)
    found = momenta(mech.model, sol.q, sol.v, sol.vdot)
    weights = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
    np.testing.assert_allclose(found.rate[4], weights @ found.value / h, atol=1e-7 * found.rate_size.max(), rtol=0)


@pytest.mark.parametrize("down", [0.0, -9.81])
def test_momenta_of_a_free_body(down, tmp_path):
    sol = mbdae.solve(free_body(tmp_path, [0.0, 0.0, down]), (0, 1), method="rattle4", step=0.01)
    found = mbdae.drift(sol, long_time=True)
    kept = FREE if not down else {"momentum.x", "momentum.y", "angular_momentum.origin.z"}
    assert set(found.momenta) == kept
    assert max(found.momenta.values()) < 1e-12


@pytest.mark.parametrize(
    ("method", "least", "most"), [("rattle4", 0, 1e-11), ("pherk6", 1e-9, 1e-5), ("alpha", 1e-3, 1)]
)
def test_the_top_keeps_its_vertical_angular_momentum(method, least, most):
    """A symmetric top has two cyclic coordinates: its precession, and its spin, which every method keeps."""
    found = mbdae.drift(mbdae.solve("heavy_top", (0, 0.5), method=method, step=0.002), long_time=True)
    assert set(found.momenta) == {"angular_momentum.origin.z", "p.top.wy"}
    assert least <= found.momenta["angular_momentum.origin.z"] < most
    assert found.momenta["p.top.wy"] < 1e-11


def test_a_linkage_on_the_ground_keeps_none():
    sol = mbdae.solve("four_bar", (0, 1), method="pherk6", step=0.02)
    assert mbdae.drift(sol, long_time=True).momenta == {}
    assert mbdae.drift(sol).momenta is None


@pytest.mark.parametrize(
    ("method", "least", "most"), [("rattle4", 0, 1e-11), ("pherk6", 1e-9, 1e-3), ("alpha", 1e-4, 1)]
)
def test_a_run_back_returns_if_the_method_is_symmetric(method, least, most):
    found = mbdae.drift(mbdae.solve("four_bar", (0, 2), method=method, step=0.02), long_time=True)
    assert least <= max(found.reversal) < most


def test_a_run_back_that_ends_early_is_said_so():
    sol = mbdae.solve("four_bar", (0, 0.2), method="rattle2", step=0.01)
    sol.settings["step"] = 0.1
    sol.v[-1] *= 100
    found = mbdae.drift(sol, long_time=True)
    assert found.reversal is None
    assert "run back to the start: ended early" in str(found)


def test_textbook_problems_are_rejected():
    with pytest.raises(InputError, match="'Point on a circle' is a textbook problem"):
        mbdae.drift(mbdae.solve("circle", (0, 0.1)), long_time=True)


def test_on_the_command_line():
    code, out, _ = call("drift", "heavy_top", "-m", "rattle2", "--step", "0.002", "-t", "0.1", "--long-time")
    assert code == 0
    assert "conserved momenta, relative change: angular_momentum.origin.z" in out
    assert "run back to the start: |dq| " in out
