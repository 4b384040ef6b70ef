"""Inertias that violate the triangle inequality of principal moments are named by `mbdae info`."""

import pinocchio as pin
import pytest
from bouncing import add_body, empty

import mbdae
from mbdae import Mechanism

BODIES = {"plate": (1, 1, 2), "rod": (0, 1, 1), "disc of a plane": (0, 0, 1), "rounded": (1, 1, 2.001)}


@pytest.mark.parametrize("moments", [(1, 1, 3), (0.2, 0.1, 0.6)])
def test_bodies_with_impossible_inertias_are_named(moments):
    model = empty()
    for name, inertia in (BODIES | {"wrong": moments}).items():
        add_body(model, 0, pin.JointModelRZ(), name, inertia=inertia)
    card = mbdae.info(Mechanism(model))
    assert card.impossible == ("wrong",)
    assert "inertia   of wrong: no rigid body has it" in str(card)
    assert "wrong" in card.facts()["inertia"]


def test_a_mechanism_of_possible_bodies_has_no_remark():
    assert "inertia" not in mbdae.info("pendulum").facts()
