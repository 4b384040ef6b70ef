"""Contacts whose rows are small: a heavy block falls on a floor beside a linkage, and neither knows of the other."""

import numpy as np
import pinocchio as pin
import pytest
from linkages import bar, parallelogram_model

import mbdae
from mbdae.integrate.events.singularity import SingularityMonitor
from mbdae.integrate.events.singularity_location import largest_in_new_mode
from mbdae.mechanism.formulations.steps.row_selection import SmallestPivot
from mbdae.mechanism.model_settings import Start

START = {"q": {"crank": 1.0}, "guess": {"coupler": -0.9, "rocker": 1.4}}
SIGNS = np.array([1.0, -1.0, 1.0])  # of the angles of a parallelogram


def fall(model, mass, restitution=0.0):
    """Add a block that falls, and return its stop."""
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "block")
    model.appendBodyToJoint(joint, pin.Inertia(mass, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    return mbdae.Stop(joint="block", lower=0.0, restitution=restitution, name="floor")


def four_bar(mass=None):
    """A four-bar that swings; beside it, a block of this mass falls by 5 cm, in 0.1 s."""
    model = pin.Model()
    bar(model, bar(model, 0, (0, 0), 1.0, "crank"), (1.0, 0), 2.0, "coupler")
    bar(model, 0, (2.0, 0), 1.5, "rocker")
    stops = [fall(model, mass)] if mass else []
    start = Start(q=START["q"] | ({"block": 0.05} if mass else {}), guess=START["guess"])
    pin_closure = mbdae.Closure.point("coupler_tip", "rocker_tip", name="pin")
    return mbdae.Mechanism(model, [pin_closure], stops=stops, start=start)


def parallelogram(mass, fall_time):
    """Bars in the horizontal plane, that turn by -3 rad/s, and a block that lands at a time; and their start."""
    model = parallelogram_model(pin.JointModelRZ)
    mech = mbdae.Mechanism(model, [mbdae.Closure.point("a", "b", name="pin")], stops=[fall(model, mass)])
    return mech, np.array([*1.2 * SIGNS, 9.81 / 2 * fall_time**2]), np.array([*-3.0 * SIGNS, 0.0])


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("condition", ["q.crank = -1", lambda t, q, v: q[0] + 1], ids=["signal", "function"])
@pytest.mark.parametrize("mass", [1e2, 1e4])
def test_a_terminal_event_while_a_heavy_block_rests_ends_a_step(mass, condition):
    """The end of a step satisfies 0 = G v to rounding, dense output only to the tolerance."""
    event = mbdae.Event(condition, terminal=True)
    sol = mbdae.solve(four_bar(mass), (0, 2), events=event, rtol=1e-6)
    alone = mbdae.solve(four_bar(), (0, 2), events=event, rtol=1e-6)
    assert sol.status == alone.status == "event"
    assert sol.modes[-1][1] == (1,)  # the block rests
    assert sol.t[-1] == pytest.approx(alone.t[-1], abs=1e-7)
    rate = sol.mechanism.system().jacobian(sol.q[-1]) @ sol.v[-1]
    assert np.abs(rate).max() < 1e-13 * np.abs(sol.v[-1]).max()


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("mass", [1.0, 1e4])
@pytest.mark.parametrize("fall_time", [0.2, 0.39, 0.3999, 0.41])
def test_singular_configurations_are_crossed_while_it_rests(mass, fall_time):
    mech, q, v = parallelogram(mass, fall_time)
    sol = mbdae.solve(mech, (0, 2), q, v, max_step=0.03)
    assert sol.success, sol.message
    np.testing.assert_allclose([x.t for x in sol.singular], [0.4, 0.4 + np.pi / 3], atol=1e-6)
    np.testing.assert_allclose(sol.q[-1, :3], (1.2 - 3 * 2) * SIGNS, atol=1e-8)


def test_a_singular_configuration_is_near_in_the_next_mode_too():
    """If the smallest pivot remains, its ratio has fallen as much; a small row of a contact has fallen by nothing."""
    before = SmallestPivot(0.01, 0.005)  # a hundredth of the largest ratio
    assert largest_in_new_mode(before, SmallestPivot(0.01, 0.002), 0.5) == pytest.approx(0.2)
    assert largest_in_new_mode(before, SmallestPivot(1e-5, 1e-5), 0.5) == pytest.approx(1e-5, rel=1e-5)
    assert largest_in_new_mode(SmallestPivot(), SmallestPivot(0.1, 0.1), 1.0) == 0.1  # after a free flight
    assert largest_in_new_mode(before, SmallestPivot(), 0.5) == 1.0


def test_both_back_ends_have_the_largest_ratios_of_all_modes(monkeypatch):
    found, results = [], SingularityMonitor.results
    monkeypatch.setattr(SingularityMonitor, "results", lambda self, run: found.append(self) or results(self, run))
    for backend in ("python", "native"):
        assert mbdae.solve("slider_crank_with_stop", (0, 3), rtol=1e-6, backend=backend).success
    python, native = found
    assert python.mode_ratio < 0.5 * python.ratio_by_mode[(0,)]  # the crank rests on the stop in the end
    assert native.ratio_by_mode == pytest.approx(python.ratio_by_mode, rel=1e-3)
    assert native.mode_ratio == pytest.approx(python.mode_ratio, rel=1e-3)
