"""A beam between two fixed pins: without stretch its bending contradicts the closure, and the run names the cure."""

import numpy as np
import pytest

import mbdae

BEAM = """
gravity = [0.0, -9.81, 0.0]
[[flexible]]
name = "bar"
parent = "world"
joint = "revolute"
length = 1.0
young = 7e10
density = 2700.0
area = 1e-4
second_moment = 8e-11
ends = "pinned"
damping = 0.02
nodes = { mid = 0.5, B = 1.0 }
OPTION
[[frame]]
name = "right"
parent = "world"
xyz = [1.0, 0.0, 0.0]
[[closure]]
name = "pin"
kind = "point"
frames = ["bar.B", "right"]
"""


def beam(path, option="modes = 3"):
    path.write_text(BEAM.replace("OPTION", option))
    return mbdae.load(path)


@pytest.mark.parametrize("formulation", ["index2", "ggl"])
def test_the_message_names_the_cure(tmp_path, formulation):
    sol = mbdae.solve(beam(tmp_path / "beam.toml"), (0, 0.05), formulation=formulation)
    assert sol.status == "rank"
    assert "bending shortens 'bar': let an end slide, or take stiffening = false, or axial = true" in sol.message


def test_the_linear_beam_sags_as_in_closed_form(tmp_path):
    """At rest by 5 w L^4 / (384 EI); 3 modes leave 3e-4 of it."""
    mech = beam(tmp_path / "beam.toml", "modes = 3\nstiffening = false")
    found = mbdae.equilibrium(mech)
    sag = mech.frame(found.q, "bar.mid")[0][1]
    assert sag == pytest.approx(-5 * 0.27 * 9.81 / (384 * 7e10 * 8e-11), rel=1e-3)


def test_a_beam_that_stretches_sags_less(tmp_path):
    """At rest by a: EI (pi/L)^4 a + EA (pi/L)^4 a^3 / 4 = 4 w / pi, by one half wave; the linear sag is 6.2 mm.

    One axial mode of 16 is stiffer than uniform stretch, by pi^2 / 8.
    """
    mech = beam(tmp_path / "beam.toml", "modes = 16\naxial = true")
    sag = -mech.frame(mbdae.equilibrium(mech).q, "bar.mid")[0][1]
    EI, EA, w = 7e10 * 8e-11, 7e10 * 1e-4 * np.pi**2 / 8, 0.27 * 9.81
    roots = np.roots([EA * np.pi**4 / 4, 0.0, EI * np.pi**4, -4 * w / np.pi])
    assert sag == pytest.approx(roots[np.isreal(roots)].real[0], rel=0.01)
