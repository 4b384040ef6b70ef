"""SUNDIALS' IDA on the index-2 forms: agreement with Radau IIA and exact solutions, its Jacobian, rejections."""

import sys

import numpy as np
import pytest
from motions import distance, free_loop, levels, model, run, start_of

import mbdae
from mbdae import finite_differences
from mbdae.errors import InputError
from mbdae.integrate.steppers.ida import IDA
from mbdae.studies.method_variant import Variant
from mbdae.textbook.problems import controlled_reactor, hessenberg_a


@pytest.fixture
def sundials():
    pytest.importorskip("sksundae", reason="scikit-sundae is not installed: pip install 'mbdae[sundials]'")


MOTIONS = [
    ("four_bar", "ggl", 0.2),
    ("four_bar", "index2", 0.2),
    ("flyball_governor", "index2", 0.1),  # stiff
    ("bricard", "ggl", 0.2),  # redundant rows
    ("heavy_top", "ggl", 0.01),  # quaternions
    ("free_loop", "ggl", 0.05),  # also cosines and sines
    ("rolling_disc", "index2", 0.1),  # rows of velocities
]


@pytest.mark.usefixtures("sundials")
@pytest.mark.parametrize(("name", "formulation", "T"), MOTIONS)
def test_the_error_follows_the_tolerance(name, formulation, T):
    mech = model(name)
    reference = run(mech, T, method="radau9", rtol=1e-12)
    errors = []
    for rtol in (1e-5, 1e-8):
        sol = run(mech, T, method="ida", formulation=formulation, rtol=rtol)
        errors.append(max(distance(mech, reference, sol)))
    assert errors[1] < min(1e-5, errors[0] / 30)
    g, Gv = levels(sol) if mech.ng else (0.0, 0.0)
    assert Gv < 1e-6
    assert formulation == "index2" or g < 1e-7
    exact = sol.lam[-1]
    assert np.abs(sol.lam_own[-1, : mech.ng] - exact).max(initial=0.0) < 1e-4 * (1 + np.abs(exact).max(initial=0.0))
    assert sol.stats["rejected"] is None


@pytest.mark.usefixtures("sundials")
@pytest.mark.parametrize("problem", [hessenberg_a, controlled_reactor])
def test_problems_that_are_nonlinear_in_z(problem):
    """If the integral of z does not enter norms, Newton's iteration ends before z converges: 25000 steps, order 1."""
    p = problem()
    for rtol, limit in ((1e-6, 1e-3), (1e-9, 1e-6)):
        sol = mbdae.solve(p, method="ida", rtol=rtol)
        exact = p.exact(sol.t[-1]) if p.exact else [x[-1] for x in _exact(p)]
        assert np.abs(sol.y[-1] - exact[0]).max() < limit
        assert np.abs(sol.z_own[-1] - exact[1]).max() < 100 * limit
    assert len(sol.t) < 1000


def _exact(p):
    sol = mbdae.solve(p, method="radau9", rtol=1e-12)
    return sol.y, sol.z


@pytest.mark.usefixtures("sundials")
def test_an_elliptic_integral_an_event_and_the_way_back():
    """A pendulum from horizontal rest passes the lowest point after K(sin 45 degrees) sqrt(l/g)."""
    mech = mbdae.load("pendulum")
    bottom = mbdae.Event(lambda t, q, v: q[0], terminal=True)
    sol = mbdae.solve(mech, (0, 5), method="ida", formulation="ggl", rtol=1e-8, events=bottom)
    assert sol.status == "event"
    assert sol.events[0][0][0] == pytest.approx(1.854074677301372 / np.sqrt(9.81), abs=1e-6)
    there = mbdae.solve(mech, (0, 0.2), method="ida", formulation="ggl", rtol=1e-8)
    back = mbdae.solve(mech, (0.2, 0), there.q[-1], there.v[-1], method="ida", formulation="ggl", rtol=1e-8)
    assert np.abs(back.q[-1] - there.q[0]).max() < 1e-6


class _Run:
    """The part of a run that a stepper uses."""

    t, sign, h = 0.1, 1.0, None

    def __init__(self, system, y):
        self.system, self.state = system, mbdae.system.State(y)

    def time_to_interval_end(self):
        return 1.0


