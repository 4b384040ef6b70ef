"""A .glb file follows Khronos' specification, and shows the motion of the solution."""

import json

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae.mechanism.scene.solids import solid
from mbdae.mechanism.scene.surfaces import Surface, normals
from mbdae.studies.replay.replay import animate

WIDTH = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
KIND = {5126: "<f4", 5125: "<u4"}


class File:
    """A reader of glTF 2.0 with the checks of the specification."""

    def __init__(self, data):
        magic, version, length = data[:4], *np.frombuffer(data[4:12], "<u4")
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size = int(np.frombuffer(data[12:16], "<u4")[0])
        assert (data[16:20], size % 4) == (b"JSON", 0)
        self.parts = json.loads(data[20 : 20 + size])
        self.binary = data[28 + size :]
        assert data[24 + size : 28 + size] == b"BIN\0"
        assert len(self.binary) % 4 == 0
        assert 0 <= len(self.binary) - self.parts["buffers"][0]["byteLength"] < 4

    def array(self, number):
        a = self.parts["accessors"][number]
        view = self.parts["bufferViews"][a["bufferView"]]
        data = self.binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        out = np.frombuffer(data, KIND[a["componentType"]]).reshape(-1, WIDTH[a["type"]])
        assert len(out) == a["count"]
        assert np.isfinite(out).all()
        if "min" in a:
            np.testing.assert_array_equal((out.min(0), out.max(0)), (np.float32(a["min"]), np.float32(a["max"])))
        return out

    def tracks(self, node):
        (motion,) = self.parts["animations"]
        return {
            c["target"]["path"]: [self.array(motion["samplers"][c["sampler"]][k]) for k in ("input", "output")]
            for c in motion["channels"]
            if c["target"]["node"] == node
        }


@pytest.fixture(scope="module", params=["slider_crank", "spring_four_bar", "flyball_governor"])
def shown(request, tmp_path_factory):
    sol = mbdae.solve(mbdae.load(request.param), (0, 1), rtol=1e-7)
    path = animate(sol, tmp_path_factory.mktemp("glb") / "run.glb", fps=20, speed=0.5)
    return sol, File(path.read_bytes())


def test_every_part_refers_to_what_is_there(shown):
    _, file = shown
    parts, used = file.parts, set()
    assert parts["asset"]["version"] == "2.0"
    for mesh in parts["meshes"]:
        for p in mesh["primitives"]:
            points, turned = (file.array(p["attributes"][k]) for k in ("POSITION", "NORMAL"))
            index = file.array(p["indices"])[:, 0]
            assert len(points) == len(turned) == index.max() + 1
            assert len(index) % 3 == 0
            np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1, atol=1e-5)
            used |= {*p["attributes"].values(), p["indices"], *(t["POSITION"] for t in p.get("targets", ()))}
            assert p["material"] < len(parts["materials"])
    for s in parts["animations"][0]["samplers"]:
        times, values = file.array(s["input"])[:, 0], file.array(s["output"])
        assert len(times) == len(values)
        assert (np.diff(times) > 0).all()
        assert times[0] == 0
        assert times[-1] == pytest.approx(2.0), "at half the speed"
        used |= {s["input"], s["output"]}
    assert used == set(range(len(parts["accessors"]))), "nothing is there in vain"
    assert all(v["byteOffset"] % 4 == 0 for v in parts["bufferViews"])
    assert sorted(parts["nodes"][0]["children"]) == list(range(1, len(parts["nodes"])))


