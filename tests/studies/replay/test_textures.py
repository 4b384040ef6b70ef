"""Textures of meshes are seen in the page, in both formats that have them, and are in the .glb file."""

import json
from io import BytesIO

import numpy as np
import pinocchio as pin
import pytest
from browser import Chromium
from PIL import Image
from scenes import motion

from mbdae.mechanism.scene.make_scene import make_scene
from mbdae.mechanism.scene.meshes import placeholder
from mbdae.studies.replay.replay import animate

RED, GREEN, BLUE, YELLOW = (220, 20, 20), (20, 180, 20), (20, 20, 220), (220, 200, 20)
OBJ = """mtllib flag.mtl
v 0 0 0
v 1 0 0
v 1 0 1
v 0 0 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl flag
f 1/1 2/2 3/3 4/4
"""
DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><up_axis>Z_UP</up_axis></asset>
<library_images><image id="i"><init_from>flag.png</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON>
<newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>
<newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam>
<technique sid="c"><lambert><diffuse><texture texture="t" texcoord="UV"/></diffuse></lambert></technique>
</profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">0 0 0 1 0 0 1 0 1 0 0 1</float_array><technique_common>
<accessor source="#pa" count="4" stride="3"/></technique_common></source>
<source id="u"><float_array id="ua" count="8">0 0 1 0 1 1 0 1</float_array><technique_common>
<accessor source="#ua" count="4" stride="2"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles material="m" count="2"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="TEXCOORD" source="#u" offset="1" set="0"/><p>0 0 1 1 2 2 0 0 2 2 3 3</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="scene"><node id="n"><instance_geometry url="#g"><bind_material>
<technique_common><instance_material symbol="m" target="#m"/></technique_common></bind_material></instance_geometry>
</node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#scene"/></scene></COLLADA>"""


@pytest.fixture(params=["obj", "dae"])
def flag(request, tmp_path):
    """A square in the x-z plane: red and green above, blue and yellow below."""
    picture = Image.fromarray(np.array([[RED, GREEN], [BLUE, YELLOW]], "uint8")).resize((64, 64), Image.NEAREST)
    picture.save(tmp_path / "flag.png")
    (tmp_path / "flag.mtl").write_text("newmtl flag\nKd 1 1 1\nmap_Kd flag.png\n")
    path = tmp_path / f"flag.{request.param}"
    path.write_text(OBJ if request.param == "obj" else DAE)
    model, visuals = pin.Model(), pin.GeometryModel()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "j")
    triangles = placeholder(path, np.ones(3))
    drawn = pin.GeometryObject("flag", joint, pin.SE3.Identity(), triangles, str(path), np.ones(3))
    visuals.addGeometryObject(drawn)
    return motion(make_scene(model, visuals), lambda t: np.array([0.001 * t]))


def test_a_texture_is_seen_upright(flag, tmp_path):
    page = animate(flag, tmp_path / "run.html", plots=())
    with Chromium().open(f"{page.as_uri()}#t=0&camera=front&shadows=0", (500, 400)) as tab:
        tab.evaluate("new Promise(done => setTimeout(done, 300))")  # an image is decoded later
        tab.evaluate("mbdae.viewer.render(); 0")
        seen = tab.picture()
    middles = []
    for colour in (RED, GREEN, BLUE, YELLOW):
        alike = np.abs(seen / seen.max(axis=2, keepdims=True) - np.array(colour) / max(colour)).max(axis=2) < 0.12
        assert alike.sum() > 1000, colour
        middles.append([np.median(x) for x in np.nonzero(alike)])
    (red, green, blue, yellow) = np.array(middles)
    assert red[1] < green[1]
    assert red[0] < blue[0]
    np.testing.assert_allclose(green - red, yellow - blue, atol=3)


def test_a_texture_is_in_the_scene_file(flag, tmp_path):
    data = animate(flag, tmp_path / "run.glb").read_bytes()
    size = int(np.frombuffer(data[12:16], "<u4")[0])
    parts, binary = json.loads(data[20 : 20 + size]), data[28 + size :]
    (image,), (texture,), (material,) = parts["images"], parts["textures"], parts["materials"]
    view = parts["bufferViews"][image["bufferView"]]
    with Image.open(BytesIO(binary[view["byteOffset"] :][: view["byteLength"]])) as picture:
        assert picture.convert("RGB").getpixel((3, 3)) == RED
    assert texture["source"] == material["pbrMetallicRoughness"]["baseColorTexture"]["index"] == 0
    (drawn,) = parts["meshes"][0]["primitives"]
    accessors = [parts["accessors"][drawn["attributes"][k]]["bufferView"] for k in ("POSITION", "TEXCOORD_0")]
    arrays = []
    for number, width in zip(accessors, (3, 2), strict=True):
        view = parts["bufferViews"][number]
        arrays.append(np.frombuffer(binary[view["byteOffset"] :][: view["byteLength"]], "<f4").reshape(-1, width))
    points, uv = arrays
    np.testing.assert_allclose(uv, np.column_stack([points[:, 0], 1 - points[:, 2]]), atol=1e-6)
