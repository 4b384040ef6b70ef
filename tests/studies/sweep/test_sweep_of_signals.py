"""Sweeps over values that may be functions of time in a file."""

import numpy as np
import pytest

import mbdae


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
