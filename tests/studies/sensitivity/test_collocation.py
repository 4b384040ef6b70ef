"""Derivatives of runs of Radau IIA: stages by the implicit function theorem, in both forms that preserve closures."""

from functools import cache

import numpy as np
import pytest
from frozen import assert_derivative, compare, free_velocity, repeated_run, runs_of
from smooth import SMOOTH

import mbdae
from mbdae import backend
from mbdae.mechanism.formats.mechanism_file.loaded_model import LoadedModel, parameter_value
from mbdae.methods import method
from mbdae.system import State

SHORT = {"flexible_slider_crank": (2e-4, 2e-5),
         "andrews_squeezer": (2e-4, 4e-5), "rolling_disc": (0.04, 5e-3),
         "snakeboard": (0.02, 2e-3), "heavy_top": (0.1, 0.01), "humanoid_stance": (0.01, 5e-3),
         "flyball_governor": (0.01, 1e-3), "jansen_walker": (0.1, 0.02), "n_four_bar": (0.2, 0.05),
         "sleeping_top": (0.02, 2e-3)}  # fmt: skip


def assert_tangent(within, model, name, T, **options):
    """The tangent compared with quotients of runs."""
    template, value, run = runs_of(model, name, T, **options)
    sol = run(value)
    found = mbdae.sensitivity(sol, [name], model=template)
    assert np.abs(found.dy).max() > 0
    assert_derivative(found.dy[..., 0], lambda x: run(x).y, value, within, mech=sol.mechanism)


@pytest.mark.parametrize("form", ["index2", "ggl"])
@pytest.mark.parametrize("method", ["radau1", "radau3", "radau5", "radau9"])
def test_every_number_of_stages(method, form):
    for model, name, T, step, within in (
        ("four_bar", "joint.coupler.com.0", 0.6, 0.05, 1e-10),
        ("pendulum", "gravity.2", 1.0, 0.05, 1e-12),
    ):
        assert_tangent(within, model, name, T, step=step, method=method, formulation=form)


@pytest.mark.parametrize("model", SMOOTH)
def test_every_model(model):
    """A velocity of the start that closures allow."""
    mech = mbdae.load(model)
    T, step = SHORT.get(model, (0.1, 0.02))
    (q, v), free = mech.start, free_velocity(mech)

    @cache
    def run(x):
        sol = mbdae.solve(mech, (0.0, T), q, v + x * free, step=step, method="radau5")
        assert sol.ended, sol.message
        return sol

    along = mbdae.sensitivity(run(0.0), start=True).dy[:, :, mech.nv : 2 * mech.nv] @ free
    assert_derivative(along, lambda x: run(x).y, 0.0, 1e-9, mech=mech)


NAMES = ("joint.rocker.xyz.0", "frame.coupler_tip.xyz.0", "start.v.crank")


@pytest.mark.parametrize("options", [{"project": True}, {"formulation": "ggl"}])
@pytest.mark.parametrize("name", NAMES)
def test_every_sort_of_parameter(name, options):
    assert_tangent(1e-10, "four_bar", name, 0.4, step=0.05, method="radau5", **options)


@pytest.mark.parametrize("options", [{}, {"project": True}, {"formulation": "ggl"}])
def test_multipliers_that_converge_after_the_state(options):
    """In a parallelogram those of stages are 1e-7 off when x and x' have converged to rounding."""
    name = "frame.crank_1_tip.xyz.0"
    make = LoadedModel(mbdae.load("n_four_bar"))
    value = parameter_value(make, name)

    @cache
    def run(x):
        return mbdae.solve(make.make({name: x}), (0.0, 0.3), method="radau3", step=0.02, **options)

    sol = run(value)
    found = mbdae.sensitivity(sol, {name: value}, model=make).dy[..., 0]
    assert_derivative(found, lambda x: run(x).y, value, 1e-11, (1e-3, 3e-3), mech=sol.mechanism)
    compare(sol, {name: value}, ["v.crank_0", "energy"], model=make)


def test_controlled_runs_of_ggl_with_frozen_steps():
    template, value, run = runs_of(
        "four_bar", "joint.crank.mass", 0.5, rtol=1e-3, method="radau5", formulation="ggl"
    )
    compare(run(value), ["joint.crank.mass"], ["q.crank", "lam.pin.1"], start=True, model=template)


@pytest.mark.parametrize("rtol", [1e-3, 1e-5, 1e-7, 1e-9])
def test_controlled_runs_with_frozen_steps(rtol):
    """Stages are iterated to a thousandth of rtol: steps that are computed to rounding, and derivatives, differ so."""
    name = "joint.crank.mass"
    template, value, run = runs_of("four_bar", name, 0.2, rtol=rtol, method="radau5")
    found = mbdae.sensitivity(run(value), [name], model=template)
    left = 1e-11 + 1e-2 * rtol
    assert np.abs(repeated_run(found.trajectory, template.make({name: value})) - found.y).max() < left
    assert_derivative(found.dy[..., 0], lambda x: repeated_run(found.trajectory, template.make({name: x})), value,
                      10 * left, mech=found.trajectory.sol.mechanism)  # fmt: skip


@pytest.mark.parametrize("form", ["index2", "ggl"])
@pytest.mark.parametrize(("model", "T"), [("bricard", 0.3), ("heavy_top", 0.05), ("panda_handle", 0.02)])
def test_adjoint(model, T, form):
    mech = mbdae.load(model)
    sol = mbdae.solve(mech, (0.0, T), method="radau5", formulation=form, rtol=1e-5)
    compare(sol, ["gravity.2"], ["energy", "work", f"lam.{mech.row_names[0]}.1"], start=True)


def test_a_mode_without_rows():
    """A chain whirls freely above a floor."""
    mech = mbdae.load("bouncing_chain")
    sol = mbdae.solve(mech, (0.0, 0.05), step=0.025, method="radau5")
    assert sol.modes == [(0, (0,) * len(mech.switches))]
    compare(sol, ["gravity.2"], ["energy", f"v.{mech.joint_names[-1]}"], start=True)


@pytest.mark.native
def test_bodies_that_turn_far_in_a_step():
    """One set of partials does not serve all stages: Newton's iteration takes those of each."""
    mech = mbdae.load("bouncing_chain")
    q, v, along = mech.start[0], np.array([17.6, 4.5, -15.1, -2.4, -4.4]), np.array([0.3, -0.2, 0.1, 0.4, -0.3])

    @cache
    def run(x):
        return mbdae.solve(mech, (0.0, 0.025), q, v + x * along, step=0.025, method="radau5")

    start = State(np.concatenate([q, v, [0.0]]))
    assert mech.system(native=backend.load()).compiled_step(method("radau5"), 0.0, 0.025, start) is None
    found = mbdae.sensitivity(run(0.0), start=True).dy[:, :, mech.nv : 2 * mech.nv] @ along
    assert_derivative(found, lambda x: run(x).y, 0.0, 1e-9, mech=mech)


def test_terminal_events():
    event = mbdae.Event(lambda t, q, v: q[0] - 1.0, terminal=True)
    sol = mbdae.solve(mbdae.load("four_bar"), (0.0, 2.0), method="radau5", rtol=1e-5, events=event)
    compare(sol, ["joint.crank.mass"], ["q.coupler", "t"], start=True, event=event)
    explicit = mbdae.solve(mbdae.load("four_bar"), (0.0, 2.0), method="pherk6", rtol=1e-10, events=event)
    ends = [mbdae.sensitivity(s, ["joint.crank.mass"], event=event).dt[-1, 0] for s in (sol, explicit)]
    assert ends[0] == pytest.approx(ends[1], rel=1e-4)
