"""Sweeps over values that may be functions of time in a file, and of signals that some runs have alone."""

import numpy as np
import pytest

import mbdae
from mbdae.errors import InputError


@pytest.mark.parametrize("suffix", ["", ".value"])
def test_a_number_that_may_be_a_function_of_time_is_swept(suffix, tmp_path):
    """J w' = k (U - k w)/R from rest: w = U/k (1 - exp(-k^2 t/(J R)))."""
    J, k, R = 0.02, 0.1, 2.0
    (tmp_path / "motor.toml").write_text(f"""
[[body]]
name = "rotor"
parent = "world"
joint = "continuous"
axis = [0, 0, 1]
mass = 1.0
inertia = [{J}, {J}, {J}, 0, 0, 0]

[[force]]
name = "motor"
kind = "dc_motor"
joint = "rotor"
voltage = 12.0
constant = {k}
resistance = {R}
""")
    name = f"force.motor.voltage{suffix}"
    result = mbdae.sweep(tmp_path / "motor.toml", {name: [6.0, 24.0]}, 3.0, outputs=["final v.rotor"], rtol=1e-9)
    assert result.plot().axes[0].get_ylabel() == "final v.rotor (rad/s)"
    speed = np.array([6.0, 24.0]) / k * (1 - np.exp(-k * k * 3.0 / (J * R)))
    np.testing.assert_allclose(result["final v.rotor"], speed, rtol=1e-7)


def test_outputs_may_exist_in_some_runs_alone():
    outputs = ["max v.crank_2", "q.crank_2", "final energy"]
    result = mbdae.sweep("n_four_bar", {"N": [1, 2]}, 0.01, outputs=outputs, times=2, executor="threads")
    assert list(result["status"]) == ["finished", "finished"]
    assert [np.isfinite(result[name]).all(-1).tolist() for name in outputs[1:2]] == [[False, True]]
    assert [np.isfinite(result[name]).tolist() for name in outputs[::2]] == [[False, True], [True, True]]
    with pytest.raises(InputError, match=r"unknown signal .v\.crank_3."):
        mbdae.sweep("n_four_bar", {"N": [1, 2]}, 0.01, outputs=["max v.crank_3"])
