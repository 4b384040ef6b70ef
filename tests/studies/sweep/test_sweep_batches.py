"""Batches of runs in the compiled core: the tables are those of single runs, bit for bit, and Ctrl-C keeps rows."""

import numpy as np
import pytest

import mbdae
from mbdae import backend
from mbdae.studies.sweep import sweep as module
from mbdae.studies.sweep import sweep_batch

pytestmark = pytest.mark.skipif(backend.load() is None, reason="batches are made in the compiled core")
OUTPUTS = ["final q.slider", "final force.wrist pin"]
CASES = {
    "starts": ("slider_crank", {"start.v.crank": np.linspace(3.0, 11.0, 24).tolist()}, OUTPUTS),
    "parameters and settings": (
        "slider_crank", {"frame.rod_tip.xyz.0": [0.34, 0.36], "solve.rtol": [1e-4, 1e-6]}, OUTPUTS,
    ),
    "a rod that is too short": ("slider_crank", {"frame.rod_tip.xyz.0": [0.35, 0.01, 0.36]}, OUTPUTS),
    "an invalid value": ("slider_crank", {"solve.rtol": [1e-5, -1.0]}, OUTPUTS),
    "modes": ("pendulum_on_stop", [{"solve.rtol": 1e-6}, {"solve.rtol": 1e-7}], ["final energy"]),
    "singular configurations": ("n_four_bar", {"N": [1, 2]}, ["final kinetic"]),
    "an unwrapped angle": ("cam_follower", {"solve.rtol": [1e-6]}, ["final q.cam"]),
    "forces": ("spring_four_bar", {"start.v.left": [0.5, 1.0]}, ["final energy", "final work"]),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("workers", [1, 2])
def test_tables_have_the_bits_of_single_runs(case, workers, monkeypatch):
    model, parameters, outputs = CASES[case]
    settings = {"outputs": outputs, "executor": "threads", "workers": workers}
    made = []
    monkeypatch.setattr(sweep_batch, "run", lambda job, task, stop: made.append(task) or module.run(job, task, stop))
    found = mbdae.sweep(model, parameters, 0.8, **settings)
    monkeypatch.setattr(module, "takes_batches", lambda job: False)
    single = mbdae.sweep(model, parameters, 0.8, **settings)
    assert found.rows == single.rows
    expected = {"a rod that is too short": 1, "an invalid value": 1, "modes": 2, "an unwrapped angle": 1}
    assert case == "singular configurations" or len(made) == expected.get(case, 0)


def test_slider_cranks_keep_their_energy():
    found = mbdae.sweep("slider_crank", {"start.v.crank": [4.0, 8.0]}, 2.0, outputs=["final energy"], workers=1)
    mech = mbdae.load("slider_crank")
    for speed, energy in zip((4.0, 8.0), found["final energy"], strict=True):
        q, v = mech.assemble(q={"crank": 0.3}, v={"crank": speed}, guess=mech.start_values.guess)
        np.testing.assert_allclose(energy, sum(mech.system().energy(q, v)), rtol=1e-6)


def test_an_interrupt_returns_the_finished_batches():
    def progress(done, text):
        raise KeyboardInterrupt

    speeds = {"start.v.crank": np.linspace(4.0, 8.0, 40).tolist()}
    found = mbdae.sweep("slider_crank", speeds, 0.5, outputs=OUTPUTS, executor="threads", workers=1, progress=progress)
    assert 0 < len(found) < 40
    assert set(found["status"]) == {"finished"}
    assert np.isfinite(found["final q.slider"]).all()


def test_a_start_at_another_velocity_closes_the_same_position():
    mech = mbdae.load("slider_crank")
    first = mech.start[0].copy()
    mech.start[0][:] = np.nan  # a user's change does not reach the variants
    template = sweep_batch.maker_of_job(sweep_batch.Job("slider_crank"))
    slow, fast = (template.make({"start.v.crank": x}) for x in (1.0, 2.0))
    for variant in (slow, fast):
        np.testing.assert_array_equal(variant.start[0], first)
    np.testing.assert_allclose(fast.start[1], 2 * slow.start[1], rtol=1e-12)
    slow.start[0][:] = 0.0
    np.testing.assert_array_equal(template.make({"start.v.crank": 3.0}).start[0], first)
    other = template.make({"start.q.crank": 0.5})
    assert other.start[0][0] == 0.5
    assert np.abs(other.residual(*other.start)[0]).max() < 1e-12
