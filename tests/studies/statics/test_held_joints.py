"""Joints that are held at an equilibrium of closed loops keep their values, however far the others move."""

import numpy as np
import pytest

import mbdae

HELD = {"piston_1": 0.32, "piston_2": 0.34}
STEP = 1e-3  # m


def test_held_joints_stay_at_their_start():
    """Their force is the derivative of the potential energy of the equilibrium (envelope theorem)."""
    platform, pistons = mbdae.load("stewart_platform"), [f"piston_{k}" for k in range(1, 7)]
    springs = mbdae.JointSpring(joint=pistons, stiffness=500.0, rest=0.3)
    mech = mbdae.Mechanism(platform.model, platform.closures, [springs], start=platform.start_values)
    energy, force = [], []
    for shift in (-STEP, 0.0, STEP):
        values = HELD | {"piston_1": 0.32 + shift}
        found = mbdae.equilibrium(mech, values, hold=HELD, find="any")
        assert [found.coordinates[f"q.{name}"] for name in HELD] == pytest.approx([*values.values()], abs=1e-14)
        energy.append(mech.at(0.0, found.q, found.v).energies[1])
        force.append(found.holding["piston_1"])
    assert force[1] == pytest.approx(np.gradient(energy, STEP)[1], rel=1e-5)


def test_holding_forces_that_are_not_unique_say_so():
    """Crank and slider of one degree of freedom share the load in any way."""
    both = mbdae.equilibrium("slider_crank", hold=["crank", "slider"])
    assert both.indeterminate == ("crank", "slider")
    assert "\n  slider is held by 0.0792" in str(both)
    assert str(both).count(" N, not unique (minimum norm)\n") == 1
    assert mbdae.equilibrium("slider_crank", hold="crank").indeterminate == ()
