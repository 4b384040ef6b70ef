"""Rows that depend on others at the start and not behind it: what is not kept is said, whatever the formulation.

A bead that slides without friction, x = t, on a straight wire z = 0 and on a bent one, z = c (cos x - 1): at x = 0 both
say the same of velocities, and the rank is one. The bent wire opens by c (1 - cos t), at the speed c sin t.
"""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import carried, empty

import mbdae
from mbdae import Closure, Mechanism
from mbdae.mechanism.time_functions import Harmonic


def bead(c):
    model = empty(0.0)
    carried(model, carried(model, 0, pin.JointModelPX(), "x", 1.0), pin.JointModelPZ(), "z", 1.0)
    straight, bent = (Harmonic(amplitude=a, omega=1.0, phase=np.pi / 2, offset=-a) for a in (0.0, c))
    return Mechanism(model, [Closure.law("z", "x", straight, "straight"), Closure.law("z", "x", bent, "bent")])


def run(c, **options):
    return mbdae.solve(bead(c), (0, 1), np.zeros(2), np.array([1.0, 0.0]), **options)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("method", ["pherk5", "radau5"])
@pytest.mark.parametrize("c", [1e-5, 1e-3])
def test_a_speed_of_a_millionth_that_a_row_misses_makes_a_run_doubtful(method, c):
    sol = run(c, method=method, project=False)
    assert sol.status == "doubtful"
    assert f"|G v| reached {c * np.sin(1) / 2:.2g} (1 + |v|) ('bent' opens by" in sol.message
    assert sol.q[-1] == pytest.approx([1.0, 0.0], abs=1e-9)


@pytest.mark.usefixtures("back_end")
def test_a_speed_of_less_does_not():
    assert run(1e-6, project=False).success


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{}, {"method": "radau5"}, {"method": "herk3", "step": 0.01}], ids=str)
@pytest.mark.parametrize("c", [1e-5, 1e-3])
def test_the_stabilised_form_ends_where_a_row_that_is_not_in_use_gapes(options, c):
    """The multiplier mu keeps the straight wire alone; a tenth of a micrometre is allowed to the other one."""
    sol = run(c, formulation="ggl", **options)
    assert sol.status == "rank"
    assert "closure 'bent' opens by" in sol.message
    assert sol.t[-1] <= np.arccos(1 - 1e-7 / c) * (1 + 1e-9)
    assert mbdae.drift(sol).g_max <= 1.001e-7
