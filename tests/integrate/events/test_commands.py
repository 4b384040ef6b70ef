"""Commanded clutches and drivers whose speed steps: jumps at known times, against conserved momentum."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import add_body, empty
from shared import shared_model

import mbdae
from mbdae import Clutch, Driver, JointDamping, JointTorque, Mechanism
from mbdae.errors import InputError
from mbdae.mechanism.time_functions.time_functions import Steps
from mbdae.solution.signals import units

pytestmark = pytest.mark.usefixtures("back_end")
J = (0.2, 0.5)  # kg m^2
RATIO = 2.0
HOW = [{"rtol": 1e-9}, {"step": 0.07}]


def flywheels(forces=(), **more):
    """Two flywheels about z, ``input`` and ``output``."""
    model = empty()
    for name, inertia in zip(("input", "output"), J, strict=True):
        add_body(model, 0, pin.JointModelRUBZ(), name, 1.0, inertia=(inertia,) * 3)
    return Mechanism(model, forces=forces, **more)


def clutch(*points, **more):
    return Clutch(joints=("output", "input"), engaged=Steps(points=points), **more)


@pytest.mark.parametrize("how", HOW, ids=str)
def test_two_flywheels_are_coupled_and_released(how):
    """Engaged at 1 s: momentum is conserved; free from 2 s on under a torque on the input; engaged again at 3 s."""
    T = 0.3
    torque = JointTorque(joint="input", torque=Steps(points=((0.0, 0.0), (2.0, T))))
    mech = flywheels([torque], clutches=[clutch((0.0, 0), (1.0, 1), (2.0, 0), (3.0, 1), name="coupling")])
    sol = mbdae.solve(mech, (0, 4), np.array([1.0, 0, 1.0, 0]), np.array([10.0, 3.0]), **how)
    assert sol.success
    assert [m for _, m in sol.modes] == [(0,), (1,), (0,), (1,)]
    assert [sol.t[i] for i, _ in sol.modes[1:]] == [1.0, 2.0, 3.0]
    first, second = sol.impacts
    common = (J[0] * 10 + J[1] * 3) / sum(J)
    p = J[1] * (common - 3)
    assert (first.t, first.where) == (1.0, ("coupling",))
    assert first.impulse == pytest.approx([p], rel=1e-13)
    assert first.loss == pytest.approx(J[0] * J[1] / sum(J) * 7**2 / 2, rel=1e-12)
    assert sol(1.5).v == pytest.approx([common, common], rel=1e-13)
    faster = T / J[0]  # in a second
    assert second.loss == pytest.approx(J[0] * J[1] / sum(J) * faster**2 / 2, rel=1e-9)
    impulses = sol.signals("impulse.coupling")["impulse.coupling"]
    assert [(sol.t[i], impulses[i]) for i in np.flatnonzero(impulses)] == [(x.t, *x.impulse) for x in sol.impacts]
    assert units(mech)["impulse.coupling"] == "N m s"
    end = common + 2 * T / sum(J)
    assert sol.v[-1] == pytest.approx([end, end], rel=1e-10)
    assert mbdae.drift(sol).energy_relative < 1e-12


def test_a_clutch_with_a_ratio_and_loads_on_both_sides():
    """v_o = r v_i: (J_i + r^2 J_o) v_i' = -(c_i + r^2 c_o) v_i after v_i = (J_i v_i + r J_o v_o)/(J_i + r^2 J_o)."""
    c = (0.1, 0.3)
    damping = [JointDamping(joint=n, damping=x) for n, x in zip(("input", "output"), c, strict=True)]
    mech = flywheels(damping, clutches=[clutch((0.0, 1), ratio=RATIO)])
    sol = mbdae.solve(mech, (0, 1), np.array([1.0, 0, 1.0, 0]), np.array([10.0, 3.0]), rtol=1e-11)
    whole = J[0] + RATIO**2 * J[1]
    v = (J[0] * 10 + RATIO * J[1] * 3) / whole * np.exp(-(c[0] + RATIO**2 * c[1]) / whole)
    assert sol.v[-1] == pytest.approx([v, RATIO * v], rel=1e-10)
    assert [x.t for x in sol.impacts] == [0.0]