@pytest.mark.usefixtures("sundials")
@pytest.mark.parametrize("formulation", ["index2", "ggl"])
@pytest.mark.parametrize("name", ["four_bar", "heavy_top", "free_loop"])
def test_the_jacobian_is_that_of_the_residual(name, formulation):
    """At the end of a small step."""
    mech = model(name)
    system, (q, v) = mech.system(formulation), start_of(mech)
    y = np.concatenate([q, v, np.zeros(len(mech.states)), [0.0]])
    stepper = IDA.stepper(system, 1e-6, None, None, np.inf)
    stepper._begin_step(_Run(system, y))
    F, z = stepper.chart.start()
    u = np.concatenate([system.add(y, 1e-3 * F), np.zeros(len(z))])
    n = len(y)
    du = np.concatenate([stepper.raw.tangent_map(u[:n]) @ system.derivative(0.1, u[:n])[0], z])
    cj, out = 30.0, np.empty((len(u), len(u)))
    stepper._jacobian(0.1, u, du, u, cj, out)

    def residual(e):
        r = np.empty(len(u))
        stepper._residual(0.1, u + e, du + cj * e, r)
        return r

    found = finite_differences.numerical_jacobian(residual, len(u), 1e-4)
    np.testing.assert_allclose(out, found, atol=1e-6 * np.abs(found).max(), rtol=0)


def test_partials_of_coordinates_are_those_of_steps():
    mech = free_loop()
    q, _ = start_of(mech)
    found = finite_differences.numerical_jacobian(lambda x: mech.manifold.integrate(q, x), mech.nv, 1e-2)
    np.testing.assert_allclose(mech.manifold.coordinate_partials(q), found, atol=1e-9)
    lengths = [np.linalg.norm(q[block]) for block in mech.manifold.unit_blocks]
    np.testing.assert_allclose(lengths, 1.0, rtol=1e-14)
    assert len(lengths) == mech.nq - mech.nv


REFUSED = [
    ("four_bar", {"step": 0.1}, ["'ida'", "rtol and atol"]),
    ("four_bar", {"project": True}, ["project=True", "one-step", "'ida'"]),
    ("pendulum_on_stop", {}, ["'ida'", "'rod stop'"]),
    ("heavy_top", {"atol": np.full(13, 1e-9)}, ["'ida'", "one number as atol"]),
    ("four_bar", {"formulation": "index1"}, ["index1", "'ida'"]),
]


@pytest.mark.usefixtures("sundials")
@pytest.mark.parametrize(("name", "options", "words"), REFUSED)
def test_rejections(name, options, words):
    with pytest.raises(InputError) as caught:
        mbdae.solve(name, (0.0, 0.1), **{"method": "ida", **options})
    assert all(word in str(caught.value) for word in words)


def test_a_projected_multistep_method_is_rejected():
    with pytest.raises(InputError, match=r"'ida' .*'project'"):
        Variant.parse("project:ida")


def test_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "sksundae.ida", None)
    with pytest.raises(InputError, match=r"'ida' needs scikit-sundae: pip install \"mbdae\[sundials\]\""):
        mbdae.solve("four_bar", (0.0, 0.1), method="ida")


@pytest.mark.usefixtures("sundials")
@pytest.mark.parametrize("formulation", ["index2", "ggl"])
def test_a_coarse_tolerance_is_reported_with_a_remedy_that_exists(formulation):
    sol = mbdae.solve("four_bar", (0, 1), method="ida", formulation=formulation, rtol=1e-4)
    assert sol.status == "doubtful"
    assert sol.message.startswith("rows are not satisfied: |G v| reached")
    assert sol.message.endswith("take a smaller rtol")


@pytest.mark.slow
@pytest.mark.usefixtures("sundials")
def test_studies_take_it(tmp_path):
    study = mbdae.compare("four_bar", (0, 0.1), methods=["pherk6", "ida", "ggl:ida"], rtol=[1e-4, 1e-6], repeats=0)
    assert study.methods == ["pherk6", "ida", "ggl:ida"]
    assert all(p.success for p in study.points)
    assert "ida" in study.computed_by
    drift = mbdae.drift(mbdae.solve("four_bar", (0, 0.1), method="ida", formulation="ggl", rtol=1e-6))
    assert drift.method == "ggl:ida"
    sol = mbdae.solve("four_bar", (0, 0.1), method="ida", rtol=1e-6)
    with pytest.raises(InputError, match=r"derivatives of runs .* got 'ida' in 'index2'"):
        mbdae.sensitivity(sol, start=True)
    sol.save(tmp_path / "run.npz")
    assert mbdae.Solution.load(tmp_path / "run.npz").settings["method"] == "ida"
