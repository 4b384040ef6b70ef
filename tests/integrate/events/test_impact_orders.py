"""A four-bar with ten impacts on a stop: methods keep their order, in both back ends, with studies and files."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import add_body, empty

import mbdae
from mbdae import Mechanism, Solution, Stop
from mbdae.errors import InputError

T = 4.9


@pytest.fixture(scope="module")
def four_bar():
    return mbdae.load("four_bar", stops=[Stop(joint="rocker", lower=1.1, upper=1.9, restitution=0.9)])


def sampled(sol):
    at = np.searchsorted(sol.t, np.arange(1, 17) * T / 16 * (1 + 1e-12), side="right") - 1
    return sol.q[at], sol.v[at]


@pytest.fixture(scope="module")
def reference(four_bar):
    one, other = (mbdae.solve(four_bar, (0, T), method=m, step=T / 8192) for m in ("pherk6", "herk5"))
    assert max(np.abs(a - b).max() for a, b in zip(sampled(one), sampled(other), strict=True)) < 1e-12
    return one


@pytest.mark.parametrize(
    ("method", "order", "ns", "backend"),
    [
        ("herk5", 4.8, (512, 1024, 2048, 4096), "native"),
        ("pherk5", 4.8, (512, 1024, 2048, 4096), "native"),
        ("pherk6", 5.7, (256, 512, 1024, 2048), "native"),
        ("herk5", 4.8, (64, 128, 256), "python"),
        ("pherk5", 4.8, (64, 128, 256), "python"),
        ("pherk6", 5.7, (64, 128, 256), "python"),
    ],
)
def test_orders_through_ten_impacts(four_bar, reference, method, order, ns, backend):
    errors = []
    for n in ns:
        sol = mbdae.solve(four_bar, (0, T), method=method, step=T / n, backend=backend)
        assert len(sol.impacts) == len(reference.impacts) >= 10
        errors.append([np.abs(a - b).max() for a, b in zip(sampled(sol), sampled(reference), strict=True)])
    slopes = -np.polyfit(np.log2(ns), np.log2(errors), 1)[0]
    assert (slopes >= order).all(), slopes


@pytest.mark.parametrize("method", ["herk5", "pherk5", "pherk6", "radau5"])
def test_both_back_ends_agree_through_ten_impacts(four_bar, method):
    backends = ("native", "python")
    native, python = (mbdae.solve(four_bar, (0, T), method=method, step=0.05, backend=b) for b in backends)
    assert native.modes == python.modes
    assert len(native.impacts) >= 10
    np.testing.assert_allclose(native.y, python.y, rtol=0, atol=1e-11)
    np.testing.assert_allclose([x.rows for x in native.impacts], [x.rows for x in python.impacts], atol=1e-10)


def test_energy_is_balanced_with_losses_and_loops_stay_closed(four_bar, reference):
    ends = [f"{kind}.rocker stop {end}" for kind in ("gap", "mode", "impulse") for end in ("lower", "upper")]
    s = reference.signals(["energy", "work", "potential", "g", "Gv", "q.rocker", *ends])
    off = s["energy"] - s["energy"][0] - s["work"]
    assert np.abs(off).max() < 1e-13 * np.ptp(s["potential"])
    lost = sum(x.loss for x in reference.impacts)
    assert lost == pytest.approx(-s["work"][-1], rel=1e-12)
    assert all(x.loss > 0 for x in reference.impacts)
    assert s["g"].max() < 1e-13
    assert s["Gv"].max() < 1e-12
    assert s["q.rocker"].min() > 1.1 - 1e-13
    hits = s["impulse.rocker stop lower"] + s["impulse.rocker stop upper"]
    assert hits.sum() == pytest.approx(sum(p for x in reference.impacts for p in x.impulse))
    np.testing.assert_allclose(s["gap.rocker stop upper"], 1.9 - s["q.rocker"], atol=1e-14)
    assert set(s["mode.rocker stop lower"]) == {0}
    # the pin of the loop transmits an impulse: no bar moves as a free one would
    assert all(np.linalg.norm(x.rows[:3]) > 1e-3 * x.impulse[0] for x in reference.impacts)


def test_runs_are_saved_and_read_again(four_bar, tmp_path):
    sol = mbdae.solve(four_bar, (0, 1.5), rtol=1e-8)
    sol.save(tmp_path / "run.npz")
    again = Solution.load(tmp_path / "run.npz")
    assert again.modes == sol.modes
    assert again.impacts == sol.impacts
    times = np.linspace(0, 1.5, 40)
    np.testing.assert_array_equal(again(times).q, sol(times).q)
    np.testing.assert_allclose(again.lam, sol.lam, rtol=1e-12, atol=1e-12)
    assert again.mechanism.stops == four_bar.stops


@pytest.mark.parametrize(
    ("how", "text"),
    [
        ({"formulation": "ggl"}, "'rocker stop lower': .* need formulation 'index2'"),
        ({"formulation": "index1", "method": "dop853"}, "'rocker stop lower': .* need formulation 'index2'"),
    ],
)
def test_what_knows_no_modes_refuses(four_bar, how, text):
    with pytest.raises(InputError, match=text):
        mbdae.solve(four_bar, (0, 1), **how)


def test_time_does_not_run_back(four_bar):
    with pytest.raises(InputError, match="cannot go backward in time"):
        mbdae.solve(four_bar, (0, -1))


def test_a_start_beyond_a_stop_is_rejected(four_bar):
    mech = mbdae.load("four_bar", stops=[Stop(joint="rocker", upper=1.0)])
    with pytest.raises(InputError, match=r"'rocker stop' is penetrated by .* rad at the start"):
        mbdae.solve(mech, (0, 1))


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"joint": "rocker"}, "a stop needs lower, upper or both"),
        ({"lower": 1.0}, "a stop needs joint, joints or limits = true"),
        ({"joint": "rocker", "lower": 1.0, "upper": 0.5}, "lower must lie below upper"),
        ({"joint": "rocker", "lower": 1.0, "restitution": 1.5}, "less than or equal to 1"),
        ({"joint": "rocker", "lower": 1.0, "end": 1.5}, "unknown key end; known: coefficients, joint"),
        ({"joints": ("rocker", "crank"), "lower": 1.0}, "a stop of joints needs coefficients"),
    ],
)
def test_wrong_stops_are_named(keys, text):
    with pytest.raises(InputError, match=text):
        Stop(**keys)


def test_unbounded_joints_have_no_ends():
    model = empty()
    add_body(model, 0, pin.JointModelRUBZ(), "wheel")
    with pytest.raises(InputError, match="joint 'wheel' has an unbounded angle"):
        Mechanism(model, stops=[Stop(joint="wheel", lower=0.0)])