def test_nodes_move_as_the_shapes(shown):
    sol, file = shown
    scene = sol.mechanism.scene
    names = {n["name"]: k for k, n in enumerate(file.parts["nodes"])}
    for k, shape in enumerate(scene.shapes):
        if shape.role in ("closure", "rail"):
            assert (shape.name in names) == (shape.role == "rail")
            continue
        tracks = file.tracks(names[shape.name])
        for path, columns in (("translation", slice(0, 3)), ("rotation", slice(3, 7))):
            if path not in tracks:
                continue
            times, values = tracks[path]
            for i in (0, len(times) // 2, -1):
                expected = scene.placements(sol(0.5 * times[i, 0]).q)[k, columns]
                sign = np.sign(expected @ values[i]) if path == "rotation" else 1
                np.testing.assert_allclose(sign * values[i], expected, atol=1e-5)


def test_springs_reach_from_end_to_end(shown):
    sol, file = shown
    scene, names = sol.mechanism.scene, {n["name"]: k for k, n in enumerate(file.parts["nodes"])}
    for s, spring in enumerate(scene.springs):
        node = file.parts["nodes"][names[f"{spring.name} coil"]]
        (drawn,) = file.parts["meshes"][node["mesh"]]["primitives"]
        points, longer = (file.array(x["POSITION"]) for x in (drawn["attributes"], *drawn["targets"]))
        tracks = file.tracks(names[f"{spring.name} coil"])
        for i in (0, -1):
            _, b = scene.end_points(scene.springs, sol(0.5 * tracks["rotation"][0][i, 0]).q[None])[0, s]
            turn = pin.Quaternion(tracks["rotation"][1][i].astype(float)).matrix()
            far = tracks.get("translation", [0, [node["translation"]] * 2])[1][i] + turn @ (
                [0, 0, spring.length * (1 + tracks["weights"][1][i, 0])]
            )
            np.testing.assert_allclose(far, b, atol=1e-5)
            assert np.ptp(points[:, 2]) == pytest.approx(spring.length, rel=0.05)
            assert np.ptp(longer, axis=0) == pytest.approx([0, 0, spring.length], rel=1e-6)


def test_closed_contacts_and_impacts_are_marked(tmp_path):
    sol = mbdae.solve(mbdae.load("pendulum_on_stop"), (0, 6))
    file = File(animate(sol, tmp_path / "run.glb", fps=20, speed=0.5).read_bytes())
    names = {n["name"]: k for k, n in enumerate(file.parts["nodes"])}
    ball = file.parts["nodes"][names["rod stop active"]]
    assert ball["translation"] == [0, 0, 0]
    radius = 3 * sol.mechanism.scene.width
    at, size = file.tracks(names["rod stop active"])["scale"]
    *_, (first, mode) = sol.modes
    assert mode == (1,)
    assert at[size[:, 0] > 0.5 * radius, 0] == pytest.approx([2 * sol.t[first]], rel=1e-6), "at half the speed"
    at, size = file.tracks(names["rod stop impact"])["scale"]
    first, second = (2 * impact.t for impact in sol.impacts[:2])
    times = [first - 0.01, first + 1e-5, first + 0.2, first + 0.3, second + 1e-5]
    seen = np.interp(times, at[:, 0], size[:, 0] / radius)
    assert seen[1] == pytest.approx(2.5, rel=1e-3)
    assert seen[[0, 3]] == pytest.approx([0, 0], abs=1e-4)
    assert seen[2] == pytest.approx(0.5, rel=1e-2)
    assert 1 < seen[4] < 2.5, "the second is weaker"


@pytest.mark.parametrize(
    ("kind", "size", "volume"),
    [
        ("box", (1, 2, 3), 6),
        ("sphere", (2,), 4 / 3 * np.pi * 8),
        ("ellipsoid", (1, 2, 3), 4 / 3 * np.pi * 6),
        ("cylinder", (1, 3), 3 * np.pi),
        ("cone", (1, 3), np.pi),
        ("capsule", (1, 2), 2 * np.pi + 4 / 3 * np.pi),
    ],
)
def test_solids_are_closed_and_turned_outwards(kind, size, volume):
    found = solid(kind, size)
    a, b, c = found.points[found.faces].astype(float).swapaxes(0, 1)
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(volume, rel=0.02)
    edges = np.sort(np.concatenate([found.faces[:, [0, 1]], found.faces[:, [1, 2]], found.faces[:, [2, 0]]]), axis=1)
    assert set(np.unique(edges, axis=0, return_counts=True)[1]) == {2}


def test_edges_stay_sharp_and_round_shapes_round():
    box = normals(solid("box", (1, 1, 1)))
    np.testing.assert_allclose(np.abs(box).max(axis=1), 1)
    ball = solid("sphere", (1.0,))
    np.testing.assert_allclose(normals(ball), ball.points[ball.faces.ravel()], atol=0.07)
    flat = Surface(np.zeros((3, 3)), np.array([[0, 1, 2]]), None)
    assert np.isfinite(normals(flat)).all()
