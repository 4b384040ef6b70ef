"""Rows that are dependent at the start and not afterwards: violations are reported in every formulation.

A bead that slides without friction, x = t, on a straight wire z = 0 and on a curved one, z = c (cos x - 1): at x = 0
both constrain velocities equally, and the rank is one. The curved wire has g = c (1 - cos t), at the speed c sin t.
"""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import add_body, empty
from motions import FAR

import mbdae
from mbdae import Closure, Mechanism
from mbdae.mechanism.time_functions.time_functions import Harmonic


def bead(c):
    model = empty(0.0)
    add_body(model, add_body(model, 0, pin.JointModelPX(), "x", 1.0), pin.JointModelPZ(), "z", 1.0)
    straight, bent = (Harmonic(amplitude=a, omega=1.0, phase=np.pi / 2, offset=-a) for a in (0.0, c))
    return Mechanism(model, [Closure.law("z", "x", straight, "straight"), Closure.law("z", "x", bent, "bent")])


def run(c, end=1, **options):
    return mbdae.solve(bead(c), (0, end), np.zeros(2), np.array([1.0, 0.0]), **options)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("method", ["pherk5", "radau5"])
@pytest.mark.parametrize("c", [1e-5, 1e-3])
def test_a_velocity_violation_of_1e_6_makes_a_run_doubtful(method, c):
    sol = run(c, method=method, project=False)
    assert sol.status == "doubtful"
    assert f"|G v| reached {c * np.sin(1) / 2:.2g} of the largest speeds ('bent' is violated by" in sol.message
    assert sol.q[-1] == pytest.approx([1.0, 0.0], abs=1e-9)


STEPS = [{"method": "pherk5"}, {"method": "radau5"}, {"method": "herk3"}, {"method": "herk3", "step": 0.01}]


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [*STEPS, {"method": "pherk5", "rtol": 1e-3}], ids=str)
@pytest.mark.parametrize("c", [1e-5, 1e-3, 1e-2])
def test_a_run_ends_where_projections_take_its_steps_back(c, options):
    """With both wires kept the bead can only stay at x = 0, at whatever speed it came."""
    sol = run(c, FAR, project=True, max_steps=500, **options)
    assert sol.status in ("rank", "newton")
    assert "closure 'bent' " in sol.message
    assert sol.q[-1, 0] == pytest.approx(sol.t[-1], abs=1e-3)


@pytest.mark.usefixtures("back_end")
def test_a_smaller_violation_does_not():
    assert run(1e-6, project=False).success


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{}, {"method": "radau5"}, {"method": "herk3", "step": 0.01}], ids=str)
@pytest.mark.parametrize("c", [1e-5, 1e-3])
def test_ggl_ends_where_a_row_not_in_use_opens(options, c):
    """The multiplier mu enforces the straight wire alone; a tenth of a micrometre is allowed at the other one."""
    sol = run(c, FAR, formulation="ggl", **options)
    assert sol.status == "rank"
    assert "closure 'bent' is violated by" in sol.message
    assert sol.t[-1] <= np.arccos(1 - 1e-7 / c) * (1 + 1e-9)
    assert mbdae.drift(sol).g_max <= 1.001e-7


def test_index_3_violates_all_velocity_rows():
    sol = mbdae.solve(mbdae.load("four_bar"), (0, 0.5), method="hht_i3", step=1e-3)
    assert sol.status == "doubtful"
    assert sol.message.startswith("rows are not satisfied: |G v| reached")
