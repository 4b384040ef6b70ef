"""Tolerances of a loop in space against its closed form."""

import numpy as np

from mbdae import tolerance

SPATIAL = """
[[body]]
name = "crank"
parent = "world"
joint = "revolute"
axis = [1.0, 0.0, 0.0]
mass = 1.0
inertia = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]

[[body]]
name = "rocker"
parent = "world"
joint = "revolute"
axis = [0.0, 0.0, 1.0]
mass = 1.0
inertia = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]

[[frame]]
name = "crank_tip"
parent = "crank"
xyz = [0.0, 0.2, 0.0]

[[frame]]
name = "rocker_tip"
parent = "rocker"
xyz = [0.4, 0.0, 0.1]

[[closure]]
name = "rod"
kind = "distance"
frames = ["crank_tip", "rocker_tip"]
length = 0.45

[start]
q = { crank = 0.3 }
guess = { rocker = 0.0 }
"""


def test_spatial_four_bar_is_the_closed_form(tmp_path):
    """Crank about x, rocker about z, and a rod between two balls: |A - B|^2 = L^2 with A, B on circles."""
    path = tmp_path / "spatial.toml"
    path.write_text(SPATIAL)
    names = ["frame.crank_tip.xyz.1", "frame.rocker_tip.xyz.0", "frame.rocker_tip.xyz.2", "closure.rod.length"]
    found = tolerance(path, "crank", ["q.rocker"], dict.fromkeys(names, 1e-4), span=(-0.9, 1.0), points=5)
    u, phi, (a, b, h, rod) = found.curve.u, found.influences.values[0], (0.2, 0.4, 0.1, 0.45)
    between = np.array([-b * np.cos(phi), a * np.cos(u) - b * np.sin(phi), a * np.sin(u) - h])
    np.testing.assert_allclose(np.linalg.norm(between, axis=0), rod, rtol=0, atol=1e-13)
    by_crank = between[1] * np.cos(u) + between[2] * np.sin(u)
    by_rocker = between[0] * np.cos(phi) + between[1] * np.sin(phi)
    by_lengths = np.array([by_crank, -by_rocker, -between[2], np.full(5, -rod)])
    by_phi = b * (between[0] * np.sin(phi) - between[1] * np.cos(phi))
    np.testing.assert_allclose(found.influences.derivatives[0], (-by_lengths / by_phi).T, rtol=0, atol=1e-12)
