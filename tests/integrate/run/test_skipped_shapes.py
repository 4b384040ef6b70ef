"""Steps that grow while nothing happens and then skip a pulse of a table, or a lobe of a cam, are reported."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import add_body, empty

import mbdae
from mbdae import Closure, Driver, JointTorque, Mechanism
from mbdae.mechanism.closures.motion_laws import LawTable
from mbdae.mechanism.time_functions.time_functions import TimeTable

PULSE = [(0, 0), (1, 0), (2, 0), (2.05, 100), (2.1, 0), (3, 0), (4, 0)]
ROUND = np.linspace(0, 1, 181)


def pushed():
    """A slide that a pulse pushes: the integral of the monotone curve is that of its triangle, 5 N s."""
    model = empty(0.0)
    add_body(model, 0, pin.JointModelPX(), "slide", 1.0)
    return Mechanism(model, [], [JointTorque(joint="slide", torque=TimeTable(points=PULSE, interpolation="monotone"))])


def cam():
    """A cam that turns once per second and lifts a tappet by 1 m (1 - ((x - 1/2)/0.08)^2)^5, where that is positive."""
    model = empty(0.0)
    for name in ("turn", "tappet"):
        add_body(model, 0, pin.JointModelPX(), name, 1.0)
    lift = np.clip(1 - ((ROUND - 0.5) / 0.08) ** 2, 0, None) ** 5
    law = LawTable(points=list(zip(ROUND, lift, strict=True)), periodic=True)
    return Mechanism(model, [Closure.law("tappet", "turn", law, "cam")], drivers=[Driver.at_speed("turn", 1.0)])


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize(("make", "name", "end"), [(pushed, "joint_torque 1", 4.0), (cam, "cam", 1.0)])
def test_a_step_that_skips_a_shape_makes_a_run_doubtful(make, name, end):
    mech = make()
    start = mech.assemble()
    sol = mbdae.solve(mech, (0, end), *start, method="herk3", rtol=1e-6)
    assert (sol.status, np.abs(np.diff(sol.t)).max() > 0.5) == ("doubtful", True)
    assert f"skipped points of '{name}': take a smaller max_step" in sol.message
    assert mbdae.solve(mech, (0, end), *start, method="herk3", rtol=1e-3, max_step=0.05).success


def test_ensembles_leave_tables_to_runs_that_are_checked():
    ends = mbdae.ensemble(pushed(), np.zeros((2, 1)), np.zeros((2, 1)), t_span=(0, 4), method="herk3")
    assert list(ends.status) == ["doubtful"] * 2
