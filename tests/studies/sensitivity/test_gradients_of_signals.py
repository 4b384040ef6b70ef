"""Derivatives of every signal of several models compared with difference quotients of order six of runs."""

from pathlib import Path

import numpy as np
import pytest
from frozen import compare, quotient, runs_of
from signal_names import without_work

import mbdae
from mbdae.errors import InputError
from mbdae.integrate.trajectory.signal_jacobian import SignalJacobian
from mbdae.mechanism.discrete_sensitivity.point_sensitivity import PointSensitivity
from mbdae.solution.signals import signals as columns

ALL_SORTS = str(Path(__file__).parents[2] / "data" / "all_sorts.toml")
WITHOUT = ("g", "Gv")  # a largest magnitude has no derivative
WIDTHS = (1e-2, 1e-3)


def with_derivatives(mech):
    """Names of signals with derivatives."""
    return [x for x in without_work(mech) if x not in WITHOUT and not x.startswith("mode.")]


def wrong(model, name, T, **options):
    """Signals whose derivatives differ from the quotients of runs, with the relative error; and their number."""
    template, value, run = runs_of(model, name, T, step=T / 2, method="pherk5", **options)
    sol = run(value)
    known = with_derivatives(sol.mechanism)
    here = columns(sol, known)
    known = [x for x in known if np.isfinite(here[x]).all()]
    moves = mbdae.sensitivity(sol, [name], model=template)

    def at(x):
        found = columns(run(x), known)
        return np.array([found[key] for key in known])

    size = np.maximum(1.0, np.abs([here[key] for key in known]).max(axis=1))
    derivatives = SignalJacobian(moves.trajectory, known)
    variations = np.hstack([moves.dy[..., 0], np.ones((len(sol.t), 1)), moves.dt])
    moved = np.array([derivatives.rows(i, sol.t[i], y) @ variations[i] for i, y in enumerate(sol.y)]).T
    least = np.full(len(known), np.inf)
    for width in WIDTHS:  # the narrower one only where the first is too wide
        expected = quotient(at, value, width)
        errors = np.abs(moved - expected).max(axis=1) / np.maximum(size, np.abs(expected).max(axis=1))
        least = np.minimum(least, errors)
        if (least < 1e-9).all():
            break
    assert np.abs(moved).max() > 0
    return {key: e for key, e in zip(known, least, strict=True) if not e < 1e-9}, len(known)


@pytest.mark.parametrize(
    ("model", "name", "T"),
    [
        ("four_bar", "frame.coupler_tip.xyz.0", 0.2),
        ("heavy_top", "gravity.2", 0.02),
        ("stewart_platform", "gravity.2", 0.04),
        ("andrews_squeezer", "force.spring.stiffness", 2e-3),
        ("car_axis", "force.left spring.stiffness", 0.05),
        ("rolling_disc", "gravity.2", 0.02),
        ("rattleback", "gravity.2", 0.02),
        ("delta_robot", "gravity.2", 0.02),
    ],
)
def test_every_signal(model, name, T):
    missed, n = wrong(model, name, T)
    assert not missed
    assert n > 20


NAMES = (
    "body.arm.mass", "body.hand.com.2", "body.rotor.inertia.1", "body.hand.xyz.1", "frame.tip.rpy.0",
    "frame.post.xyz.2", "gravity.0", "closure.rod.length", "driver.turntable.motion.amplitude",
    "force.bush.stiffness.1", "force.bush.damping.4", "force.gust.force.1.amplitude", "force.jet.torque.1.value",
    "force.strut.length", "force.coil.rest", "force.motor.constant", "force.servo.ki", "force.grease.friction",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_every_signal_of_all_sorts_of_forces(name):
    missed, n = wrong(ALL_SORTS, name, 0.02)
    assert not missed
    assert n > 250


def test_signals_go_backwards():
    sol = mbdae.solve(mbdae.load(ALL_SORTS), (0.0, 0.02), step=0.01)
    names = with_derivatives(sol.mechanism)
    compare(sol, ["body.arm.mass", "frame.tip.xyz.0"], names[:: len(names) // 7], start=True)


@pytest.mark.parametrize("name", WITHOUT)
def test_what_has_no_gradient_says_why(name):
    sol = mbdae.solve(mbdae.load("four_bar"), (0.0, 0.01), step=0.01)
    with pytest.raises(InputError, match=f"signal {name!r} has no gradient: it is the largest magnitude"):
        mbdae.sensitivity(sol, ["gravity.2"]).signal(name)


def test_an_undetermined_force_is_named():
    """Joints keep the height of a wheel: there is no row of its normal force."""
    mech = mbdae.load("differential_drive")
    lost = [name for name, x in mbdae.solve(mech, (0.0, 0.01)).signals().items() if np.isnan(x).all()]
    assert lost
    with pytest.raises(InputError, match="it is not a number there"):
        mbdae.sensitivity(mbdae.solve(mech, (0.0, 0.01)), start=True).signal(lost[0])


def test_a_force_that_vanishes_has_no_direction():
    """By symmetry the slider of the governor has zero force: its magnitude has no derivative, not that of rounding."""
    sol = mbdae.solve(mbdae.load("flyball_governor"), (0.0, 0.005), rtol=1e-4)
    assert np.abs(sol.signals("force.slider")["force.slider"]).max() < 1e-9
    found = mbdae.sensitivity(sol, ["body.rod_2.mass"], start=True)
    assert not found.signal("force.slider").any()
    assert np.abs(found.signal("force.slider.y")).max() > 1
    compare(sol, ["body.rod_2.mass"], ["force.slider", "force.shaft"])  # a start with open loops: forces of 1e5 N/m


@pytest.mark.parametrize(
    ("model", "name", "T"),
    [("slider_crank", "gravity.2", 0.1), ("pendulum_on_stop", "gravity.2", 1.0), ("stick_slip_slider", None, 0.5)],
)
def test_signals_share_what_they_need_of_a_point(model, name, T, monkeypatch):
    """One evaluation of the multipliers at each time for all signals, whose columns are those of their Jacobian."""
    sol = mbdae.solve(mbdae.load(model), T, step=T / 5, method="pherk5")
    moves = mbdae.sensitivity(sol, [name] if name else [], start=True)
    known = [x for x, values in columns(sol, with_derivatives(sol.mechanism)).items() if np.isfinite(values).all()]
    calls, multipliers = [], PointSensitivity.multipliers
    with monkeypatch.context() as patch:
        patch.setattr(PointSensitivity, "multipliers", lambda *a: calls.append(a[1]) or multipliers(*a))
        found = {x: moves.signal(x) for x in known[::-5] + known[:5]}
        lam = moves.lam
    for x, row in zip(found, jacobian_at(moves, list(found)).swapaxes(0, 1), strict=True):
        np.testing.assert_allclose(found[x], row, rtol=1e-9, atol=1e-9 * max(1.0, np.abs(row).max()))
    first = next(x for x in known if x.startswith("lam."))
    np.testing.assert_array_equal(moves.signal(first), lam[:, 0])
    assert calls == sol.t.tolist()


def jacobian_at(moves, names):
    """Derivatives of signals along the columns of a sensitivity at each time, (n, names, k), by their Jacobian."""
    derivatives = SignalJacobian(moves.trajectory, names)
    out = []
    for node, t, y, dy, dt in zip(moves.nodes.tolist(), moves.t.tolist(), moves.y, moves.dy, moves.dt, strict=True):
        out.append(derivatives.rows(node, t, y) @ np.concatenate([dy, moves.dp, dt[None]]))
    return np.array(out)
