"""Recomputed steps have the same bits, and cost little memory."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

import mbdae
from mbdae.integrate.trajectory import checkpoints
from mbdae.integrate.trajectory.checkpoints import Checkpoints
from mbdae.integrate.trajectory.trajectory import Trajectory
from mbdae.studies.sensitivity.run_parameters import bind_parameters


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(checkpoints, "MAX_STORED", 5)


def test_states_are_recomputed(short):
    calls = []

    def walk(i, j, x):
        calls.extend(range(i, j))
        return [x + list(range(i, k)) for k in range(i, j + 1)]

    walked = Checkpoints(23, [], walk)
    assert calls == list(range(22))
    assert [walked[i] for i in reversed(range(23))] == [list(range(i)) for i in reversed(range(23))]
    assert len(calls) == 22 + 20  # the last segment was stored, and each of the others is recomputed once
    assert walked.segment(1)[:5] == [list(range(i)) for i in range(5, 10)]


@pytest.mark.parametrize(
    ("model", "T", "options"),
    [
        ("four_bar", 1.0, {"method": "pherk5", "rtol": 1e-5}),
        ("four_bar", 1.0, {"method": "arnold4", "step": 0.05, "project": True}),
        ("bricard", 6.0, {"method": "pherk5", "step": 0.1}),
    ],
)
def test_recomputed_steps_have_the_same_bits(model, T, options, monkeypatch):
    """Backwards and in segments as all at once; Bricard's rows change in between. A short run stores all of them."""
    run = mbdae.solve(mbdae.load(model), (0.0, T), **options)
    sol = replace(run, carried=None)
    at_once = Trajectory(sol, bind_parameters(sol, [], None))
    monkeypatch.setattr(checkpoints, "MAX_STORED", 5)
    pieces = Trajectory(sol, bind_parameters(sol, [], None))
    for i in reversed(range(len(sol.t))):
        np.testing.assert_array_equal(pieces.state(i).carry, at_once.state(i).carry)
    found = [mbdae.sensitivity(sol, start=True).dy]
    monkeypatch.setattr(checkpoints, "MAX_STORED", 1000)
    found.append(mbdae.sensitivity(sol, start=True).dy)
    np.testing.assert_array_equal(*found)
    kept = Trajectory(run, bind_parameters(run, [], None))
    assert kept.restarted.tolist() == at_once.restarted.tolist()
    for i in range(len(run.t) - 1):
        np.testing.assert_allclose(kept.state(i).carry, at_once.state(i).carry, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(mbdae.sensitivity(run, start=True).dy, found[0], rtol=1e-7, atol=1e-9)


def test_long_runs_keep_nothing():
    sol = mbdae.solve(mbdae.load("pendulum"), (0.0, 1.2), step=1e-3, method="pherk3")
    assert sol.carried is None
    assert mbdae.solve(mbdae.load("pendulum"), (0.0, 0.9), step=1e-3, method="pherk3").carried[0].shape[0] == 900


def test_memory_of_an_adjoint(short):
    """It grows by less than the run itself, so that a million steps of the pendulum need far less than 1 GB."""
    peaks = []
    for n in (30, 180):
        sol = mbdae.solve(mbdae.load("pendulum"), (0.0, 1e-3 * n), step=1e-3, method="pherk3")
        sol.carried = None
        cost = mbdae.Squares({"q.ball.x": np.zeros(len(sol.t))})
        mbdae.gradient(sol, cost, ["gravity.2"])
        tracemalloc.start()
        mbdae.gradient(sol, cost, ["gravity.2"])
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert (peaks[1] - peaks[0]) / 150 < 400
