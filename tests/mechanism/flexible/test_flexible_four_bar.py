"""The four-bar with a flexible coupler, from a file, against two formulations of other programs."""

import flexible_bodies
import numpy as np
import pytest
from flexible_bodies import AT_HALF_SECOND, FOUR_BAR, MODES_AT_HALF_SECOND

import mbdae
from mbdae.mechanism.formats.mechanism_file.loaded_model import LoadedModel


@pytest.fixture(scope="module")
def four_bar():
    return mbdae.load(FOUR_BAR)


@pytest.fixture(scope="module")
def run(four_bar):
    return mbdae.solve(four_bar, (0, 0.5), method="pherk6", step=1.25e-4)


def found(mech, sol):
    modal = mech.model.flexible[0].modal
    middle = modal.nodes["middle"].Phi[1]
    q, v = (mech.joint_names.index(name) for name in ("crank", "coupler.mode 1"))
    x, u = sol.q[-1], sol.v[-1]
    return dict(zip(AT_HALF_SECOND, (x[q], middle @ x[v : v + 4], u[q], middle @ u[v : v + 4]), strict=True)), x[
        v : v + 4
    ] * np.sqrt(modal.mass)  # published for modes of modal mass 1


def test_the_coupler_has_the_published_modes(four_bar):
    coupler = four_bar.model.flexible[0].modal
    np.testing.assert_allclose(
        coupler.frequencies, [145.54458439, 582.31993252, 1311.56498219, 2337.86610149], rtol=1e-10
    )
    middle = coupler.nodes["middle"].Phi[1] / np.sqrt(coupler.mass)
    np.testing.assert_allclose(middle, [2.10321277, 0, -2.10856579, 0], atol=5e-9)


def test_pherk6_reaches_every_number(four_bar, run):
    values, modes = found(four_bar, run)
    assert run.stats["backend"] == "native"
    for name, reference in AT_HALF_SECOND.items():
        assert values[name] == pytest.approx(reference, abs=1e-9), name
    np.testing.assert_allclose(modes, MODES_AT_HALF_SECOND, atol=1e-10)


def test_radau9_reaches_every_number(four_bar):
    values, modes = found(four_bar, mbdae.solve(four_bar, (0, 0.5), method="radau9", step=5e-4))
    for name, reference in AT_HALF_SECOND.items():
        assert values[name] == pytest.approx(reference, abs=1e-9), name
    np.testing.assert_allclose(modes, MODES_AT_HALF_SECOND, atol=1e-10)


@pytest.mark.parametrize(
    "options", [{"method": "pherk6"}, {"method": "radau5"}, {"method": "pherk5", "formulation": "ggl"}]
)
def test_both_back_ends_take_the_same_steps(four_bar, options):
    native, python = (mbdae.solve(four_bar, (0, 0.005), step=5e-4, backend=x, **options) for x in ("native", "python"))
    np.testing.assert_allclose(native.q, python.q, atol=1e-12)
    np.testing.assert_allclose(native.v, python.v, atol=1e-9)


def test_the_moment_of_the_weight_follows_the_deformation(four_bar):
    """A peer leaves the deformation out: 1.0e-4 rad at 0.5 s."""
    C = four_bar.model.flexible[0].modal.C
    g = np.array([0.0, -9.81, 0.0])
    q, v = four_bar.start
    x = 1e-3 * np.array([1.0, 0.5, -0.2, 0.1])
    q = q.copy()
    at = four_bar.joint_names.index("coupler.mode 1")
    moment = four_bar.bias(np.concatenate([q[:at], x, q[at + 4 :]]), 0 * v) - four_bar.bias(q, 0 * v)
    R = four_bar.frame(q, "coupler")[1]
    assert moment[1] == pytest.approx(-np.cross(C @ x, R.T @ g)[2], rel=1e-9)


@pytest.mark.slow
def test_a_saved_run_has_the_beam(four_bar, run, tmp_path, monkeypatch):
    monkeypatch.setattr("mbdae.studies.replay.plot_panels.POINTS", 50)
    run.save(tmp_path / "run.npz")
    again = mbdae.Solution.load(tmp_path / "run.npz")
    assert again.mechanism.model.flexible[0].modal.frequencies == pytest.approx(
        four_bar.model.flexible[0].modal.frequencies
    )
    y, z = again.mechanism.mass_matrix(run.q[-1]), four_bar.mass_matrix(run.q[-1])
    np.testing.assert_array_equal(y, z)
    mbdae.animate(again, tmp_path / "run.html")
    ends = again.mechanism.scene.placements(run.q[-1])
    names = [shape.name for shape in again.mechanism.scene.shapes]
    assert {f"coupler {i + 1} rod" for i in range(8)} <= set(names)
    assert np.isfinite(ends).all()


def test_energy_drift_modes_and_equilibria(four_bar, run):
    assert mbdae.drift(run).energy_relative < 1e-9
    assert "stable" in str(mbdae.modes(four_bar))


def test_a_changed_modulus(four_bar):
    soft = LoadedModel(four_bar).make({"flexible.coupler.young": 1e11})
    ratio = four_bar.model.flexible[0].modal.frequencies / soft.model.flexible[0].modal.frequencies
    np.testing.assert_allclose(ratio, np.sqrt(2.1), rtol=1e-9)


@pytest.mark.slow
def test_a_model_made_in_python_is_saved_with_its_bodies(tmp_path):
    mech = flexible_bodies.rigid_and_flexible()
    sol = mbdae.solve(mech, (0, 1e-3), method="pherk5", step=1e-3)
    sol.save(tmp_path / "rigid_and_flexible.npz")
    again = mbdae.Solution.load(tmp_path / "rigid_and_flexible.npz").mechanism
    np.testing.assert_array_equal(again.mass_matrix(sol.q[-1]), mech.mass_matrix(sol.q[-1]))
    np.testing.assert_array_equal(again.residual(sol.q[-1], sol.v[-1]), mech.residual(sol.q[-1], sol.v[-1]))


def test_a_sweep_over_the_modulus(four_bar):
    runs = mbdae.sweep(FOUR_BAR, {"flexible.coupler.young": [1e11, 2.1e11]}, 0.01, outputs=["final q.crank"], rtol=1e-6)
    assert not runs.failed
    assert np.ptp(runs["final q.crank"]) > 1e-8


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"flexible.coupler.young": 1e11}, ("2.1e11", "1e11")),
        ({"gravity.1": -5.0}, ("-9.81", "-5.0")),
        ({"flexible.coupler.area": 8e-5}, ("64e-6", "8e-5")),
    ],
)
def test_workspaces_of_another_beam_are_bound_again(four_bar, tmp_path, change, text):
    """Variants share workspaces: a run with other numbers is that of a file with them, in both back ends."""
    (tmp_path / "other.toml").write_text(FOUR_BAR.read_text().replace(*text))
    variant, fresh = LoadedModel(four_bar).make(change), mbdae.load(tmp_path / "other.toml")
    for backend in ("native", "python"):
        options = {"method": "radau5", "step": 1e-3, "backend": backend}
        before, ours, theirs = (mbdae.solve(mech, (0, 2e-3), **options) for mech in (four_bar, variant, fresh))
        np.testing.assert_array_equal(ours.q, theirs.q)
        assert np.abs(ours.v - before.v).max() > 1e-4
