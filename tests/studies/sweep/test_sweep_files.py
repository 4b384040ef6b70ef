"""Sweeps on threads, processes and clusters, in files that survive, and from the command line."""

import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor

import numpy as np
import pytest
from commands import call

import mbdae
from mbdae import backend
from mbdae.errors import InputError, MbdaeError, UnknownNameError
from mbdae.studies.sweep.results_file import PART
from mbdae.studies.sweep.toml_file import read_sweep
from mbdae.studies.workers import QUEUED_PER_WORKER, pool

LINKS = {"frame.rod_tip.xyz.0": [0.34, 0.36], "start.v.crank": [5.0, 6.0, 7.0]}
QUICK = {"outputs": ["peak force.wrist pin", "q.slider"], "times": 11, "rtol": 1e-6, "executor": "threads"}


def last_crank(sol):
    return {"angle": sol.q[-1, 0], "speed": sol.v[-1, 0]}


# -- executors -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.usefixtures("forked_workers")
def test_threads_processes_and_dask_give_the_same_bits(tmp_path):
    distributed = pytest.importorskip("distributed")
    links = {name: {"distribution": "normal", "loc": x, "scale": 1e-3} for name, x in
             (("frame.rod_tip.xyz.0", 0.35), ("joint.crank_pin.xyz.0", 0.1))}  # fmt: skip
    runs = mbdae.Random(12, {**links, "joint.slider.mass": {"distribution": "choice", "a": [0.6, -1.0]}})
    options = {**QUICK, "outputs": [*QUICK["outputs"], last_crank], "seed": 5}

    def content(name, **more):
        path = tmp_path / f"{name}.parquet"
        result = mbdae.sweep("slider_crank", runs, 0.5, path=path, **{**options, **more})
        assert result.complete
        assert not path.with_name(path.name + PART).exists()
        return path.read_bytes()

    def ends(model="slider_crank", **more):
        speeds = {"start.v.crank": np.linspace(4.0, 8.0, 40).tolist()}
        result = mbdae.sweep(model, speeds, 0.2, outputs=["final q.slider"], **more)
        in_batches = len(set(result.seconds.values())) < len(result)  # in the core, they share their time
        assert in_batches is (backend.load() is not None)
        return result.rows

    one, last = content("threads", workers=1), ends(executor="threads", workers=1)
    assert content("two", workers=2) == one
    assert content("processes", executor="processes", workers=2) == one
    assert ends(mbdae.load("slider_crank"), executor="processes", workers=1) == last
    cluster = distributed.LocalCluster(n_workers=1, threads_per_worker=2, dashboard_address=None)
    with cluster, distributed.Client(cluster) as client:
        executor = client.get_executor()
        assert content("dask", executor=executor) == one
        assert ends(executor=executor) == last
        with pool(executor, None, print, None, "") as shop:
            assert shop.max_pending == 2 * QUEUED_PER_WORKER
    loaded = mbdae.Sweep.load(tmp_path / "dask.parquet")
    assert {"finished", "input"} == set(loaded["status"])
    assert loaded["q.slider"].shape == (12, 11)
    again = tmp_path / "again.parquet"
    loaded.save(again)
    assert again.read_bytes() == one


class Bounded(ThreadPoolExecutor):
    """Counts the submitted and unfinished runs."""

    most = 0

    def submit(self, *args):
        future = super().submit(*args)
        self.most = max(self.most, self._work_queue.qsize())
        return future


class Lossy(Executor):
    """Loses the third run."""

    given = 0

    def submit(self, function, *args):
        self.given, future = self.given + 1, Future()
        if self.given == 3:
            future.set_exception(RuntimeError("the machine is gone"))
        else:
            future.set_result(function(*args))
        return future


def test_executors_of_the_user(tmp_path, monkeypatch):
    with Bounded(2) as executor:
        result = mbdae.sweep("slider_crank", {"start.v.crank": list(np.linspace(5, 7, 30))}, 0.05, executor=executor)
        assert result.complete
        assert executor.most <= 2 * QUEUED_PER_WORKER
        assert executor.submit(int).result() == 0  # it stays open
    path = tmp_path / "runs.parquet"
    monkeypatch.setattr("mbdae.studies.workers.SHORTEST_BATCH", 0.0)  # one run a batch, however fast the first ones
    with pytest.raises(MbdaeError, match=r"run 2 failed in its worker.*the machine is gone"):
        mbdae.sweep("slider_crank", LINKS, 0.05, path=path, **{**QUICK, "executor": Lossy(), "workers": 1})
    kept = mbdae.Sweep.load(path)
    assert 0 < len(kept) < 6
    result = mbdae.sweep("slider_crank", LINKS, 0.05, path=path, **QUICK)
    assert set(result.seconds) == {0, 1, 2, 3, 4, 5} - set(kept["run"])


