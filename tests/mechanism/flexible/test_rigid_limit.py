"""A coupler that is a million times stiffer, and damped, moves as a rigid one."""

import importlib
from pathlib import Path

import numpy as np
from flexible_bodies import FOUR_BAR

import mbdae

BENCHMARKS = Path(__file__).parents[3] / "examples" / "benchmarks"


def test_the_rigid_limit(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(BENCHMARKS)
    text = FOUR_BAR.read_text()
    (tmp_path / "stiff.toml").write_text(text.replace("2.1e11", "2.1e19").replace("ends =", "damping = 1.0\nends ="))
    couplers = tmp_path / "stiff.toml", importlib.import_module("flexible").rigid_four_bar()
    stiff, rigid = (mbdae.solve(mech, (0, 0.3), method="radau9", step=2e-3) for mech in couplers)
    for name in ("crank", "rocker"):
        x, y = (sol.q[-1][sol.mechanism.joint_names.index(name)] for sol in (stiff, rigid))
        np.testing.assert_allclose(x, y, atol=1e-6)
    assert abs(rigid.q[-1][0] - rigid.q[0][0]) > 1
