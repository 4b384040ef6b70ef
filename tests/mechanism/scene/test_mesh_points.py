"""The sizes of mesh files, and damaged ones, which are rejected without hanging."""

import struct

import numpy as np
import pytest
from fuzz_seeds import CUBE, DAE, STL

from mbdae.errors import InputError
from mbdae.mechanism.scene.mesh_points import points_of
from mbdae.mechanism.scene.meshes import placeholder

BINARY = b"\0" * 80 + struct.pack("<I12fH", 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 7)
PLACED = "<translate>0 0 1</translate><rotate>0 0 1 90</rotate><scale>2 1 1</scale>"
TURNED = DAE.replace("<matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix>", PLACED)


@pytest.mark.parametrize(
    ("name", "content", "low", "high"),
    [
        ("a.obj", CUBE, [0, 0, 0], [1, 1, 1]),
        ("a.stl", STL, [0, 0, 0], [1, 1, 0]),
        ("a.STL", BINARY, [0, 0, 0], [1, 1, 0]),
        ("a.dae", DAE, [0, 0, 0], [1, 1, 0]),
        ("a.dae", TURNED, [-1, 0, 1], [0, 2, 1]),
    ],
)
def test_meshes_have_the_bounds_of_their_points(tmp_path, name, content, low, high):
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    points = points_of(tmp_path / name)
    np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], [low, high], atol=1e-12)
    geometry = placeholder(tmp_path / name, np.array([1.0, -2.0, 3.0]))
    geometry.computeLocalAABB()
    box = geometry.aabb_local
    np.testing.assert_allclose([box.min_, box.max_], np.sort(np.array([low, high]) * [1, -2, 3], axis=0), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.obj", "v 1 2\n"),
        ("a.obj", CUBE.replace("v 1 0 0", "v 1e999 0 0")),
        ("a.stl", STL.replace("1 0 0", "x 0 0")),
        ("a.dae", DAE.replace("0 0 0 1 0 0 0 1 0", "-inf 0 0")),
        ("a.dae", DAE.replace('url="#g"', 'url="#q"')),
        ("a.dae", DAE.replace('<instance_geometry url="#g"/>', '<instance_node url="#n"/>')),
        ("a.dae", DAE[:200]),
    ],
)
def test_damaged_meshes_are_rejected(tmp_path, name, content):
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=r"^mesh 'a\.\w+' (is damaged: |has no points)"):
        points_of(tmp_path / name)
