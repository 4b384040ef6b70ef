"""Radau IIA from q = v = 0, where nothing acts at the start: the first guess foresees no motion."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import add_body, empty

import mbdae
from mbdae import Closure, Mechanism, methods
from mbdae.mechanism.forces.joint_torque import JointTorque
from mbdae.mechanism.time_functions.time_functions import Harmonic
from mbdae.methods import collocation

INERTIA = (0.5, 0.5, 0.5)


def wheels(amplitude=1.0):
    """Two hinged wheels, one geared to the other by 1 : 2, with a torque sin t on the first."""
    model = empty(0.0)
    for name in "ab":
        add_body(model, 0, pin.JointModelRZ(), name, inertia=INERTIA)
    torque = JointTorque(joint="a", torque=Harmonic(amplitude=amplitude, omega=1.0))
    return Mechanism(model, [Closure.coupling("b", "a", (0.0, 2.0))], forces=[torque])


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{"rtol": 1e-6}, {"step": 0.1}, {"rtol": 1e-6, "formulation": "ggl"}], ids=str)
@pytest.mark.parametrize("method", ["radau3", "radau5", "radau9"])
@pytest.mark.parametrize("start", [0.0, 1e-25])
def test_wheels_start_from_rest_where_no_torque_acts_yet(method, options, start):
    sol = mbdae.solve(wheels(), (start, 2.0), np.zeros(2), np.zeros(2), method=method, **options)
    assert sol.success, sol.message
    q = (2.0 - np.sin(2.0)) / (INERTIA[2] * (1 + 2**2))
    assert sol.q[-1] == pytest.approx([q, 2 * q], rel=1e-3)
    assert sol.stats["newton"] < 12 * (sol.stats["steps"] + sol.stats["rejected"])


def test_the_mixed_iteration_starts_from_rest_too():
    system, y, a, h = wheels().system(), np.zeros(5), methods.method("radau5").arrays, 0.1
    chart = system.chart(0.0, y)
    F, z = chart.start()
    stages = collocation._Stages(system, chart, a, 0.0, h, system.component_magnitudes(y), max_iterations=30)
    found = stages.anderson(np.tile(F, (3, 1)), np.tile(z, (3, 1)))
    assert h * (a.A[-1] @ found.K)[:2] == pytest.approx((h - np.sin(h)) / 2.5 * np.array([1.0, 2.0]), rel=1e-3)
