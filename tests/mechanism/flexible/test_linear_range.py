"""Warnings of deflections beyond the range of linear modes: between nodes, in runs and in statics."""

import flexible_bodies
import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae.mechanism.flexible import ModalBody
from mbdae.mechanism.flexible.modal_data import modal_body_from_data, modal_data
from mbdae.mechanism.flexible.points import Node

LENGTH, YOUNG, DENSITY, AREA, MOMENT = 1.0, 7e10, 2700.0, 1e-4, 8e-11
SAG = {"clamped": 8, "clamped-clamped": 384}  # rho A g L^4/(EI) over the largest deflection


def sagging(deflection, ends, nodes=None):
    """A beam that is held at the world, with the gravity under which it sags so far."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, -1.0, 0.0]) * SAG[ends] * deflection * YOUNG * MOMENT / (DENSITY * AREA)
    numbers = {"ends": ends, "loads": ["gravity y"], "modes": 3, "stiffening": False, "nodes": nodes}
    mbdae.attach_flexible(model, "bar", mbdae.beam(LENGTH, YOUNG, DENSITY, AREA, MOMENT, **numbers), None)
    return mbdae.Mechanism(model)


@pytest.mark.parametrize("ends", SAG)
@pytest.mark.parametrize("nodes", [None, {"middle": 0.5}])
def test_statics_names_the_largest_deflection(ends, nodes):
    """At rest: of the closed form, whatever the nodes are."""
    found = mbdae.equilibrium(sagging(0.2, ends, nodes))
    assert found.warning.startswith("bar bends beyond the range of linear modes, by 0.2 m of 1 m, ")
    assert f"doubtful: {found.warning}" in str(found)
    assert found.to_dict()["warning"] == found.warning
    assert found.stability == "stable"


def test_small_deflections_are_not_named():
    found = mbdae.equilibrium(sagging(0.05, "clamped-clamped"))
    assert not found.warning
    assert "doubtful" not in str(found)


@pytest.mark.slow
def test_a_load_path_names_the_factor():
    """0.2 m at factor 1: a tenth of the length at 0.5; the rotation is 4/3 of the tip's deflection over the length."""
    path = mbdae.load_path(sagging(0.2, "clamped"), "gravity")
    assert path.warning == path.to_dict()["warning"]
    factor = float(path.warning.split("factor ")[1].split()[0])
    assert factor == pytest.approx(path.factor[path.factor > 0.5][0], rel=1e-5)
    assert path.warning in str(path)


def test_a_run_of_a_beam_between_its_ends():
    """The nodes of a beam that is clamped at both ends do not move."""
    mech = sagging(0.2, "clamped-clamped")
    q = mbdae.equilibrium(mech).q
    sol = mbdae.solve(mech, (0, 1e-4), q, np.zeros(mech.nv), method="pherk5", step=1e-5)
    assert sol.status == "doubtful"
    assert "bar bends beyond the range of linear modes, by 0.2 m of 1 m" in sol.message


def test_points_of_any_body():
    """Size and deflection by a mode are those of all points, with a node that does not move, also from a file."""
    r, m, Phi = flexible_bodies.points()
    still = Node(np.zeros(3), 0 * Phi[0], 0 * Phi[0])
    made = ModalBody.of_points(r, m, Phi, np.ones(Phi.shape[2]), nodes={"A": still})
    body = modal_body_from_data(modal_data(made), "rod")
    for i, q in enumerate(np.eye(Phi.shape[2])):
        assert body.largest_motion(q[None])[0] == pytest.approx(np.linalg.norm(Phi[:, :, i], axis=1).max())
    assert body.size >= np.ptp(r, axis=0).max()
