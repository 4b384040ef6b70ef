"""Beams against closed forms: frequencies, order in the elements, a rigid limit, and bad data."""

import numpy as np
import pytest

import mbdae
from mbdae.errors import InputError, UnknownNameError

UNIT = {"length": 1.0, "young": 1.0, "density": 1.0, "area": 1.0, "second_moment": 1.0}
PINNED, CLAMPED = np.pi**2, (3.5160152685, 22.0344915647)


def test_frequencies_are_those_of_the_closed_forms():
    pinned = mbdae.beam(**UNIT, elements=60, ends="pinned", modes=1)
    cantilever = mbdae.beam(**UNIT, elements=60, modes=2)
    assert pinned.frequencies[0] == pytest.approx(PINNED, rel=1e-8)
    assert cantilever.frequencies[0] == pytest.approx(CLAMPED[0], rel=1e-8)
    assert cantilever.frequencies[1] == pytest.approx(CLAMPED[1], rel=3e-8)  # of the elements: 8e-9 with 80


def test_errors_fall_with_order_four_in_the_elements():
    errors = [mbdae.beam(**UNIT, elements=n, ends="pinned", modes=1).frequencies[0] - PINNED for n in (4, 8)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.1)


def test_a_rod_stretches_and_both_planes_bend():
    rod = mbdae.beam(**UNIT | {"second_moment": np.array([1.0, 4.0])}, elements=40, plane="space", axial=True, modes=4)
    np.testing.assert_allclose(rod.frequencies, [np.pi / 2, CLAMPED[0], 3 * np.pi / 2, 2 * CLAMPED[0]], rtol=1e-3)
    tip, root = rod.nodes["B"], np.sqrt(2)
    np.testing.assert_allclose(np.abs(tip.Phi), [[root, 0, root, 0], [0, 2, 0, 0], [0, 0, 0, 2]], atol=3e-3)
    assert tip.Psi[2, 1] * tip.Phi[1, 1] > 0 > tip.Psi[1, 3] * tip.Phi[2, 3]  # rotations w' about z, -w' about y


@pytest.mark.parametrize("length", [0.9, 1.0, 1.1, 3.0])
def test_modes_rise_next_to_the_left_end(length):
    """The fourth one, also where it is zero at the end of the first element."""
    body = mbdae.beam(**UNIT | {"length": length}, elements=4, ends="pinned", modes=4)
    assert (body.nodes["A"].Psi[2] > 1).all()


