"""Craig and Bampton's reduction against the whole body: a truss of springs."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csr_array

import mbdae
from mbdae.errors import InputError, UnknownNameError


@pytest.fixture(scope="module")
def truss():
    """Points, masses and stiffness of springs between all of them."""
    rng = np.random.default_rng(3)
    r, m = rng.normal(size=(14, 3)), rng.uniform(1, 2, 14)
    K = np.zeros((42, 42))
    for i in range(14):
        for j in range(i):
            d = (r[i] - r[j]) / np.linalg.norm(r[i] - r[j])
            row = np.zeros(42)
            row[3 * i : 3 * i + 3], row[3 * j : 3 * j + 3] = d, -d
            K += rng.uniform(10, 20) * np.outer(row, row)
    return r, m, K


def test_all_modes_are_those_of_the_body(truss):
    r, m, K = truss
    body = mbdae.modal_body(r, m, csr_array(K), interface={str(i): [i] for i in range(14)}, modes=0)
    squares = eigh(K, np.diag(np.repeat(m, 3)), eigvals_only=True)
    np.testing.assert_allclose(body.frequencies, np.sqrt(squares[6:]), rtol=1e-9)
    assert np.abs(body.C).max() < 1e-10  # mean axes: modes of a free body move neither its centre ...
    assert np.abs(body.H0).max() < 1e-10  # ... nor its angular momentum


def test_static_deflections_at_interfaces_are_exact(truss):
    """One normal mode: the deflection under a load at an interface is that of the whole body, held at another."""
    r, m, K = truss
    body = mbdae.modal_body(r, m, K, interface={"held": [2, 3, 4], "tip": [7]}, modes=1, clamped="held")
    free = [i for i in range(42) if i // 3 not in (2, 3, 4)]
    load = np.zeros(42)
    load[21:24] = 1.0, -2.0, 0.5
    whole = np.zeros(42)
    whole[free] = np.linalg.solve(K[np.ix_(free, free)], load[free])
    tip = body.nodes["tip"]
    np.testing.assert_allclose(tip.Phi @ (tip.Phi.T @ load[21:24] / body.stiffness), whole[21:24], rtol=1e-10)
    assert np.abs(body.nodes["held"].Phi).max() < 1e-12


def test_the_sag_under_the_weight_is_exact_with_its_mode(truss):
    r, m, K = truss
    held = {"interface": {"held": [2, 3, 4], "tip": [7]}, "clamped": "held"}
    body = mbdae.modal_body(r, m, K, modes=2, loads=["gravity z"], **held)
    free = [i for i in range(42) if i // 3 not in (2, 3, 4)]
    whole = np.zeros(42)
    whole[free] = np.linalg.solve(K[np.ix_(free, free)], np.outer(m, [0, 0, 1]).ravel()[free])
    np.testing.assert_allclose(body.nodes["tip"].Phi @ (body.C[2] / body.stiffness), whole[21:24], rtol=1e-9)
    assert body.modes == 3 + 1 + 2
    with pytest.raises(UnknownNameError, match="unknown load 'g'; valid: gravity x, gravity y, gravity z"):
        mbdae.modal_body(r, m, K, modes=2, loads=["g"], **held)


def test_rigid_interfaces_turn(truss):
    r, m, K = truss
    body = mbdae.modal_body(r, m, K, interface={"plate": [0, 1, 2, 5], "B": [9]}, modes=2)
    plate = body.nodes["plate"]
    np.testing.assert_allclose(plate.r, r[[0, 1, 2, 5]].mean(axis=0))
    assert np.abs(plate.Psi).max() > 1e-3
    assert body.modes == 6 + 3 + 2 - 6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"masses": -np.ones(14)}, "masses must be positive, got -1 kg of point 0"),
        ({"K": np.eye(41)}, r"14 points need shapes \(14, 3\), .* K \(42, 42\); got .*, K \(41, 41\)"),
        ({"K": np.tri(42)}, "K is not symmetric and finite"),
        ({"K": np.eye(42)}, "0 motions without elastic force, expected 6: is K that of this body"),
        ({"interface": {"A": [0, 77]}}, "interfaces must be different points 0 to 13, got .0, 77"),
        ({"interface": {"A": "LEFT"}}, "interfaces must be different points 0 to 13, got .'LEFT'"),
        ({"interface": {"A": []}}, "an interface needs at least one point"),
        ({"interface": {"A": [0], "pin": [3, 4]}}, "modes cannot rotate interface 'pin', whose 2 points are on a line"),
        ({"clamped": "A"}, "modes cannot rotate interface 'A', whose 1 points are on a line; use three points"),
        (
            {"interface": {}},
            "the 0 points of all interfaces do not constrain the body: add a node of a point that is not on",
        ),
        ({"interface": {"A": [0], "B": [1]}}, "the 2 points of all interfaces do not constrain the body"),
        ({"modes": 99}, "33 displacements between the interfaces, got modes = 99"),
        ({"modes": 32, "loads": ["gravity x"]}, "33 displacements between the interfaces, got modes = 32 and 1 loads"),
        ({"modes": 2.5}, "modal_body: modes: expected a whole number from 0, got 2.5"),
        ({"loads": "gravity y"}, r"loads must be a list, loads = .'gravity y'."),
        ({"loads": ["gravity y", "gravity y"]}, "load 'gravity y' is given twice"),
        (
            {"damping": -0.1},
            "damping needs one ratio that is not negative, or 5, of all modes with those of loads; got",
        ),
        ({"damping": (0.1, 0.2), "loads": ["gravity y"]}, r"not negative, or 6, .*; got \(0.1, 0.2\)"),
        (
            {"points": np.full((14, 3), np.nan)},
            r"points: expected finite numbers of shape \(14, 3\), got .*, not all finite",
        ),
    ],
)
def test_bad_data_is_rejected_in_one_line(truss, change, message):
    given = dict(zip(("points", "masses", "K"), truss, strict=True))
    given |= {"interface": {"A": [0], "B": [1], "C": [2]}, "modes": 2} | change
    with pytest.raises(InputError, match=message):
        mbdae.modal_body(**given)
    with pytest.raises(UnknownNameError, match="unknown interface 'B'; valid: A"):
        mbdae.modal_body(*truss, interface={"A": [0]}, modes=1, clamped="B")
