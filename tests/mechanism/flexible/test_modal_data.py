"""Flexible bodies from files: the same numbers again, and one line for bad ones."""

import numpy as np
import pytest
from flexible_slider_crank import rod

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism.flexible.modal_data import modal_body_from_data, modal_data

MODEL = """
[[flexible]]
name = "rod"
parent = "world"
joint = "revolute"
file = "rod.npz"
"""


@pytest.fixture
def folder(tmp_path):
    mbdae.save_modal_body(rod((1e-3,) * 4)[0], tmp_path / "rod.npz")
    (tmp_path / "rod.toml").write_text(MODEL)
    return tmp_path


def test_a_body_from_a_file_is_the_one_written(folder):
    body, found = rod((1e-3,) * 4)[0], mbdae.load(folder / "rod.toml")
    again = found.model.flexible[0].modal
    for name in ("mass", "s0", "I0", "C", "H0", "Mq", "Hj", "I1", "I2", "stiffness", "damping"):
        np.testing.assert_array_equal(getattr(again, name), getattr(body, name))
    np.testing.assert_array_equal(again.nodes["pin"].Phi, body.nodes["pin"].Phi)


def test_beams_keep_their_strains_and_second_order(tmp_path):
    beam = mbdae.beam(1.0, 2.0, 3.0, 1.0, 1.0, elements=4, fibre=(0.1, 0.0))
    again = modal_body_from_data(modal_data(beam), "beam")
    np.testing.assert_array_equal(again.C2, beam.C2)
    np.testing.assert_array_equal(again.nodes["B"].Phi2, beam.nodes["B"].Phi2)
    np.testing.assert_array_equal(again.nodes["A"].strain, beam.nodes["A"].strain)
    assert again.nodes["A"].modulus == 2.0
    with pytest.raises(InputError, match=r"written to .npz files, got beam.txt"):
        mbdae.save_modal_body(beam, "beam.txt")
    with pytest.raises(InputError, match=r"cannot write .*beam.npz: No such file or directory"):
        mbdae.save_modal_body(beam, tmp_path / "none" / "beam.npz")


def test_a_saved_run_keeps_the_numbers(folder):
    sol = mbdae.solve(folder / "rod.toml", (0, 0.001), method="pherk5", step=1e-4)
    sol.save(folder / "run.npz")
    (folder / "rod.npz").unlink()
    again = mbdae.Solution.load(folder / "run.npz").mechanism
    np.testing.assert_array_equal(again.mass_matrix(sol.q[-1]), sol.mechanism.mass_matrix(sol.q[-1]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mass": -1.0}, "flexible body 'rod': mass needs a positive number, got "),
        ({"stiffness": [1.0, 2.0, 0.0, 1.0]}, "'rod': stiffness must be positive and damping not negative"),
        ({"C": [[1.0]]}, r"'rod': C: expected finite numbers of shape \(3, 4\), got shape \(1, 1\)"),
        ({"I0": np.tri(3).tolist()}, "'rod': I0 must be symmetric"),
        ({"Mq": np.diag([1.0, 1, 1, -1]).tolist()}, "'rod': Mq must be positive definite"),
        (
            {"H0": [[1.0], [1.0, 2.0]]},
            r"'rod': H0: expected finite numbers of shape \(3, 4\), got \[\[1.0\], \[1.0, 2.0\]\]",
        ),
        ({"s0": [9.0, 0.0, 0.0]}, "'rod': no body has these masses, whose kinetic energy could be negative"),
        ({"I0": np.diag([-1.0, 1, 1]).tolist()}, "'rod': no body has these masses, whose kinetic energy could be neg"),
        ({"I0": np.diag([9.0, 1, 1]).tolist()}, "'rod': no body has the moments of inertia .*, 9 kg m"),
        ({"I2": np.arange(144.0).reshape(4, 4, 3, 3).tolist()}, "'rod': I2 must be symmetric in its modes"),
        ({"names": ["pin"] * 3}, "'rod': the node 'pin' is given twice"),
        ({"names": ["pin", "", "tip"]}, "'rod': nodes need names"),
        ({"modulus": [1.0, -1.0, 1.0]}, "'rod': node .*: modulus needs a number that is not negative, got -1"),
        ({"color": 1.0}, "'rod': unknown numbers 'color'; valid: mass, s0, I0"),
    ],
)
def test_bad_numbers_are_rejected_in_one_line(change, message):
    with pytest.raises(InputError, match=message):
        modal_body_from_data(modal_data(rod((0.0,) * 4)[0]) | change, "rod")


def test_a_body_from_a_file_is_damped_and_takes_its_first_modes(tmp_path):
    """A cantilever: frequencies 3.516 and 22.03 sqrt(EI/(rho A L^4)), with the given damping ratios."""
    unit = {"length": 1.0, "young": 1.0, "density": 1.0, "area": 1.0, "second_moment": 1.0}
    mbdae.save_modal_body(mbdae.beam(**unit, modes=3, elements=16), tmp_path / "rod.npz")
    options = 'joint = "fixed"\nmodes = 2\ndamping = [0.02, 0.1]'
    (tmp_path / "rod.toml").write_text(MODEL.replace('joint = "revolute"', options))
    found = mbdae.modes(mbdae.load(tmp_path / "rod.toml"))
    np.testing.assert_allclose(np.abs(found.roots), [3.5160152685, 22.0344915647], rtol=1e-5)
    np.testing.assert_allclose(found.damping, [0.02, 0.1], rtol=1e-9)
    beam = mbdae.beam(**unit, modes=2, elements=16, damping=(0.02, 0.1))
    again = mbdae.load(tmp_path / "rod.toml").model.flexible[0].modal
    for name, value in modal_data(beam).items():
        if name == "names":
            assert list(again.nodes) == value
        elif hasattr(again, name):
            np.testing.assert_allclose(getattr(again, name), value, rtol=1e-9, atol=1e-9)


BEAM = "length = 1.0\nyoung = 7e10\ndensity = 2700.0\narea = 1e-4\nsecond_moment = 1e-9"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('file = "other.npz"', "'other.npz' is not found"),
        ('file = "rod.toml"', "rod.toml is not a file of a modal body"),
        ('file = "rod.npz"\nmodes = 5', "flexible body 'rod' has 4 modes, got modes = 5"),
        ('file = "rod.npz"\ndamping = -0.1', "flexible body 'rod': damping needs one ratio that is not negative, or 4"),
        (
            'file = "rod.npz"\ndamping = [0.1, 0.2]',
            "flexible body 'rod': damping needs one ratio that .*, or 4, of all",
        ),
        ('file = "rod.npz"\nlength = 1.0', "flexible.rod: length belongs to a beam, not to a body from a file"),
        (f"{BEAM}\nloads = ['gravty y']", "unknown load of flexible body 'rod': 'gravty y' .did you mean 'gravity y'"),
        ("length = 1.0", "flexible.rod: a beam needs young, density, area, second_moment; another body has a file"),
    ],
)
def test_bad_tables_are_rejected_in_one_line(folder, text, message):
    (folder / "rod.toml").write_text(MODEL.replace('file = "rod.npz"', text))
    with pytest.raises(InputError, match=message):
        mbdae.load(folder / "rod.toml")