# -- the file --------------------------------------------------------------------------------------------------------


def test_files_of_other_sweeps_are_rejected(tmp_path):
    path, part = tmp_path / "runs.parquet", tmp_path / ("runs.parquet" + PART)
    first = mbdae.sweep("slider_crank", LINKS, 0.1, path=path, **QUICK)
    bits = path.read_bytes()
    again = mbdae.sweep("slider_crank", LINKS, 0.1, path=path, **QUICK)
    assert not again.seconds
    assert path.read_bytes() == bits
    assert again.names == first.names
    for change, words in (
        ({"parameters": {**LINKS, "gravity.2": [-1.6]}}, "parameters"),
        ({"t_span": 0.2}, "t_span"),
        ({"rtol": 1e-7}, "settings"),
        ({"outputs": []}, "outputs"),
        ({"model": "four_bar", "parameters": {"solve.rtol": [1e-6]}, "outputs": []}, "model and mechanism"),
    ):
        call = {"model": "slider_crank", "parameters": LINKS, "t_span": 0.1, **QUICK, **change}
        with pytest.raises(InputError, match=f"has another sweep, with other.* {words}"):
            mbdae.sweep(**call, path=path)
    assert path.read_bytes() == bits
    assert not part.exists()
    fresh = mbdae.sweep("slider_crank", LINKS, 0.2, path=path, fresh=True, **QUICK)
    assert len(fresh.seconds) == 6
    for file in (path, part):
        path.unlink(missing_ok=True)
        file.write_text("something else that is much longer than nothing" * 100)
        with pytest.raises(InputError, match=r"cannot read|not a file of a sweep"):
            mbdae.sweep("slider_crank", LINKS, 0.1, path=path, **QUICK)


SWEEP = """
model = "slider_crank"
end = 0.25
times = 21
outputs = ["peak force.wrist pin", "q.slider"]
workers = 1
executor = "threads"
[settings]
rtol = 1e-8
[random]
n = 60
parameters.frame.rod_tip.xyz.0 = { distribution = "normal", loc = 0.35, scale = 1e-3 }
"""


def begun(folder, how, *options):
    """Start the sweep as a process, signal it and its workers after a few runs, return its output."""
    command = [sys.executable, "-m", "mbdae", "sweep", "sweep.toml", "-o", "runs.parquet", *options]
    pipes = {"stderr": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, cwd=folder, start_new_session=True, **pipes)
    part = folder / ("runs.parquet" + PART)
    before = part.stat().st_size if part.exists() else 0
    while not part.exists() or part.stat().st_size < before + 8_000:
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    with pytest.raises(InputError, match="in use"):
        mbdae.sweep(**read_sweep(folder / "sweep.toml"), path=folder / "runs.parquet")
    os.killpg(process.pid, how)
    out, err = process.communicate(timeout=60)
    return process.returncode, out, err


@pytest.mark.slow
def test_a_sweep_that_is_stopped_or_killed_goes_on(tmp_path):
    (tmp_path / "sweep.toml").write_text(SWEEP)
    path = tmp_path / "runs.parquet"
    code, out, err = begun(tmp_path, signal.SIGINT, "--executor", "processes")
    stopped = mbdae.Sweep.load(path)
    assert 0 < len(stopped) < 60
    assert code == 1
    assert "Traceback" not in err
    assert "leaked" not in err  # by the core, when workers end
    assert err.endswith(
        f"mbdae: stopped by the user after {len(stopped)} of 60 runs; runs.parquet.part has the finished runs, "
        "the same command resumes from them\n"
    )
    assert "remain" in out
    code, out, err = begun(tmp_path, signal.SIGKILL)
    assert code == -signal.SIGKILL
    killed = mbdae.Sweep.load(path)
    assert len(stopped) < len(killed) < 60
    assert set(stopped["run"]) <= set(killed["run"])
    part = tmp_path / ("runs.parquet" + PART)
    part.write_bytes(part.read_bytes()[:-10])  # as if the last row had been half written
    rest = mbdae.Sweep.load(path)
    assert len(rest) == len(killed) - 1
    result = mbdae.sweep(**read_sweep(tmp_path / "sweep.toml"), path=path)
    assert set(result.seconds) == set(range(60)) - set(rest["run"])
    assert list(result["run"]) == list(range(60))
    whole = mbdae.sweep(**read_sweep(tmp_path / "sweep.toml"), path=tmp_path / "whole.parquet")
    assert whole.complete
    assert path.read_bytes() == (tmp_path / "whole.parquet").read_bytes()


# -- the command -----------------------------------------------------------------------------------------------------