def test_the_mass_is_consistent():
    body = mbdae.beam(**UNIT, elements=3, modes=2)
    assert body.mass == pytest.approx(1.0, rel=1e-14)
    np.testing.assert_allclose(body.Mq, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(np.diagonal(body.I0), [0, 1 / 3, 1 / 3], rtol=1e-13)


SAGS = {"clamped": ("B", 1 / 8), "pinned": ("m", 5 / 384)}  # rho A g L^4/(EI)


@pytest.mark.parametrize("ends", SAGS)
@pytest.mark.parametrize("modes", [1, 4])
def test_sag_under_the_weight_is_exact_with_its_mode(ends, modes):
    node, exact = SAGS[ends]
    body = mbdae.beam(**UNIT, ends=ends, modes=modes, loads=["gravity y"], nodes={"m": 0.5, "B": 1.0})
    assert body.nodes[node].Phi[1] @ (body.C[1] / body.stiffness) == pytest.approx(exact, rel=1e-9)
    without = mbdae.beam(**UNIT, ends=ends, modes=modes, nodes={"m": 0.5, "B": 1.0})
    published = {("clamped", 1): 1e-2, ("clamped", 4): 4e-5, ("pinned", 1): 4e-3, ("pinned", 4): 3e-4}[ends, modes]
    error = without.nodes[node].Phi[1] @ (without.C[1] / without.stiffness) / exact - 1
    assert abs(error) == pytest.approx(published, rel=0.5)


def test_deflections_by_forces_and_moments_on_nodes_are_exact():
    """Of a cantilever by a tip force P L^3/(3 EI), rotation P L^2/(2 EI), by a tip moment M L^2/(2 EI), M L/(EI)."""
    thick = UNIT | {"modes": 1, "plane": "space", "axial": True, "fibre": (0.1, 0.2)}
    loads = ["force x B", "force y B", "moment z B", "moment y B"]
    body = mbdae.beam(**thick, loads=loads)
    A, B = body.nodes["A"], body.nodes["B"]
    assert body.modes == 5
    flexibility = [x / body.stiffness @ y for x, y in ((B.Phi, B.Phi.T), (B.Psi, B.Phi.T), (B.Psi, B.Psi.T))]
    np.testing.assert_allclose(flexibility[0][:2, :2], np.diag([1, 1 / 3]), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(flexibility[1][2], [0, 1 / 2, 0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(flexibility[2], np.diag([0, 1, 1]), rtol=1e-9, atol=1e-9)
    strains = A.strain @ (B.Psi.T / body.stiffness[:, None])
    np.testing.assert_allclose(strains, [0, 0.2, -0.1], rtol=1e-9, atol=1e-9)  # -M y/(EI) about z, M z/(EI) about y
    plain = mbdae.beam(**UNIT | {"fibre": (0.1, 0.0)}, modes=6)
    error = plain.nodes["A"].strain @ (plain.nodes["B"].Psi[2] / plain.stiffness) / -0.1 - 1
    assert abs(error) > 0.05


def test_shear_and_rotary_inertia():
    """Of a pinned beam: rho I w^4 - w^2 (EI k^2 + rho I G k^2/A + G) + G EI k^4 = 0, k = pi/L, G the stiffness."""
    moment, shear, k2 = 0.01, 0.3, np.pi**2
    thick = {**UNIT, "second_moment": moment, "shear_stiffness": shear, "ends": "pinned", "modes": 1}
    a, b, c = moment, moment * k2 + moment * shear * k2 + shear, shear * moment * k2**2
    exact = np.sqrt((b - np.sqrt(b * b - 4 * a * c)) / (2 * a))
    errors = [mbdae.beam(**thick, elements=n).frequencies[0] / exact - 1 for n in (15, 30, 60)]
    assert errors[2] == pytest.approx(0, abs=3e-5)
    np.testing.assert_allclose(np.log2([errors[0] / errors[1], errors[1] / errors[2]]), 2, atol=0.02)
    assert np.sqrt(moment) * k2 > 1.15 * exact  # without shear
    body = mbdae.beam(**thick)
    np.testing.assert_allclose(np.diagonal(body.I0), [2 * moment, 1 / 3 + moment, 1 / 3 + moment], rtol=1e-12)


@pytest.mark.slow
def test_deflection_by_shear_is_exact():
    """Tip load P on a cantilever: P L^3/(3 EI) + P L/k, and strain P L c/(EI) of a fibre at the clamped end."""
    nodes = {"A": 0.0, "B": 1.0}
    body = mbdae.beam(**UNIT, elements=24, modes=48, shear_stiffness=2.0, fibre=(0.1, 0.0), nodes=nodes)
    x = body.nodes["B"].Phi[1] / body.stiffness
    assert body.nodes["B"].Phi[1] @ x == pytest.approx(1 / 3 + 1 / 2, rel=1e-9)
    assert body.nodes["A"].strain @ x == pytest.approx(-0.1, rel=1e-9)


def test_strain_needs_a_fibre_or_stretching():
    """Without either there are no columns; a pull P stretches an axial beam by P/(EA), EA = 1, at each node."""
    assert mbdae.beam(**UNIT).nodes["B"].strain is None
    bar = mbdae.beam(**UNIT, elements=4, modes=12, axial=True)
    x = bar.nodes["B"].Phi[0] / bar.stiffness
    assert bar.nodes["A"].strain @ x == pytest.approx(1.0, rel=1e-9)


def test_signals_of_a_cantilever_at_rest(tmp_path):
    """Under its weight: sag rho A g L^4/(8 EI), stress E y w'' = rho A g L^2 y/(2 I) at the clamped end."""
    (tmp_path / "beam.toml").write_text("""
gravity = [0.0, -9.81, 0.0]
[[flexible]]
name = "beam"
parent = "world"
joint = "revolute"
length = 2.0
young = 2.1e11
density = 7850.0
area = 1e-4
second_moment = 8e-10
elements = 16
modes = 4
stiffening = false
loads = ["gravity y"]
fibre = [5e-3, 0.0]
""")
    mech = mbdae.load(tmp_path / "beam.toml")
    q = mbdae.equilibrium(mech, hold="beam").q
    sol = mbdae.solve(mech, (0, 1e-6), q, method="pherk5", step=1e-6)
    load, signals = 7850.0 * 1e-4 * 9.81, sol.signals()
    assert signals["displacement.beam.B.y"][0] == pytest.approx(-load * 2**4 / (8 * 2.1e11 * 8e-10), rel=1e-9)
    assert signals["stress.beam.A"][0] == pytest.approx(load * 2**2 * 5e-3 / (2 * 8e-10), rel=3e-3)
    assert signals["strain.beam.A"][0] == pytest.approx(signals["stress.beam.A"][0] / 2.1e11, rel=1e-12)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"length": -1.0}, InputError, "beam: length needs a positive number, got -1.0"),
        ({"second_moment": (1.0, 0.0)}, InputError, "second_moment along z needs a positive number"),
        ({"modes": 20}, InputError, "8 elements have 16 modes with these ends, got modes = 20"),
        ({"nodes": {"x": 0.3}}, InputError, "node 'x' at 0.3 m is not at an end of an element: 0, 0.125, 0.25"),
        ({"ends": "hinged"}, UnknownNameError, "unknown ends 'hinged' .*; valid: clamped, pinned"),
        ({"loads": ["gravity z"]}, UnknownNameError, "unknown load 'gravity z' .*; valid: gravity y"),
        ({"shear_stiffness": -1.0}, InputError, "beam: shear_stiffness needs a number that is not negative, got -1.0"),
        (
            {"damping": -0.1},
            InputError,
            "damping needs one ratio that is not negative, or 4, of all modes .*; got -0.1",
        ),
        (
            {"damping": (0.1, 0.2, 0.3, 0.4), "loads": ["gravity y"]},
            InputError,
            "damping needs .*, or 5, of all modes with",
        ),
        ({"damping": np.nan}, InputError, "damping needs one ratio .*; got nan"),
        ({"polar_moment": -1.0}, InputError, "polar_moment needs a number that is not negative, got -1.0"),
        ({"polar_moment": np.nan}, InputError, "polar_moment needs a number that is not negative, got nan"),
        (
            {"fibre": (0.1, np.nan)},
            InputError,
            r"fibre: expected finite numbers of shape \(2,\), got .*, not all finite",
        ),
        ({"fibre": 0.1}, InputError, r"fibre: expected finite numbers of shape \(2,\), got shape \(\)"),
        ({"second_moment": (1.0, 2.0, 3.0)}, InputError, "second_moment needs one number, or two of y and z, got"),
        ({"modes": 2.5}, InputError, "beam: modes: expected a whole number from 1, got 2.5"),
        ({"elements": 8.0}, InputError, "beam: elements: expected a whole number from 1, got 8.0"),
        ({"length": "1"}, InputError, "length needs a positive number, got '1'"),
        ({"loads": "gravity y"}, InputError, r"loads must be a list, loads = .'gravity y'."),
        (
            {"modes": 16, "loads": ["gravity y"]},
            InputError,
            "modes and other loads already represent 'gravity y': leave it out",
        ),
        ({"loads": ["force y A"]}, InputError, "already represent 'force y A': leave it out"),
        (
            {"loads": ["force y C"]},
            UnknownNameError,
            "unknown load 'force y C' .*; valid: gravity y, force y A, moment z",
        ),
        ({"nodes": ["A"]}, InputError, "nodes are positions by name, got .'A'"),
        ({"nodes": {"": 0.0}}, InputError, "nodes need names, got"),
        ({"plane": "x"}, UnknownNameError, "unknown plane 'x'; valid: y, z, space"),
    ],
)
def test_bad_data_is_rejected_in_one_line(change, error, message):
    with pytest.raises(error, match=message):
        mbdae.beam(**UNIT | change)
