"""Worker processes of studies: they ignore Ctrl-C, end with the process that started them, and lose nothing."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future
from contextlib import suppress

import numpy as np
import pytest

import mbdae
from mbdae.errors import InputError, MbdaeError
from mbdae.studies.workers import QUEUED_PER_WORKER, UNKNOWN_EXECUTOR_WORKERS, Pool, pool

POLLS = 3000  # of a run that nobody stops
STUDY = """
import multiprocessing, os, time
from pathlib import Path

PHASE = {phase!r}

def report():
    Path(f"{{os.getpid()}}.worker").touch()

if __name__ == "__mp_main__" and PHASE == "importing":
    report()
    while not Path("signalled").exists():
        time.sleep(0.01)

import mbdae

def force(t, q, v):
    if multiprocessing.parent_process() and PHASE == "computing":
        report()
        time.sleep(60)
    return 0 * v

def model(**parameters):
    return mbdae.load("four_bar", forces=[force])

if __name__ == "__main__":
    print({call}.complete)
"""
CALLS = [
    'mbdae.sweep(model, [{}] * 9, 0.01, executor="processes", workers=2)',
    'mbdae.compare(model(), (0, 0.01), methods=["herk2"], workers=2)',
]


def signalled(folder, call, phase, how):
    """Send a signal to a script, alone or with its workers, when both are at work; return how it ended."""
    (folder / "study.py").write_text(STUDY.format(call=call, phase=phase))
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen([sys.executable, "study.py"], cwd=folder, start_new_session=True, **pipes)
    try:
        while len(list(folder.glob("*.worker"))) < 2:
            assert process.poll() is None, process.communicate()
            time.sleep(0.01)
        (os.killpg if how == signal.SIGINT else os.kill)(process.pid, how)  # Ctrl-C reaches all processes
        if how != signal.SIGINT:
            process.wait(30)
        (folder / "signalled").touch()  # workers that import do so until now, on a loaded machine, too
        out, err = process.communicate(timeout=30)  # it waits for all processes that hold the pipes
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    return process.returncode, out, err


@pytest.mark.slow
@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("phase", ["importing", "computing"])
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_workers_end_with_the_process_that_started_them(call, phase, how, tmp_path):
    assert signalled(tmp_path, call, phase, how)[0] == -how


@pytest.mark.slow
@pytest.mark.parametrize("call", CALLS)
def test_workers_hear_no_ctrl_c_while_they_import(call, tmp_path):
    assert signalled(tmp_path, call, "importing", signal.SIGINT) == (0, "False\n", "")


def double(job, task, stop):
    """A run that is slow, fails, or is invalid."""
    if task == "gone":
        os._exit(3)
    if task == "wrong":
        raise InputError("wrong")
    if task == "long":
        for _ in range(POLLS):
            if stop():
                break
            time.sleep(0.01)
        else:
            (job / "not stopped").touch()
    return [job, 2 * task]


@pytest.mark.usefixtures("forked_workers")
@pytest.mark.parametrize("kind", ["threads", "processes"])
def test_results_come_with_their_tasks(kind):
    found = {}
    with pool(kind, 2, double, "shared", "less") as shop:
        assert shop.max_pending == 2 * QUEUED_PER_WORKER
        shop.run(range(9), found.__setitem__)
    assert found == {i: ["shared", 2 * i] for i in range(9)}


def test_clusters_grow():
    class Cluster(Executor):
        _client = property(lambda self: self)  # as Dask's

        def nthreads(self):
            return threads

    threads = {}
    with pool(Cluster(), None, double, None, "less") as shop:
        assert shop.max_pending == UNKNOWN_EXECUTOR_WORKERS * QUEUED_PER_WORKER
        threads |= {"one": 1, "two": 2}
        assert shop.max_pending == 3 * QUEUED_PER_WORKER
    with pool(Cluster(), 5, double, None, "less") as shop:
        assert shop.max_pending == 5 * QUEUED_PER_WORKER


@pytest.mark.usefixtures("forked_workers")
def test_a_lost_worker_is_reported_and_errors_are_passed_on():
    for task, words in (("gone", "gone failed in its worker"), ("wrong", "wrong")):
        with pytest.raises(MbdaeError, match=words) as e, pool("processes", 1, double, None, "less") as shop:
            shop.run([task], lambda *found: None)
        assert isinstance(e.value, InputError) is (task == "wrong")


@pytest.mark.usefixtures("forked_workers")
@pytest.mark.parametrize("kind", ["threads", "processes"])
def test_runs_under_way_give_up_when_something_fails(kind, tmp_path):
    def fail(task, found):
        raise ValueError("full")

    with pytest.raises(ValueError, match="full"), pool(kind, 2, double, tmp_path, "less") as shop:
        shop.run(["long", 1, "long", "long", "long"], fail)
    assert not list(tmp_path.iterdir())


def test_what_is_finished_is_kept_at_ctrl_c():
    def submit(task):
        future = Future()
        given.append(task)
        if task == 2:
            future.set_running_or_notify_cancel()
        elif task == 3:
            future.set_exception(OSError("gone"))
        else:
            future.set_result(-task)
        return future

    def keep(task, found):
        kept[task] = found
        if task == 0:
            raise KeyboardInterrupt

    given, kept = [], {}
    with pytest.raises(KeyboardInterrupt):
        Pool(submit, lambda: 2).run(range(9), keep)
    assert given == [0, 1, 2, 3]
    assert kept == {0: 0, 1: -1}


def test_numbers_of_workers_that_are_none_are_rejected():
    for workers in (0, 10_001, 1.5, True):
        with pytest.raises(InputError, match="workers is a number"), pool("threads", workers, double, None, "less"):
            pass


def test_a_number_of_workers_may_be_an_integer_of_numpy():
    runs = mbdae.sweep("slider_crank", {"start.v.crank": [1.0, 2.0]}, 0.02, workers=np.int64(1))
    assert len(runs) == 2
