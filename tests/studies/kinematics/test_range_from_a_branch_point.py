"""Ranges of the input that begin where branches of the parallelogram intersect."""

import numpy as np
import pytest

import mbdae
from mbdae.errors import InputError


@pytest.mark.parametrize("start", [0.0, 1e-9, np.pi])
def test_a_range_from_a_branch_point_is_rejected(start):
    """The bars of a parallelogram are in line there; loops that close to rounding find the pose to its root only."""
    with pytest.raises(InputError, match="lose rank in this pose, in which several branches intersect: start next to"):
        mbdae.kinematics("n_four_bar?N=1", "crank_0", span=(start, 2 * np.pi))
