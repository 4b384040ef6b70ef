"""Comparisons in separate processes and on the command line: same results, plain output, Ctrl-C."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest
from commands import call

import mbdae
from mbdae.errors import InputError
from mbdae.studies.comparison import comparison_runs
from mbdae.studies.comparison.comparison import Comparison
from mbdae.studies.comparison.comparison_runs import without_geometry

RUNS = {"methods": ("pherk5", "herk3", "ggl:pherk5", "index1:RK45"), "rtol": (1e-3, 1e-5)}


def without_times(points):
    return [replace(p, times=()) for p in points]


@pytest.mark.usefixtures("forked_workers")
def test_processes_give_the_same():
    mech = mbdae.load("four_bar")
    one = mbdae.compare(mech, (0, 0.5), **RUNS, repeats=0)
    several = mbdae.compare(mech, (0, 0.5), **RUNS, repeats=1, workers=2)
    assert without_times(several.points) == without_times(one.points)
    assert all(len(p.times) == 1 for p in several.points)


def test_what_cannot_be_sent_is_said():
    mech = mbdae.load("pendulum", forces=[lambda t, q, v: -0.1 * v])
    with pytest.raises(InputError, match="cannot be sent to another process"):
        mbdae.compare(mech, (0, 0.2), **RUNS, workers=2)


def test_shapes_are_not_sent():
    panda = mbdae.load("panda_handle")
    assert without_geometry(panda).visuals is None
    assert panda.visuals is not None


SHORT = ("compare", "four_bar", "-t", "0.5", "-m", "pherk5,ggl:herk3", "-m", "index1:RK45", "--repeats", "1")


@pytest.mark.slow
def test_output_in_a_pipe_is_plain_and_json_is_one_document(tmp_path):
    code, out, err = call(*SHORT, "--rtol", "1e-3,1e-5", "-o", "c.csv", "--plot", "c.png", cwd=tmp_path)
    assert (code, err) == (0, "")
    assert "\x1b" not in out
    assert out.endswith("wrote c.csv\nwrote c.png\n")
    assert "fewest solves" in out
    code, out, err = call(*SHORT, "--rtol", "1e-3", "--rtol", "1e-5", "-o", "c.csv", "--json", cwd=tmp_path)
    assert (code, err) == (0, "")
    data = json.loads(out, parse_constant=pytest.fail)
    assert [p["method"] for p in data["points"]] == 2 * ["pherk5"] + 2 * ["ggl:herk3"] + 2 * ["index1:RK45"]
    assert data["written"] == ["c.csv"]
    assert call(*SHORT, "-t", "0.4", "-o", "c.csv", cwd=tmp_path)[0] == 2
    kept = (tmp_path / "c.csv").read_text()
    assert call(*SHORT, "-m", "herk9", "-o", "c.csv", "--fresh", cwd=tmp_path)[0] == 2
    assert (tmp_path / "c.csv").read_text() == kept
    assert call(*SHORT, "--rtol", "1e-3", "-t", "0.4", "-o", "c.csv", "--fresh", cwd=tmp_path)[0] == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["compare", "four_bar", "-m", "herk9"], ["unknown method 'herk9'"]),
        (["compare", "four_bar", "--rtol", "low"], ["--rtol takes numbers, got low"]),
        (["compare", "four_bar", "-o", "c.txt"], ["c.txt", ".csv or .json"]),
        (["compare", "four_bar", "--plot", "c.bmp"], ["c.bmp", ".png"]),
        (["compare", "four_bar", "-t", "-1"], ["end time must be positive"]),
        (["drift", "four_bar", "-m", "ggl:herk9"], ["unknown method 'herk9'"]),
        (["order", "four_bar", "--plot", "c.jpg"], ["c.jpg"]),
        (["report", "four_bar", "-o", "r.pdf"], ["r.pdf", ".html"]),
    ],
)
def test_usage_errors_are_one_line(arguments, words, tmp_path):
    code, out, err = call(*arguments, cwd=tmp_path)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert all(word in err for word in words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_ctrl_c_keeps_what_is_finished(tmp_path, workers):
    arguments = ["compare", "four_bar", "-t", "0.1", "-m", "pherk5,herk2", "--rtol", "1e-3,1e-11", "-o", "c.json"]
    arguments += ["--backend", "python"]  # where the last of the four runs takes a minute
    command = [sys.executable, "-m", "mbdae", *arguments, "--workers", str(workers)]
    process = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    for _ in range(600):
        if (tmp_path / "c.json").exists() or process.poll() is not None:
            break
        time.sleep(0.1)
    time.sleep(0.2)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all processes
    out, err = process.communicate(timeout=60)
    assert process.returncode == 1, err
    kept = Comparison.load(tmp_path / "c.json")
    finished = f"mbdae: stopped by the user after {len(kept.points)} of 4 runs"
    assert err == f"{finished}; c.json has the finished runs, the same command resumes from them\n"
    assert "stopped" in out
    assert not kept.complete
    assert 1 <= len(kept.points) < 4


def test_ctrl_c_while_times_are_taken_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(comparison_runs, "time_run", lambda *_: os.kill(os.getpid(), signal.SIGINT))
    code, out, err = call("compare", "pendulum", "-m", "pherk5", "--rtol", "1e-3", "-t", "0.1", cwd=tmp_path)
    assert (code, err) == (1, "mbdae: stopped by the user before all times were measured\n")
    assert "stopped: 1 of 1 runs" in out
