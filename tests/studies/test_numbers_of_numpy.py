"""Whole numbers and factors of numpy are accepted where those of Python are; others are rejected by name."""

import numpy as np
import pytest

import mbdae
from mbdae.errors import InputError, is_count
from mbdae.studies.periodic.guess import number_of_segments


def test_counts():
    assert all(is_count(x) for x in (1, np.int64(1), np.uint8(3)))
    assert is_count(0, 0)
    assert not any(is_count(x) for x in (0, -1, 1.0, np.float64(1), True, np.True_, "1", None, [1], np.array([1])))


@pytest.mark.parametrize("number", [2, np.int64(2), np.float32(2), np.array(2)])
def test_tables_and_starts_accept_them(number):
    assert mbdae.JointDamping(joint="crank", damping=number).damping == 2.0
    q, _ = mbdae.load("slider_crank").assemble({"crank": number})
    assert np.isclose(q[0], 2.0)


@pytest.mark.parametrize("other", [True, np.True_, "2"])
def test_text_and_true_are_no_numbers(other):
    with pytest.raises(InputError, match="damping: Input should be a valid number"):
        mbdae.JointDamping(joint="crank", damping=other)
    with pytest.raises(InputError, match="joint 'crank' takes 1 finite configuration value, got"):
        mbdae.load("slider_crank").assemble({"crank": other})


def test_studies_accept_them(tmp_path):
    assert len(mbdae.kinematics(mbdae.load("slider_crank"), "crank", points=np.int64(5)).q) == 5
    assert number_of_segments(np.int64(3), None) == 3
    data = {"t": [0.1, 0.2], "q.crank": [1.2, 1.1]}
    counts = {"starts": np.int64(1), "seed": np.int64(2)}
    found = mbdae.fit("four_bar", {"gravity.2": (-12, -8)}, data, step=0.1, method="herk3", **counts)
    assert len(found.searches) == 1
    assert len(mbdae.sweep("pendulum", {"gravity.2": [-9.0]}, (0, 0.1), workers=np.int64(1)).rows) == 1
    sol = mbdae.solve("pendulum", (0, 0.1))
    mbdae.animate(sol, tmp_path / "a.html", deformation=np.float32(2), fps=np.float32(10))
    with pytest.raises(InputError, match="fps must be a positive number, not 'a'"):
        mbdae.animate(sol, tmp_path / "b.html", fps="a")