@pytest.mark.parametrize("how", HOW, ids=str)
def test_a_speed_step_of_a_driver_is_an_impact(how):
    """It accelerates input and output: its impulse is J (w_2 - w_1), its work J (w_2^2 - w_1^2)/2."""
    drive = Driver(joint="input", speed=Steps(points=((0.0, 6.0), (2.0, 9.0), (3.0, -1.0))), name="drive")
    mech = flywheels(drivers=[drive], clutches=[clutch((0.0, 1))])
    sol = mbdae.solve(mech, (0, 4), **how)
    assert sol.success
    start, *steps = sol.impacts
    assert (start.t, start.where) == (0.0, ("output-input clutch",))  # the output was at rest
    assert [(x.t, x.where) for x in steps] == [(2.0, ("drive",)), (3.0, ("drive",))]
    assert [x.impulse[0] for x in steps] == pytest.approx([sum(J) * 3, -sum(J) * 10], rel=1e-13)
    assert [x.loss for x in steps] == pytest.approx([-sum(J) * (81 - 36) / 2, sum(J) * (81 - 1) / 2], rel=1e-13)
    assert sol.v[-1] == pytest.approx([-1.0, -1.0], abs=1e-13)
    impulses = sol.signals("impulse.drive")["impulse.drive"]
    assert impulses[np.flatnonzero(impulses)] == pytest.approx([sum(J) * 3, -sum(J) * 10], rel=1e-13)
    turned = 12.0 + 9.0 - 1.0
    assert sol.signals("q.output")["q.output"][-1] == pytest.approx(turned, abs=1e-9)
    assert mbdae.drift(sol).energy_relative < 1e-12


@pytest.mark.parametrize("how", HOW, ids=str)
def test_a_loop_stays_closed_when_its_driver_steps(how):
    drive = Driver(joint="crank", speed=Steps(points=((0.0, 2.0), (0.5, 5.0))))
    mech = mbdae.load("four_bar", drivers=[drive])
    sol = mbdae.solve(mech, (0, 1), **how)
    assert sol.success
    s = sol.signals()
    assert s["Gv"].max() < 1e-11
    assert s["v.crank"][-1] == pytest.approx(5.0, abs=1e-12)
    before, behind = (sol.v[k] for k in np.flatnonzero(np.abs(sol.t - 0.5) < 1e-12)[[0, -1]])
    np.testing.assert_allclose(behind, 2.5 * before, rtol=1e-9)  # one degree of freedom: all speeds step together
    q, kinetic = sol(0.5).q, np.array([mech.system().energy(sol(0.5).q, v)[0] for v in (before, behind)])
    assert sol.impacts[0].loss == pytest.approx(kinetic[0] - kinetic[1], rel=1e-9), q


def test_runs_with_commands_are_saved_and_read_again(tmp_path):
    mech = flywheels(clutches=[clutch((0.0, 0), (0.5, 1))])
    sol = mbdae.solve(mech, (0, 1), np.array([1.0, 0, 1.0, 0]), np.array([10.0, 3.0]))
    sol.save(tmp_path / "run.npz")
    again = mbdae.Solution.load(tmp_path / "run.npz")
    assert again.mechanism.clutches == mech.clutches
    assert (again.modes, again.impacts) == (sol.modes, sol.impacts)


def test_wrong_commands_are_rejected():
    with pytest.raises(InputError, match="a clutch with engaged locks both ways"):
        clutch((0.0, 1), direction=-1)
    with pytest.raises(InputError, match="a clutch with engaged locks both ways"):
        clutch((0.0, 1), pitch=0.1)
    with pytest.raises(InputError, match="'output-input clutch': unilateral constraints and switches need formulation"):
        mbdae.solve(flywheels(clutches=[clutch((0.0, 1))]), (0, 1), formulation="ggl")


def test_a_clutch_may_close_at_the_end_of_the_span():
    """The last step is one rounding long: the guard is located once."""
    m = shared_model("slider_crank")
    lock = Clutch(name="lock", joint="crank", engaged=Steps(points=((0.0, 0.0), (0.02, 1.0))))
    mech = Mechanism(m.model, closures=m.closures, clutches=[lock])
    sol = mbdae.solve(mech, (0, 0.02), *m.start, method="herk3", rtol=1e-3)
    assert sol.success
    assert sol.t[-1] == 0.02
