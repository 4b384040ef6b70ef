"""Stiff runs of half-explicit methods are reported, and no others: in both back ends, from the step sizes."""

import json
import warnings
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from click.testing import CliRunner
from shared import shared_model

import mbdae
from mbdae import METHODS, Bushing, JointDamping, JointPID, JointSpring, Mechanism, model_names
from mbdae.__main__ import cli
from mbdae.integrate.run import stiffness_detection
from mbdae.integrate.run.stiffness_detection import FIRST_CHECK, _largest_eigenvalue, _stability_function

model = cache(mbdae.load)
SOON, EARLY = FIRST_CHECK + 100, 200  # steps
SINE = {"kind": "harmonic", "amplitude": 0.2, "omega": 3.0}


def governor():
    return shared_model("flyball_governor"), None, None


def crank_on_rubber(stiffness, damping, stretch=0.0):
    """A slider-crank whose wrist pin is a bushing, stretched at the start by an offset in m."""
    base = shared_model("slider_crank")
    rubber = Bushing(
        frames=("rod_tip", "slider_pin"), stiffness=(stiffness,) * 3 + (0,) * 3, damping=(damping,) * 3 + (0,) * 3
    )
    q, v = base.assemble(q={"crank": 0.3}, v={"crank": 2.0})
    return Mechanism(base.model, [], [rubber]), q + stretch * (np.array(base.joint_names) == "slider"), v


def loaded(name, *forces):
    return mbdae.load(name, forces=forces), None, None


STIFF = {
    "governor": governor,
    "bushing": lambda: crank_on_rubber(1e8, 1e5),
    "damper": lambda: loaded("slider_crank", JointDamping(joint="crank_pin", damping=1e4)),
    "controller": lambda: loaded("four_bar", JointPID(joint="crank", kp=1e8, ki=1e8, kd=1e6, reference=SINE)),
}


@pytest.fixture
def early(monkeypatch):
    """Detect early: Python is slow per step."""
    monkeypatch.setattr(stiffness_detection, "FIRST_CHECK", EARLY)


def reported(problem, **options):
    """Return the solution and its warnings."""
    mech, q, v = problem
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        sol = mbdae.solve(mech, (0, 10), q, v, **{"method": "pherk5", **options})
    return sol, [w for w in found if str(w.message).startswith("stiff: ")]


@pytest.mark.usefixtures("back_end", "early")
@pytest.mark.parametrize("name", STIFF)
def test_stiff_runs_are_reported_once_and_continue(name):
    sol, found = reported(STIFF[name](), max_steps=EARLY + 20)
    assert len(found) == 1
    assert found[0].filename == __file__
    assert 'try -m radau9 (method="radau9")' in str(found[0].message)
    assert str(found[0].message) in sol.message
    stiff = sol.stats["stiff"]
    assert sol.t[0] < stiff["t"] < sol.t[-1]
    assert sol.stats["steps"] > EARLY
    assert stiff["h"] == pytest.approx(np.diff(sol.t[EARLY - 50 : EARLY + 1]).mean(), rel=1e-9)
    assert 1.6 < stiff["h_rho"] < 3.5  # method of Dormand and Prince: 3.3 on the real axis


@pytest.mark.parametrize("rtol", [1e-3, 1e-6])
@pytest.mark.parametrize("method", ["pherk6", "herk5", "hedop5", "pherk4"])
@pytest.mark.parametrize("name", STIFF)
def test_stiff_runs_of_other_methods(name, method, rtol):
    sol, found = reported(STIFF[name](), method=method, rtol=rtol, max_steps=SOON + 1000)
    assert len(found) == 1
    assert "stiff" in sol.stats


@pytest.mark.parametrize("options", [{"rtol": 1e-8}, {"rtol": 1e-6, "method": "herk5"}], ids=str)
@pytest.mark.parametrize("name", sorted(set(model_names()) - {"flyball_governor"}))
def test_other_models_are_not_stiff(name, options):
    mech = model(name)
    sol = mbdae.solve(mech, (0, mech.duration), max_steps=SOON, **options)
    assert "stiff" not in sol.stats  # nor was there a warning: those are errors here


def test_nor_are_crossings_of_singular_configurations():
    sol = mbdae.solve(mbdae.load("n_four_bar", N=1), (0, 20), rtol=1e-8, method="herk5", project=True)
    assert sol.success
    assert sol.singular
    assert sol.stats["steps"] > FIRST_CHECK
    assert "stiff" not in sol.stats


@pytest.mark.usefixtures("back_end", "early")
@pytest.mark.parametrize("options", [{}, {"method": "pherk6"}, {"rtol": 1e-4, "method": "herk5"}], ids=str)
def test_nor_is_a_vibration_that_the_motion_has(options):
    sol, found = reported(crank_on_rubber(1e6, 0.0, stretch=1e-3), max_steps=EARLY + 60, **options)
    assert sol.stats["steps"] > EARLY
    assert not found


def test_nor_are_steps_that_the_user_chose():
    assert not reported(governor(), max_steps=SOON, max_step=4e-4)[1]
    assert not reported(governor(), max_steps=SOON, step=4e-4)[1]


@pytest.mark.usefixtures("early")
def test_no_window_reaches_across_a_jump():
    assert not reported(governor(), max_steps=SOON, jumps=np.arange(0.01, 10, 0.01))[1]  # fewer than 50 steps between
    sol, found = reported(governor(), max_steps=SOON, jumps=np.arange(0.1, 10, 0.1))
    assert len(found) == 1
    assert not (np.abs(np.arange(0.1, 2, 0.1) - sol.stats["stiff"]["t"]) < 1e-6).any()


def test_the_command_line_and_its_json_tell(tmp_path):
    arguments = ["solve", "flyball_governor", "-m", "pherk5", "-t", "1.5", "-o", str(tmp_path / "run.npz")]
    for more in ([], ["--json"]):
        with pytest.warns(UserWarning, match="^stiff: at t = .* try -m radau9"):
            result = CliRunner().invoke(cli, [*arguments, *more], catch_exceptions=False)
        assert result.exit_code == 0
        assert "stiff: at t = " in result.stdout
    stiff = json.loads(result.stdout)["stats"]["stiff"]
    assert set(stiff) == {"t", "h", "h_rho"}
    assert mbdae.Solution.load(tmp_path / "run.npz").stats["stiff"] == stiff


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("damping", [100.0, 1e5])
def test_eigenvalues_of_a_spring_and_damper(damping):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia(2.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    mech = Mechanism(model, [], [JointSpring(joint="slide", stiffness=2e8, damping=damping)])
    expected = max(np.roots([2.0, damping, 2e8]), key=lambda x: (abs(x), x.imag))
    found = _largest_eigenvalue(mech.system(), 0.0, mech.point(np.array([1e-3]), np.array([0.2])))
    assert complex(found.real, abs(found.imag)) == pytest.approx(expected, rel=1e-3, abs=5.0)


@pytest.mark.parametrize("z", [-3.3, -1.0 + 0.5j, 1j])
def test_stability_functions(z):
    dormand_prince = abs(np.polyval([1 / 600, 1 / 120, 1 / 24, 1 / 6, 1 / 2, 1, 1], z))
    assert _stability_function(METHODS["pherk5"], z) == pytest.approx(dormand_prince, rel=1e-12)
    half = abs(np.polyval([1 / 24, 1 / 6, 1 / 2, 1, 1], z / 2))
    assert _stability_function(METHODS["rk4"], z) == pytest.approx(half, rel=1e-12)
