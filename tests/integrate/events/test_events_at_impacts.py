"""Events in runs with impacts: a ball that falls from 1 m and rebounds with half its speed, in closed form."""

import numpy as np
import pytest

import mbdae

G = 9.81
FALL = np.sqrt(2 / G)  # then flights of FALL, FALL/2, ...
BALL = """
[[body]]
name = "ball"
parent = "world"
joint = "prismatic"
axis = [0, 0, 1]
mass = 0.5

[[stop]]
joint = "ball"
lower = 0.0
restitution = 0.5

[start]
q = { ball = 1.0 }
"""
TIMES = {
    "v.ball": [0, FALL, 1.5 * FALL, 2 * FALL, 2.25 * FALL],
    "v.ball < -1": [1 / G, 1.5 * FALL + 1 / G],
    "q.ball = 0.0": [FALL, 2 * FALL],
}


@pytest.mark.parametrize("control", [{"rtol": 1e-8}, {"step": 0.05}])
def test_both_sides_of_an_impact_are_seen(tmp_path, control):
    (tmp_path / "ball.toml").write_text(BALL)
    mech = mbdae.load(tmp_path / "ball.toml")
    functions = [lambda t, q, v: v[0], lambda t, q, v: q[0]]
    sol = mbdae.solve(mech, (0, 1.1), events=[*TIMES, *functions], **control)
    expected = [*TIMES.values(), TIMES["v.ball"], TIMES["q.ball = 0.0"]]
    for (times, _), exact in zip(sol.events, expected, strict=True):
        assert times == pytest.approx(exact, abs=1e-9)
