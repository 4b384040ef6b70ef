"""The solution of a simulator: values on both sides of jumps of inputs, derivatives, and meshes of files."""

import numpy as np
import pytest

import mbdae
from mbdae import Input, JointTorque

LEVELS = (1.0, -2.0, 3.0)  # N m, for 0.2 s each
ARM = """
gravity = [0, 0, 0]
[[body]]
name = "arm"
parent = "world"
mass = 1.0
com = [0.5, 0, 0]
inertia = [0, 0, 0.02, 0, 0, 0]
[[force]]
kind = "joint_torque"
joint = "arm"
torque = { kind = "input", name = "motor" }
"""


@pytest.mark.parametrize("saved", [False, True])
def test_nodes_have_the_values_of_their_side_of_a_jump(tmp_path, saved):
    """I a = u; dq/dm = -q (dI/dm)/I for steps that cross no jump."""
    (tmp_path / "arm.toml").write_text(ARM)
    simulator = mbdae.Simulator(tmp_path / "arm.toml", step=0.1)
    for level in LEVELS:
        simulator["motor"] = level
        simulator.advance(0.2)
        if saved:
            simulator.save()
    sol = simulator.solution()
    assert sol.signals("a")["a.arm"] * 0.27 == pytest.approx(np.repeat(LEVELS, (4, 3, 3)))
    assert np.trapezoid(sol.signals("a")["a.arm"], sol.t) == pytest.approx(sol.v[-1, 0])
    derivative = mbdae.sensitivity(sol, ["body.arm.mass"]).q[-1, :, 0]
    assert derivative == pytest.approx(-sol.q[-1] * 0.25 / 0.27, rel=1e-12)


def test_a_saved_solution_has_the_meshes_of_its_file(tmp_path):
    mech = mbdae.load("slider_crank", forces=[JointTorque(joint="crank", torque=Input(name="motor"))])
    simulator = mbdae.Simulator(mech, step=1e-3)
    simulator.advance(1e-3)
    simulator.solution().save(tmp_path / "run.npz")
    again = mbdae.Solution.load(tmp_path / "run.npz").mechanism
    assert again.visuals.ngeoms == mech.visuals.ngeoms
    assert (again.left_out, again.forces[-1].torque.pieces) == (mech.left_out, ((0.0, 0.0, 0.0),))
