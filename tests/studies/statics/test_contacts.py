"""Equilibria that rest on stops and planes, in closed form."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import G, add_body, empty, frame, pendulum, plane

import mbdae
from mbdae import JointSpring, JointTorque, Mechanism, Stop
from mbdae.errors import EquilibriumError

ROUNDING = 1e-12


def test_a_pendulum_rests_on_its_stop():
    """N = m g l sin(q) at the stop; rigid there."""
    found = mbdae.equilibrium(pendulum(), {"a": 1.2})
    assert found.q == pytest.approx([0.3], abs=ROUNDING)
    assert found.contacts == {"a stop": pytest.approx(G * np.sin(0.3), rel=ROUNDING)}
    assert found.stability == "rigid"
    assert "rests on a stop with 2.899" in str(found)
    assert "contact.a stop" in found.to_columns().values
    assert mbdae.equilibrium(pendulum(lower=-0.5), {"a": 1.2}).contacts == {}  # it hangs freely


def test_a_rod_that_leans_on_a_plane():
    """A rod of length L, hinged at height h, leans on the ground: sin(q) = h/L; its weight's moment is N L cos(q)."""
    L, h, m = 1.0, 0.6, 2.0
    model = empty()
    place = pin.SE3(np.eye(3), np.array([0.0, 0.0, h]))
    j = add_body(model, 0, pin.JointModelRY(), "rod", m, (L / 2, 0, 0), (0.1, 0.1, 0.1), place)
    frame(model, j, "tip", L, 0, 0)
    found = mbdae.equilibrium(Mechanism(model, [plane("tip")]), {"rod": 0.1})
    assert found.q == pytest.approx([np.arcsin(h / L)], abs=ROUNDING)
    assert found.contacts["tip"] == pytest.approx(m * G / 2, rel=ROUNDING)
    assert found.reaction("tip").force_world[0] == pytest.approx([0.0, 0.0, m * G / 2], abs=ROUNDING * m * G)


def test_a_press_at_its_stop():
    """A constant force without a spring has no equilibrium but the stop: N = F - m g in a vertical guide."""
    model = empty()
    add_body(model, 0, pin.JointModelPZ(), "ram", 3.0)
    mech = Mechanism(model, forces=[JointTorque(joint="ram", torque=100.0)], stops=[Stop(joint="ram", upper=0.25)])
    found = mbdae.equilibrium(mech)
    assert found.q == pytest.approx([0.25], abs=ROUNDING)
    assert found.contacts["ram stop"] == pytest.approx(100.0 - 3.0 * G, rel=ROUNDING)
    pulled = Mechanism(model, forces=[JointTorque(joint="ram", torque=1.0)], stops=[Stop(joint="ram", upper=0.25)])
    with pytest.raises(EquilibriumError, match=r"^no stable equilibrium found.*'ram'$"):
        mbdae.equilibrium(pulled)


@pytest.mark.parametrize(("lower", "rests"), [(0.45, True), (-1.0, False)])
def test_a_toggle_with_a_stop(lower, rests):
    """2 k (L - l0) z/L + press = N: springs from (+-1, 0) to the pin at height z."""
    toggle = mbdae.load("snap_toggle")
    mech = Mechanism(toggle.model, toggle.closures, toggle.forces, stops=[Stop(joint="pin", lower=lower)])
    found = mbdae.equilibrium(mech, {"pin": 0.5})
    z = float(found.q[0])
    L = np.hypot(1.0, z)
    force = 2 * 1000.0 * (1.118033988749895 - L) * z / L - 100.0
    if rests:
        assert z == pytest.approx(lower, abs=ROUNDING)
        assert found.contacts["pin stop"] == pytest.approx(-force, rel=ROUNDING)
    else:
        assert (found.contacts, z > lower) == ({}, True)
        assert force == pytest.approx(0.0, abs=1e-9)


def test_vibrations_on_a_stop():
    """A double pendulum whose upper rod rests on a stop: only the lower one swings, omega^2 = g/l."""
    model = empty()
    first = add_body(model, 0, pin.JointModelRY(), "upper", 1.0, (0, 0, -1.0))
    place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -1.0]))
    add_body(model, first, pin.JointModelRY(), "lower", 1.0, (0, 0, -0.5), place=place)
    mech = Mechanism(model, forces=[JointSpring(joint="upper", stiffness=1.0)], stops=[Stop(joint="upper", lower=0.2)])
    found = mbdae.modes(mech, {"upper": 0.5})
    assert np.abs(found.eigenvalues.imag) == pytest.approx(np.full(2, np.sqrt(G / 0.5)), rel=1e-10)
