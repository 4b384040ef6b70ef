"""Derivatives of runs compared with quotients of runs, and their observed orders."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

import mbdae
from mbdae.__main__ import cli
from mbdae.errors import InputError
from mbdae.studies.order import gradients
from mbdae.studies.order.gradients import GradientMeasurement, GradientStudy


@pytest.fixture
def brief(monkeypatch):
    monkeypatch.setattr(GradientMeasurement, "max_solves", 3000)


@pytest.mark.parametrize(
    ("model", "options"),
    [
        ("four_bar", {"parameter": "joint.crank.mass", "T": 0.4}),
        ("four_bar", {"parameter": "frame.coupler_tip.xyz.0", "T": 0.4}),
        ("heavy_top", {"T": 0.3}),
        ("stewart_platform", {"parameter": "gravity.2", "T": 0.2}),
    ],
)
def test_models(model, options, brief):
    """Derivatives converge as their runs do: by a mass, a placement, a velocity of a free body; driven."""
    study = mbdae.check_gradients(mbdae.load(model), ["herk2"], steps=10, **options)
    assert study.holds, str(study)
    assert max(study.differences.values()) < 1e-10
    assert [s.claimed for s in study.orders["herk2"]] == [2, 2]
    assert study.of in str(study)
    assert str(study).count("\n") == 2


@pytest.mark.parametrize(("method", "order"), [("herk2", 2), ("pherk3", 3)])
@pytest.mark.parametrize("parameter", ["force.motor.inductance", "force.hold.ki"])
def test_states_of_motors_and_controllers(method, order, parameter, brief):
    motor = mbdae.DCMotor(name="motor", joint="crank", voltage=6.0, resistance=1.2, inductance=0.05, constant=0.2)
    hold = mbdae.JointPID(name="hold", joint="rocker", kp=3.0, ki=2.0, kd=0.2, reference=0.4)
    mech = mbdae.load("four_bar", forces=[motor, hold])
    study = mbdae.check_gradients(mech, [method], steps=10, T=0.4, parameter=parameter)
    assert study.holds, str(study)
    assert study.differences[method] < 1e-9
    assert [s.claimed for s in study.orders[method]] == [order, order]


def test_a_wrong_tangent_is_refuted(monkeypatch):
    def wrong(sol, *args, **options):
        found = sensitivity(sol, *args, **options)
        return replace(found, dy=found.dy * (1 + 1e-6))

    sensitivity = gradients.sensitivity
    monkeypatch.setattr(gradients, "sensitivity", wrong)
    measure = GradientMeasurement(mbdae.load("pendulum"), 0.3, 10, lambda name: None, "auto", None, None)
    difference, unsure = measure.compare_quotients(mbdae.METHODS["herk2"])
    study = GradientStudy("pendulum", 0.3, {}, differences={"herk2": difference}, uncertainties={"herk2": unsure})
    assert study.refuted
    assert not study.holds
    assert difference == pytest.approx(1e-6, rel=0.1)


def test_no_run():
    """Without successful runs nothing is judged."""
    study = GradientStudy("none", 1.0, {}, differences={"radau3": np.nan}, uncertainties={"radau3": np.nan})
    assert not study.holds
    assert not study.refuted


def test_what_is_rejected():
    with pytest.raises(InputError, match="leave no degree of freedom: name a parameter"):
        mbdae.check_gradients(mbdae.load("cam_follower"), "herk2")
    with pytest.raises(InputError, match="at least 5"):
        mbdae.check_gradients(mbdae.load("pendulum"), "herk2", steps=3)


def test_command(brief, tmp_path):
    words = ["check-gradients", "pendulum", "-m", "pherk3", "-t", "0.5", "--steps", "10"]
    found = CliRunner().invoke(cli, [*words, "--json", "--plot", str(tmp_path / "orders.svg")])
    data = json.loads(found.stdout)
    assert found.exit_code == (0 if data["holds"] else 3)
    assert data["differences"]["pherk3"] < 1e-11
    assert (tmp_path / "orders.svg").stat().st_size > 5000
    with pytest.raises(InputError, match="check-gradients takes a mechanism"):
        CliRunner().invoke(cli, ["check-gradients", "hessenberg_a"], catch_exceptions=False)


def test_solvers_without_fixed_steps_have_no_observed_order():
    with pytest.raises(InputError, match=r"^method 'ida' controls the step size, orders are those of fixed steps$"):
        mbdae.order("pendulum", "ida")
