"""Options of all commands that take a model: its start, its parameters; and the replay of a run."""

import json

import pytest
from click.testing import CliRunner

import mbdae
from mbdae.__main__ import cli
from mbdae.studies.replay import replay


def test_models_start_and_are_made_as_the_command_line_says(tmp_path):
    run = CliRunner().invoke
    out = run(cli, ["info", "n_four_bar", "--set", "N=3", "--start", "v.crank_0=0.5", "--json"])
    found = json.loads(out.output)
    assert (found["nq"], found["v"][0]) == (7, 0.5)
    path = tmp_path / "run.npz"
    run(cli, ["solve", "four_bar", "-t", "0.01", "--start", "q.crank=0.9", "-o", str(path)])
    assert mbdae.Solution.load(path).q[0, 0] == pytest.approx(0.9)
    out = run(cli, ["kinematics", "four_bar", "--start", "q.crank=1.3", "--drive", "crank", "--points", "5", "--json"])
    assert json.loads(out.output)["table"]["u"][0] == pytest.approx(1.3)
    for words, said in (
        (["info", "n_four_bar", "--set", "M=3"], "unknown parameter of n_four_bar 'M'"),
        (["info", "four_bar", "--start", "q.crnk=1"], "unknown joint 'crnk'"),
        (["solve", "four_bar", "--start", "x.crank=1"], "unknown entry of start 'x'"),
        (["drift", "four_bar", "--set", "N"], "--set takes name=value"),
    ):
        assert said in str(run(cli, words).exception), words


def test_a_run_writes_the_replay_that_it_is_asked_for(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(replay, "animate", lambda sol, path, **options: asked.append((path, options)))
    words = ["--trace", "coupler_tip", "--arrows", "--plots", "q.crank,q.rocker", "--speed", "0.5"]
    files = [str(tmp_path / "run.html"), str(tmp_path / "run.mp4")]
    out = CliRunner().invoke(cli, ["solve", "four_bar", "-t", "0.1", "--html", files[0], "--video", files[1], *words])
    assert out.exit_code == 0, out.output
    options = {"speed": 0.5, "plots": [("q.crank", "q.rocker")], "traces": ("coupler_tip",), "arrows": True}
    options |= {"camera": None, "follow": None, "closures": False, "deformation": None}
    assert asked == [(path, options) for path in files]
    out = CliRunner().invoke(cli, ["solve", "four_bar", "-t", "0.1", "--arrows"])
    assert "need a replay" in str(out.exception)
