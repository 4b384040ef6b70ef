"""Motions whose joints change places at the end of a period: half a swing, two pendulums in turn."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import G, add_body, empty
from scipy.special import ellipk

import mbdae
from mbdae import JointTorque, Mechanism
from mbdae.errors import InputError, UnknownNameError


def pendulums():
    """Two pendulums of 1 m side by side."""
    model = empty()
    for name in ("left", "right"):
        add_body(model, 0, pin.JointModelRY(), name, 1.0, (0, 0, -1.0))
    return Mechanism(model)


def test_half_a_swing_of_a_pendulum():
    """T = 2 K(sin(a/2)) sqrt(L/g), half a period."""
    model = empty()
    add_body(model, 0, pin.JointModelRY(), "rod", 1.0, (0, 0, -1.0))
    found = mbdae.periodic(Mechanism(model), 1.1, q=[0.8], v=[0.3], exchange={"rod": "-rod"})
    swing = np.arccos(np.cos(found.q[0]) - found.v[0] ** 2 / (2 * G))
    assert pytest.approx(2 * ellipk(np.sin(swing / 2) ** 2) / np.sqrt(G), rel=1e-10) == found.T
    assert found.run.q[-1] == pytest.approx(-found.q, abs=1e-9)
    assert {x.name for x in found.neutral} == {"time", "energy"}


def test_an_exchange_that_is_no_symmetry_is_rejected():
    """Under a constant torque a swing begins and ends at the bottom, but the other half differs."""
    model = empty()
    add_body(model, 0, pin.JointModelRY(), "rod", 1.0, (0, 0, -1.0))
    mech = Mechanism(model, forces=[JointTorque(joint="rod", torque=2.0)])
    with pytest.raises(InputError, match=r"^the exchange of joints is not a symmetry: the motion does not continue"):
        mbdae.periodic(mech, 1.1, q=[0.01], v=[2.0], exchange={"rod": "-rod"})


def test_two_pendulums_that_follow_each_other():
    """Opposite phases of equal amplitude: after half a period each is where the other was."""
    found = mbdae.periodic(
        pendulums(), 1.0, q={"left": 0.5, "right": -0.5}, v={"left": 0.1, "right": -0.1}, exchange={"left": "right"}
    )
    swing = np.arccos(np.cos(found.q[0]) - found.v[0] ** 2 / (2 * G))
    assert pytest.approx(2 * ellipk(np.sin(swing / 2) ** 2) / np.sqrt(G), rel=1e-9) == found.T
    assert found.run.q[-1] == pytest.approx(found.q[::-1], abs=1e-9)


@pytest.mark.parametrize(
    ("exchange", "error", "message"),
    [
        ({"left": "top"}, UnknownNameError, r"'top'.*left, right"),
        ({"left": "right", "right": "right"}, InputError, "'right' is in two pairs"),
        ([("left", "right")], InputError, "exchange is a table, joint = other joint"),
    ],
)
def test_wrong_input_is_one_line(exchange, error, message):
    with pytest.raises(error, match=message):
        mbdae.periodic(pendulums(), 1.0, q=[0.5, -0.5], exchange=exchange)
