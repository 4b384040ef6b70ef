"""Derivatives of half-explicit runs in the GGL form, which enforces positions by a second multiplier."""

import numpy as np
import pytest
from frozen import assert_derivative, compare, runs_of

import mbdae
from mbdae.methods import METHODS, Tableau

METHODS_HERE = [name for name, method in METHODS.items() if isinstance(method, Tableau)]
NAMES = ("joint.crank.mass", "joint.rocker.xyz.0", "frame.coupler_tip.xyz.0", "gravity.2", "start.v.crank")


def assert_tangent(within, model, name, T, **options):
    """The tangent compared with quotients of runs."""
    template, value, run = runs_of(model, name, T, formulation="ggl", **options)
    sol = run(value)
    found = mbdae.sensitivity(sol, [name], model=template)
    assert np.abs(found.dy).max() > 0
    assert_derivative(found.dy[..., 0], lambda x: run(x).y, value, within, mech=sol.mechanism)


@pytest.mark.parametrize("method", METHODS_HERE)
def test_every_method(method):
    assert_tangent(1e-10, "four_bar", "joint.coupler.com.0", 0.3, step=0.05, method=method)


@pytest.mark.parametrize("name", NAMES)
def test_every_sort_of_parameter(name):
    assert_tangent(1e-10, "four_bar", name, 0.3, step=0.05, method="pherk5")


@pytest.mark.parametrize(
    ("model", "T", "step"),
    [
        ("stewart_platform", 0.04, 0.02),
        ("rolling_disc", 0.04, 0.02),
        ("delta_robot", 0.02, 0.01),
        ("bricard", 0.1, 0.05),
        ("panda_handle", 0.02, 0.01),
    ],
)
def test_models(model, T, step):
    """Drivers, velocity rows alone, states, redundant rows."""
    assert_tangent(1e-9, model, "gravity.2", T, step=step, method="pherk5")


@pytest.mark.parametrize("method", ["pherk5", "herk4", "arnold4"])
@pytest.mark.parametrize("options", [{"step": 0.03}, {"rtol": 1e-4}])
def test_adjoint(method, options):
    sol = mbdae.solve(mbdae.load("four_bar"), (0.0, 0.2), method=method, formulation="ggl", **options)
    compare(sol, ["joint.crank.mass", "joint.rocker.xyz.0"], ["q.crank", "lam.pin.1", "v.rocker"], start=True)


@pytest.mark.parametrize("model", ["heavy_top", "rolling_disc", "panda_handle"])
def test_adjoint_of_models(model):
    mech = mbdae.load(model)
    sol = mbdae.solve(mech, (0.0, 0.02), method="pherk5", formulation="ggl", rtol=1e-4)
    compare(sol, ["gravity.2"], ["energy", f"lam.{mech.row_names[0]}.1"], start=True)


def test_terminal_events():
    event = mbdae.Event(lambda t, q, v: q[0] - 1.0, terminal=True)
    sol = mbdae.solve(mbdae.load("four_bar"), (0.0, 2.0), method="pherk5", formulation="ggl", rtol=1e-5, events=event)
    compare(sol, ["joint.crank.mass"], ["q.coupler", "t"], start=True, event=event)
    plain = mbdae.solve(mbdae.load("four_bar"), (0.0, 2.0), method="pherk6", rtol=1e-10, events=event)
    ends = [mbdae.sensitivity(s, ["joint.crank.mass"], event=event).dt[-1, 0] for s in (sol, plain)]
    assert ends[0] == pytest.approx(ends[1], rel=1e-4)
