"""The code of guide/fmu.md that needs FMPy or CasADi, with the motor of this folder."""

import re
import textwrap
import zipfile
from pathlib import Path

import numpy as np
import pytest
from motors import motor
from scipy.integrate import solve_ivp

import mbdae
from mbdae.finite_differences import numerical_derivative

PAGE = (Path(__file__).parents[3] / "examples" / "guide" / "fmu.md").read_text("utf-8")


def code(first):
    """An indented block of the page, by the beginning of its first line."""
    found = re.findall(r"(?:^ {4}\S.*\n)(?:^ {4}.*\n|^\n(?= {4}))*", PAGE, re.M)
    return textwrap.dedent(next(x for x in found if x.startswith(f"    {first}")))


@pytest.mark.slow
def test_a_motor_drives_an_arm(tmp_path, monkeypatch):
    """Against the equations of arm and motor, continuous: the sampling has an error of first order."""
    motor(tmp_path, name="motor.fmu")
    file = re.search(r"```toml\n# driven_arm.toml\n(.*?)```", PAGE, re.S)[1]
    (tmp_path / "driven_arm.toml").write_text(file)
    monkeypatch.chdir(tmp_path)
    names = {"mbdae": mbdae}
    exec(code("mech = mbdae.load"), names)
    second, kp, kd, lag, at = names["second"], 60.0, 8.0, 0.005, 1.2
    inertia, weight = 0.02 + 0.25, 9.81 * 0.5

    def rates(t, x):
        return [x[1], (x[2] - weight * np.sin(x[0])) / inertia, (kp * (at - x[0]) - kd * x[1] - x[2]) / lag]

    exact = solve_ivp(rates, (0, 2), [0, 0, 0], method="Radau", rtol=1e-9, atol=1e-10).y[:, -1]
    assert second.q[-1, 0] == pytest.approx(exact[0], abs=1e-4)
    assert names["torque"][-1] == pytest.approx(exact[2], rel=1e-3)


@pytest.mark.slow
def test_a_motor_drives_a_belt(tmp_path, monkeypatch):
    """Against the equations of position and motor, continuous: the sampling has an error of first order."""
    motor(tmp_path, name="motor.fmu")
    (tmp_path / "belt.toml").write_text(re.search(r"```toml\n# belt.toml\n(.*?)```", PAGE, re.S)[1])
    monkeypatch.chdir(tmp_path)
    names = {"mbdae": mbdae}
    exec(code("belt = mbdae.solve"), names)
    belt, kp, lag, at, mass = names["belt"], 4.0, 0.02, 0.5, 3.0

    def rates(t, x):
        return [x[1], (kp * (at - x[0]) - x[1]) / lag]

    exact = solve_ivp(rates, (0, 2), [0, 0], rtol=1e-9, atol=1e-10, dense_output=True).sol(belt.t)
    assert belt.q[:, 0] == pytest.approx(exact[0], abs=2e-3)
    assert belt.v[:, 0] == pytest.approx(exact[1], abs=0.1)
    force = [mass * rates(0.0, x)[1] for x in exact.T]
    late = belt.t > 0.2
    assert names["force"][late] == pytest.approx(np.array(force)[late], abs=0.25)


@pytest.mark.slow
@pytest.mark.native
def test_fmpy_and_casadi(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mech = mbdae.load("slider_crank")
    torque = mbdae.JointTorque(joint="crank", torque=mbdae.Input(name="motor"))
    driven = mbdae.Mechanism(mech.model, mech.closures, [torque], start=mech.start_values)
    mbdae.export(driven, "crank.fmu", outputs=["q.crank", "v.crank", "g"], step=1e-3)
    names = {}
    exec(code("from fmpy"), names)
    sol = mbdae.solve(driven, (0, 1), rtol=1e-10).signals()
    for found, error in (("steps", 1e-6), ("solved", 1e-5)):
        assert names[found]["q.crank"][-1] == pytest.approx(sol["q.crank"][-1], abs=error)
        assert np.abs(names[found]["g"]).max() < 1e-6
    casadi = pytest.importorskip("casadi", reason="casadi is not installed: pip install 'mbdae[peers]'")
    unit = mbdae.export(driven, "crank.fmu", kind="me", outputs=["q.crank", "v.crank"])
    with zipfile.ZipFile(unit.path) as file:
        file.extractall("crank")
    names = {"casadi": casadi, "folder": "crank"}
    exec(code("dae = casadi"), names)
    x = np.array([0.1, 4.0])
    by_x, by_u = (part.full() for part in names["jacobian"](x, 0.0))
    for j, e in enumerate(np.eye(3)):
        rate = numerical_derivative(lambda h, e=e: names["equation"](x + h * e[:2], h * e[2])[0].full()[:, 0], 1e-3)
        np.testing.assert_allclose(np.hstack([by_x, by_u])[:, j], rate, rtol=1e-9, atol=1e-8)
