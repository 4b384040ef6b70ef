"""Batches of runs in the compiled core: the tables are those of single runs, bit for bit, and Ctrl-C keeps rows."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import mbdae
from mbdae import backend
from mbdae.studies.sweep import sweep_batch
from mbdae.studies.sweep.plan import planned_runs
from mbdae.studies.workers import StopFlag

pytestmark = pytest.mark.skipif(backend.load() is None, reason="batches are made in the compiled core")
OUTPUTS = ["final q.slider", "final force.wrist pin"]
CASES = {
    "starts": ("slider_crank", {"start.v.crank": np.linspace(3.0, 11.0, 24).tolist()}, OUTPUTS),
    "parameters and settings": (
        "slider_crank", {"frame.rod_tip.xyz.0": [0.34, 0.36], "solve.rtol": [1e-4, 1e-6]}, OUTPUTS,
    ),
    "a rod that is too short": ("slider_crank", {"frame.rod_tip.xyz.0": [0.35, 0.01, 0.36]}, OUTPUTS),
    "an invalid value": ("slider_crank", {"solve.rtol": [1e-5, -1.0]}, OUTPUTS),
    "an unknown event": ("slider_crank", {"solve.events": ["a"]}, OUTPUTS),
    "modes": ("pendulum_on_stop", [{"solve.rtol": 1e-6}, {"solve.rtol": 1e-7}], ["final energy"]),
    "singular configurations": ("n_four_bar", {"N": [1, 2]}, ["final kinetic"]),
    "an unwrapped angle": ("cam_follower", {"solve.rtol": [1e-6]}, ["final q.cam"]),
    "forces": ("spring_four_bar", {"start.v.left": [0.5, 1.0]}, ["final energy", "final work"]),
}  # fmt: skip

SINGLE = ("a rod that is too short", "an invalid value", "an unwrapped angle", "an unknown event")  # one run each


class Cluster(ThreadPoolExecutor):
    """Its workers get copies, as on other machines."""

    def submit(self, function, *args):
        def remote():
            called, given = pickle.loads(sent)
            return called(*given)

        sent = pickle.dumps((function, args))
        return super().submit(remote)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize(("executor", "workers"), [("threads", 1), ("threads", 2), ("cluster", 2)])
def test_tables_have_the_bits_of_single_runs(case, workers, executor, monkeypatch):
    model, parameters, outputs = CASES[case]
    made, run = [], sweep_batch.run
    monkeypatch.setattr(sweep_batch, "run", lambda job, task, stop: made.append(task) or run(job, task, stop))
    with Cluster(workers) as cluster:
        settings = {"outputs": outputs, "executor": cluster if executor == "cluster" else "threads", "workers": workers}
        found = mbdae.sweep(model, parameters, 0.8, **settings)
    monkeypatch.setattr(sweep_batch, "_needs_final_values_only", lambda job: False)
    single = mbdae.sweep(model, parameters, 0.8, outputs=outputs, executor="threads", workers=workers)
    assert found.rows == single.rows
    expected = {"modes": 2} | dict.fromkeys(SINGLE, 1)
    made = made[: -len(single)]
    assert case == "singular configurations" or len(made) == expected.get(case, 0)


def test_batches_take_a_fifth_of_a_second():
    plan, seconds = planned_runs([{}] * 1000, 0), {}
    batches = sweep_batch.batches_of(plan, 4, seconds)
    made = []
    for run_seconds, size in ((None, 7), (9.0, 1), (0.05, 4), (1e-9, 500)):
        if run_seconds:
            seconds |= dict.fromkeys(range(len(seconds), len(seconds) + sweep_batch.LAST_RUNS), run_seconds)
        made.append(next(batches))
        assert len(made[-1]) == size
    texts = ["batch of runs 0 to 6", "run 7", "batch of runs 8 to 11", "batch of runs 12 to 511"]
    assert list(map(str, made)) == texts
    assert [task for batch in (*made, *batches) for task in batch.tasks()] == [*plan[0].tasks()]


@pytest.mark.parametrize(("runs", "size"), [(1, 1), (200, 1), (256, 2), (10_000, 8)])
def test_the_first_batch_is_short(runs, size):
    assert len(next(sweep_batch.batches_of(planned_runs([{}] * runs, 0), 4, {}))) == size


@pytest.mark.parametrize(
    ("seconds", "expected"),
    [
        (0.02, [5, 4, 3, 3, 3, 2, 2, 2, 2, *[1] * 14]),  # an eighth of what is left
        (0.008, [5, 4, 3, 3, 3, *[2] * 11]),  # but not less than takes 20 ms
        (1e-9, [40]),
    ],
)
def test_the_last_batches_are_short(seconds, expected):
    batches = sweep_batch.batches_of(planned_runs([{}] * 40, 0), 4, {0: seconds})
    assert [*map(len, batches)] == expected


def test_a_stopped_batch_leaves_its_runs():
    job = sweep_batch.Job("slider_crank", (0.0, 0.5), None, ("final q.slider",))
    (batch,), shared = planned_runs({"start.v.crank": [4.0, 5.0]}, 0), bytearray(1)
    for runs in ([0, 1], []):
        found = sweep_batch.run_batch(job, batch, StopFlag(shared))
        assert [i for x in found for i in x.results["run"]] == runs
        StopFlag(shared).set()  # by another process


def test_runs_that_need_python_are_made_one_by_one(monkeypatch):
    monkeypatch.setattr(sweep_batch, "BATCH_SECONDS", 1e9)  # the same batches on a slow machine

    def model(speed):
        made.append(speed)
        return mbdae.load("pendulum_on_stop")

    made, speeds = [], list(range(40))
    found = mbdae.sweep(model, {"speed": speeds}, 0.01, outputs=["final energy"], executor="threads", workers=1)
    assert len(found) == 40
    assert len(made) < 1.5 * 40  # and once for the check, and once for each batch


def test_slider_cranks_keep_their_energy():
    found = mbdae.sweep("slider_crank", {"start.v.crank": [4.0, 8.0]}, 2.0, outputs=["final energy"], workers=1)
    mech = mbdae.load("slider_crank")
    for speed, energy in zip((4.0, 8.0), found["final energy"], strict=True):
        q, v = mech.assemble(q={"crank": 0.3}, v={"crank": speed}, guess=mech.start_values.guess)
        np.testing.assert_allclose(energy, sum(mech.system().energy(q, v)), rtol=1e-6)


def test_an_interrupt_returns_the_finished_batches(monkeypatch):
    def progress(done, text):
        if done > 2 / 40:
            raise KeyboardInterrupt

    monkeypatch.setattr(sweep_batch, "BATCH_SECONDS", 1e9)
    speeds = {"start.v.crank": np.linspace(4.0, 8.0, 40).tolist()}
    found = mbdae.sweep("slider_crank", speeds, 0.5, outputs=OUTPUTS, executor="threads", workers=1, progress=progress)
    assert 0 < len(found) < 40
    assert len(found) in (1 + 1 + 9, 1 + 1 + 9 + 7)  # whole batches
    assert set(found["status"]) == {"finished"}
    assert np.isfinite(found["final q.slider"]).all()


def test_a_start_at_another_velocity_closes_the_same_position():
    mech = mbdae.load("slider_crank")
    first = mech.start[0].copy()
    mech.start[0][:] = np.nan  # a user's change does not reach the variants
    template = sweep_batch.Job("slider_crank").factory
    slow, fast = (template.make({"start.v.crank": x}) for x in (1.0, 2.0))
    for variant in (slow, fast):
        np.testing.assert_array_equal(variant.start[0], first)
    np.testing.assert_allclose(fast.start[1], 2 * slow.start[1], rtol=1e-12)
    slow.start[0][:] = 0.0
    np.testing.assert_array_equal(template.make({"start.v.crank": 3.0}).start[0], first)
    other = template.make({"start.q.crank": 0.5})
    assert other.start[0][0] == 0.5
    assert np.abs(other.residual(*other.start)[0]).max() < 1e-12