def test_command(tmp_path):
    (tmp_path / "pendulum.toml").write_text(
        '[[body]]\nname = "bob"\nparent = "world"\naxis = [0, 1, 0]\nmass = 1.0\ncom = [0.0, 0.0, -1.0]\n'
    )
    (tmp_path / "s.toml").write_text(
        'model = "pendulum.toml"\nend = 0.1\noutputs = ["final q.bob"]\nexecutor = "threads"\n'
        "[grid]\nbody.bob.com.2 = [-1.0, -2.0]\nbody.bob.mass = [1.0, -1.0]\n"
    )
    code, out, err = call("sweep", "s.toml", "--json", "-o", "runs.parquet", cwd=tmp_path)
    assert (code, err) == (0, "mbdae: 2 of 4 runs failed, see their status\n")
    data = json.loads(out, parse_constant=pytest.fail)
    assert [row["status"] for row in data["rows"]] == ["finished", "input"] * 2
    assert data["rows"][0]["body.bob.com.2"] == -1.0
    assert data["written"] == ["runs.parquet"]
    assert data["manifest"]["settings"] == {}
    code, out, err = call("sweep", "s.toml", "-o", "runs.parquet", cwd=tmp_path)
    assert code == 0
    assert "4 runs, 2 finished, 2 input" in out
    assert "wrote runs.parquet" in out
    assert "\x1b" not in out


@pytest.mark.parametrize("own", ["rtol = 1e-4", "step = 0.01", "project = true"])
def test_command_keeps_what_the_model_says(own, tmp_path):
    """The tolerance or step of the file's table is used; runs are those of Python, and pandas reads the table."""
    (tmp_path / "pendulum.toml").write_text(
        f'[solve]\n{own}\n[[body]]\nname = "bob"\nparent = "world"\naxis = [0, 1, 0]\nmass = 1.0\n'
        "com = [0.0, 0.0, -1.0]\n"
    )
    (tmp_path / "s.toml").write_text(
        'model = "pendulum.toml"\nend = 1.0\ntimes = 3\noutputs = ["final q.bob", "q.bob"]\nexecutor = "threads"\n'
        '[grid]\n"start.q.bob" = [0.5, 1.0]\n'
    )
    code, out, err = call("sweep", "s.toml", "--json", "-o", "runs.csv", cwd=tmp_path)
    assert (code, err) == (0, "")
    data = json.loads(out)
    assert data["manifest"]["settings"] == {}
    assert data["written"] == ["runs.csv"]
    frame = pytest.importorskip("pandas").read_csv(tmp_path / "runs.csv")
    assert list(frame["start.q.bob"]) == [0.5, 1.0]
    assert list(frame["final q.bob"]) == list(frame["q.bob[2]"])
    for row, q in zip(data["rows"], (0.5, 1.0), strict=True):
        mech = mbdae.load(tmp_path / "pendulum.toml")
        sol = mbdae.solve(mech, (0, 1), *mech.assemble({"bob": q}))
        assert row["final q.bob"] == pytest.approx(sol.q[-1, 0], abs=1e-12)
        assert row["steps"] == sol.stats["steps"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('model = "four_bar"\nmodell = 1', "unknown key modell; known: end, executor, grid, model, outputs"),
        ('model = "four_bar"', "takes one of [grid], [[run]] or [random], got none"),
        ('model = "four_bar"\n[grid]\n[[run]]\n', "got grid and run"),
        (
            'model = "four_bar"\n[random]\nn = 2\nm = 3\nparameters.duration = 1',
            "unknown key random.m; known: n, parameters",
        ),
        ('model = "four_bar"\n[settings]\ntol = 2\n[grid]\n"solve.rtol" = [1]', "unknown setting of solve 'tol'"),
        ('model = "four_bar"\nstart = 1.0\n[grid]\n"solve.rtol" = [1]', "start needs end"),
        ("model = ", "is not TOML"),
    ],
)
def test_wrong_files_of_sweeps(tmp_path, text, words):
    path = tmp_path / "s.toml"
    path.write_text(text)
    with pytest.raises(InputError) as e:
        read_sweep(path)
    assert words in str(e.value)


def test_files_of_sweeps_say_the_same_as_python(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text('model = "four_bar"\n[[run]]\nstart.v.crank = 1.0\nsolve.method = "herk5"\n[[run]]\n')
    assert read_sweep(path)["parameters"] == [{"start.v.crank": 1.0, "solve.method": "herk5"}, {}]
    path.write_text(SWEEP)
    read = read_sweep(path)
    assert read["parameters"].n == 60
    assert list(read["parameters"].parameters) == ["frame.rod_tip.xyz.0"]
    assert (read["t_span"], read["rtol"], read["workers"]) == ((0.0, 0.25), 1e-8, 1)


def test_unknown_columns():
    result = mbdae.sweep("slider_crank", {"start.v.crank": [6.0]}, 0.1, executor="threads")
    with pytest.raises(UnknownNameError, match="column"):
        result["steeps"]
