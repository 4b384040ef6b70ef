"""A coupler that is a million times stiffer, and damped, moves as a rigid one."""

import numpy as np
from flexible_bodies import FOUR_BAR

import mbdae

BODY = """[[body]]
name = "coupler"
parent = "crank"
xyz = [0.3, 0.0, 0.0]
mass = 0.45216
com = [0.45, 0.0, 0.0]
inertia = [0.0, 0.0305208, 0.0305208, 0.0, 0.0, 0.0]
[[frame]]
name = "coupler.C"
parent = "coupler"
xyz = [0.9, 0.0, 0.0]
"""


def test_the_rigid_limit(tmp_path):
    text = FOUR_BAR.read_text()
    (tmp_path / "stiff.toml").write_text(text.replace("2.1e11", "2.1e19").replace("ends =", "damping = 1.0\nends ="))
    start = "[start]\nq = { crank = 1.0471975511965976 }\nv = { crank = 8.0 }\nguess = {" + text.split("guess = {")[1]
    rows = text[text.index("[[closure]]") : text.index("[start]")]
    (tmp_path / "rigid.toml").write_text(text[: text.index("[[flexible]]")] + BODY + rows + start)
    stiff, rigid = (
        mbdae.solve(tmp_path / f"{name}.toml", (0, 0.3), method="radau9", step=2e-3) for name in ("stiff", "rigid")
    )
    for name in ("crank", "rocker"):
        x, y = (sol.q[-1][sol.mechanism.joint_names.index(name)] for sol in (stiff, rigid))
        np.testing.assert_allclose(x, y, atol=1e-6)
    assert abs(rigid.q[-1][0] - rigid.q[0][0]) > 1
