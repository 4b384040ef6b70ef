"""Runs of five mechanisms in (mm, t, s), (km, g, h), Ms and us: the same motion and the same steps."""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from shared import shared_model
from unit_systems import UNIT_SYSTEMS

import mbdae
from mbdae import JointSpring, Mechanism
from mbdae.mechanism.model_settings import Start

MECHANISMS = ("four_bar", "slider_crank", "spatial_slider_crank", "stewart_platform", "andrews_squeezer")
WITHIN = 1e-9


@cache
def model(name):
    """A mechanism, and the same one in other units."""
    mech = shared_model(name)
    return mech, [(units, units.mechanism(mech)) for units in UNIT_SYSTEMS[1:]]


def differs(found, expected, factor):
    return np.abs(found / factor - expected).max() / np.abs(expected).max()


@pytest.mark.parametrize(("backend", "method"), [("native", "herk5"), ("native", "pherk5"), ("python", "pherk5")])
@pytest.mark.parametrize("name", MECHANISMS)
def test_runs_of_fixed_steps_know_no_units(name, backend, method):
    """Nor does the size of a projection behind which the derivative that pherk5 carries is evaluated again."""
    (mech, others), steps = model(name), 100 if backend == "native" else 10
    end = min(mech.duration, 1.0) * steps / 200

    def run(mech, time):
        return mbdae.solve(mech, (0, end * time), method=method, step=end * time / steps, project=True, backend=backend)

    expected = run(mech, 1.0)
    for units, other in others:
        found = run(other, units.time)
        assert found.status == expected.status == "finished"
        assert found.stats["f"] == expected.stats["f"]
        assert differs(found.q, expected.q, units.configuration(mech)) < WITHIN, units.name
        assert differs(found.v, expected.v, units.speeds(mech)) < WITHIN, units.name
        assert differs(found.lam, expected.lam, units.multipliers(mech)) < WITHIN, units.name


@pytest.mark.parametrize("name", MECHANISMS)
def test_runs_under_step_size_control_know_no_units(name):
    """With atol in the units of each component, error norms are equal; dense output shows the same motion."""
    mech, others = model(name)
    end = min(mech.duration, 1.0)
    times = np.linspace(0.0, end, 21)

    def run(mech, time, atol, first):
        return mbdae.solve(mech, (0, end * time), rtol=1e-7, atol=atol, first_step=first * time)

    expected = run(mech, 1.0, np.full(2 * mech.nv, 1e-9), 1e-3 * end)
    for units, other in others:
        atol = 1e-9 * np.concatenate([units.coordinates(mech), units.speeds(mech)])
        found = run(other, units.time, atol, 1e-3 * end)
        assert found.status == expected.status == "finished"
        assert len(found.t) == pytest.approx(len(expected.t), rel=0.01)  # rounding in error estimates changes steps
        q = found(times * units.time).q
        assert differs(q, expected(times).q, units.configuration(mech)) < WITHIN, units.name


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{"project": True}, {"formulation": "ggl"}], ids=str)
def test_singular_configurations_know_no_units(options):
    """Two of them within 0.6 s: in Ms they are not one."""
    mech = mbdae.load("n_four_bar", N=1)

    def passed(mech, time):
        return [x.t / time for x in mbdae.solve(mech, (0, 1.3 * time), step=0.02 * time, **options).singular]

    expected = passed(mech, 1.0)
    assert len(expected) == 2
    for units in UNIT_SYSTEMS[1:]:
        assert passed(units.mechanism(mech), units.time) == pytest.approx(expected, rel=1e-7), units.name


def test_energy_errors_know_no_units():
    """A swing of 1e-6 rad without gravity does not rest, in us either."""
    model = pin.Model()
    model.gravity = pin.Motion.Zero()
    joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "hinge")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    mech = Mechanism(model, forces=[JointSpring(joint="hinge", stiffness=1.0)], start=Start(q={"hinge": 1e-6}))

    def error(mech, time):
        return mbdae.drift(mbdae.solve(mech, (0, time), step=0.1 * time, method="herk2")).energy_relative

    expected = error(mech, 1.0)
    assert 1e-5 < expected < 1e-3
    for units in UNIT_SYSTEMS[1:]:
        assert error(units.mechanism(mech), units.time) == pytest.approx(expected, rel=1e-9), units.name
