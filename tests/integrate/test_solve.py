"""The time loop: results at steps and between them, backwards, in threads, from files."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pinocchio as pin
import pytest
from chains import rod, tree
from shared import shared_model

import mbdae
from mbdae import Closure, MbdaeError, Mechanism, Solution
from mbdae.studies.drift.drift import drift

T = 0.4  # s


@pytest.fixture(scope="module")
def four_bar():
    return shared_model("four_bar")


@pytest.fixture(scope="module")
def exact(four_bar):
    return mbdae.solve(four_bar, (0, T), method="pherk6", rtol=1e-13, atol=1e-13)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("method", ["herk3", "herk5", "pherk3", "pherk4", "pherk5", "pherk6", "hedop5"])
def test_errors_follow_the_tolerance(four_bar, exact, method):
    errors = []
    for rtol in (1e-5, 1e-7):
        sol = mbdae.solve(four_bar, (0, T), method=method, rtol=rtol)
        assert sol.t[-1] == T
        errors.append(np.abs(sol.q[-1] - exact.q[-1]).max())
        assert errors[-1] < 300 * rtol
    assert errors[1] < 0.1 * errors[0]


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("method", ["herk5", "pherk4", "pherk5", "pherk6"])
def test_between_steps_the_solution_is_as_good_as_at_them(four_bar, exact, method):
    sol = mbdae.solve(four_bar, (0, T), method=method, rtol=1e-8)
    ends = max(np.abs(sol(t).q - exact(t).q).max() for t in sol.t[1:])
    for t in sol.t[:-1] + np.diff(sol.t) * np.linspace(0.1, 0.9, len(sol.t) - 1):
        q, v = sol(t)
        assert np.abs(q - exact(t).q).max() < 4 * ends + 1e-10
        assert np.abs(v - exact(t).v).max() < 4 * ends * 100 + 1e-9
        assert np.abs(four_bar.residual(q, v)[1]).max() < 1e-5


@pytest.mark.usefixtures("back_end")
def test_the_solution_is_continuous_and_its_rate_is_v(four_bar):
    sol = mbdae.solve(four_bar, (0, 1), method="pherk5", step=0.05)
    for t in sol.t[1:-1]:
        before, after = sol(t - 1e-9), sol(t + 1e-9)
        assert np.abs(before.q - after.q).max() < 1e-7
        assert np.abs(before.v - after.v).max() < 1e-5
    for t in (0.3141, 0.777):
        rate = (sol(t + 1e-5).q - sol(t - 1e-5).q) / 2e-5
        np.testing.assert_allclose(sol(t).v, rate, atol=1e-7)


@pytest.mark.usefixtures("back_end")
def test_times_on_demand(four_bar):
    times = np.array([0.0, 0.1, 0.25, 1.0])
    plain = mbdae.solve(four_bar, (0, 1), rtol=1e-8)
    asked = mbdae.solve(four_bar, (0, 1), rtol=1e-8, t_eval=times)
    np.testing.assert_array_equal(asked.t, times)
    assert asked.stats["steps"] == plain.stats["steps"]
    for t, q, v in zip(times, asked.q, asked.v, strict=True):
        np.testing.assert_allclose(q, plain(t).q, rtol=1e-13, atol=1e-14)  # here one by one, there all at once
        np.testing.assert_allclose(v, plain(t).v, rtol=1e-13, atol=1e-13)
    np.testing.assert_array_equal(asked.q[-1], plain.q[-1])
    assert asked(0.6).q == pytest.approx(plain(0.6).q)
    for t in (-0.1, 1.1, np.nan):
        with pytest.raises(MbdaeError, match=r"outside the solution, 0\.0 to 1\.0"):
            plain(t)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{"rtol": 1e-10}, {"step": 2e-3}])
def test_there_and_back(four_bar, options):
    there = mbdae.solve(four_bar, (0, T), **options)
    back = mbdae.solve(four_bar, (T, 0), there.q[-1], there.v[-1], **options)
    assert back.t[0] == T
    assert back.t[-1] == 0
    assert (np.diff(back.t) < 0).all()
    np.testing.assert_allclose(back.q[-1], there.q[0], atol=1e-7)
    np.testing.assert_allclose(back.v[-1], there.v[0], atol=1e-7)
    np.testing.assert_allclose(back(0.2321).q, there(0.2321).q, atol=1e-7)
    asked = mbdae.solve(four_bar, (T, 0), there.q[-1], there.v[-1], t_eval=[0.3, 0.1], **options)
    np.testing.assert_allclose(asked.q, [there(0.3).q, there(0.1).q], atol=1e-7)


@pytest.mark.usefixtures("back_end")
def test_a_run_that_is_cut_in_two_is_the_same_run(four_bar, exact):
    first = mbdae.solve(four_bar, (0, 0.3), rtol=1e-11)
    second = mbdae.solve(four_bar, (0.3, T), first.q[-1], first.v[-1], rtol=1e-11)
    np.testing.assert_allclose(second.q[-1], exact.q[-1], atol=1e-8)


@pytest.mark.usefixtures("back_end")
def test_fixed_steps_end_at_the_end(four_bar):
    """Over a tenth of a second, where steps of any size stay near the closures."""
    sol = mbdae.solve(four_bar, (0, 0.1), method="herk2", step=0.03)
    np.testing.assert_allclose(sol.t, [0, 0.03, 0.06, 0.09, 0.1], rtol=1e-15)
    for step, nodes in ((0.03, 5), (0.01, 11), (5.0, 2)):
        sol = mbdae.solve(four_bar, (0, 0.1), step=step)
        assert (sol.status, len(sol.t)) == ("finished", nodes)
        assert drift(sol).g_max < 1e-5
    still = mbdae.solve(four_bar, (1, 1))
    assert (still.status, len(still.t)) == ("finished", 1)


@pytest.mark.usefixtures("back_end")
def test_step_limits_are_kept(four_bar):
    sol = mbdae.solve(four_bar, (0, 1), rtol=1e-4, max_step=0.01, first_step=0.002)
    assert np.diff(sol.t).max() <= 0.01 * (1 + 1e-12)
    assert sol.t[1] == pytest.approx(0.002)


@pytest.mark.usefixtures("back_end")
def test_a_wheel_that_turns_many_times_within_a_step():
    model = tree(["ruby"], [0])
    model.inertias[1].lever = np.zeros(3)
    sol = mbdae.solve(Mechanism(model), (0, 20), np.array([1.0, 0]), np.array([3.0]), rtol=1e-6)
    assert np.diff(sol.t).max() * 3 > 2 * np.pi
    for t in np.linspace(0, 20, 37):
        q, v = sol(t)
        np.testing.assert_allclose(v, [3.0], rtol=1e-12)
        np.testing.assert_allclose(q, [np.cos(3 * t), np.sin(3 * t)], atol=1e-11)


@pytest.mark.usefixtures("back_end")
def test_a_mechanism_may_be_shared_between_threads(four_bar):
    alone = mbdae.solve(four_bar, (0, T), rtol=1e-7)
    gate = threading.Barrier(3)

    def run(_):
        gate.wait()
        return mbdae.solve(four_bar, (0, T), rtol=1e-7)

    with ThreadPoolExecutor(3) as pool:
        for sol in pool.map(run, range(3)):
            np.testing.assert_array_equal(sol.y, alone.y)


def test_a_python_model_with_a_python_force_is_saved(tmp_path):
    def wind(t, q, v):
        return np.array([0.3 * np.cos(t), 0.0, 0.0])

    model = pin.Model()
    crank, tip = rod(model, 0, pin.SE3.Random(), 1 / 3, "crank")
    rod(model, crank, tip, 2.0, "coupler", mass=np.pi)
    rod(model, 0, model.jointPlacements[1] * pin.SE3(np.eye(3), np.array([2.0, 0, 0])), 1.5, "rocker")
    closures = [Closure.point("coupler_tip", "rocker_tip", name="pin")]
    for forces in ([], [wind]):
        mech = Mechanism(model, closures, forces, title="by hand")
        q, v = mech.assemble({"crank": 1.2}, {"crank": 1.0}, guess={"coupler": -0.8, "rocker": 1.8})
        sol = mbdae.solve(mech, (0, 0.5), q, v, t_eval=[0.0, 0.2, 0.5])
        sol.save(tmp_path / "run.npz")
        read = Solution.load(tmp_path / "run.npz")
        for name in ("t", "y", "z_own", "status", "message", "settings", "stats"):
            np.testing.assert_array_equal(getattr(read, name), getattr(sol, name))
        assert read.mechanism.title == "by hand"
        assert read.mechanism.joint_names == mech.joint_names
        assert drift(read).g_max == drift(sol).g_max
        if forces:
            missing = pytest.raises(MbdaeError, match="'wind' is a Python function")
            with missing:
                read.lam  # noqa: B018
            with missing:
                read(0.33)
            with missing:
                mbdae.solve(read.mechanism, (0, 1), q, v)
        else:
            np.testing.assert_array_equal(read.lam, sol.lam)
            np.testing.assert_array_equal(read(0.33).q, sol(0.33).q)
