"""What `mbdae solve` says of a motion."""

import json

import pytest
from click.testing import CliRunner

import mbdae
from mbdae.__main__ import cli


def test_impacts_are_reported():
    sol = mbdae.solve(mbdae.load("pendulum_on_stop"), (0, 2), rtol=1e-8)
    words = ["solve", "pendulum_on_stop", "-t", "2"]
    text = CliRunner().invoke(cli, words).output
    assert "impacts on rod stop: t = 0.464927724, 1.27497619, 1.97549149 s (3)" in text
    reported = json.loads(CliRunner().invoke(cli, [*words, "--json"]).output)["impacts"]
    assert [x["t"] for x in reported] == pytest.approx([x.t for x in sol.impacts], abs=1e-9)
    assert reported[0]["where"] == ["rod stop"]


def test_info_reports_mode_switches():
    text = CliRunner().invoke(cli, ["info", "stick_slip_slider"]).output
    assert "closure rows 7 (rank 2, 3 rows depend on others, 2 switched)" in text
    assert "closure   crank friction: brake crank, 1 rows\n" in text
    chain = CliRunner().invoke(cli, ["info", "bouncing_chain"]).output
    assert "closure rows 8 (rank 0, 8 switched), degrees of freedom 5" in chain
    assert "dependent" not in chain


def test_statics_tell_what_they_leave_out():
    with pytest.warns(UserWarning, match="ignore clutches and stiction: crank friction, slider friction"):
        mbdae.equilibrium(mbdae.load("stick_slip_slider"))
