"""Optimization of the section of a beam: a cantilever that comes to rest at a given sag, against its closed form."""

import numpy as np
import pytest

import mbdae

LENGTH, YOUNG, DENSITY, AREA, SAG = 1.0, 2.1e11, 7850.0, 1e-4, 4e-3
CANTILEVER = f"""
gravity = [0.0, -9.81, 0.0]
[[flexible]]
name = "beam"
parent = "world"
joint = "fixed"
length = {LENGTH}
young = {YOUNG}
density = {DENSITY}
area = {AREA}
second_moment = 8e-10
modes = 1
damping = 1.0
stiffening = false
loads = ["gravity y"]
"""
TIP, MOMENT = "displacement.beam.B.y", "flexible.beam.second_moment"


def distance(signals):
    """The square of the distance of the tip from the sag at the end, in mm^2, and its derivative."""
    error = 1e3 * (signals[TIP][-1] + SAG)
    return error**2, {TIP: 2e3 * error * np.eye(len(signals[TIP]))[-1]}


@pytest.mark.slow
def test_the_section_for_a_sag(tmp_path):
    """I = rho A g L^4/(8 E sag)."""
    (tmp_path / "cantilever.toml").write_text(CANTILEVER)
    bounds = {MOMENT: (4e-10, 4e-9)}
    options = {"t_span": (0, 0.8), "method": "pherk5", "rtol": 1e-8}
    found = mbdae.optimize(tmp_path / "cantilever.toml", distance, [MOMENT], bounds, **options)
    exact = DENSITY * AREA * 9.81 * LENGTH**4 / (8 * YOUNG * SAG)
    assert found.values[MOMENT] == pytest.approx(exact, rel=1e-5)
