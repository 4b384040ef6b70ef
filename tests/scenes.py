"""Small scenes and prescribed motions for the tests of the replay."""

from types import SimpleNamespace

import coal
import numpy as np
import pinocchio as pin

from mbdae.mechanism.scene.make_scene import make_scene
from mbdae.mechanism.scene.scene import Mark

COLLADA = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><up_axis>Z_UP</up_axis></asset>
<library_effects>{effects}</library_effects><library_materials>{materials}</library_materials>
<library_geometries>{geometries}</library_geometries>
<library_visual_scenes><visual_scene id="scene">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#scene"/></scene></COLLADA>"""
EFFECT = """<effect id="{0}e"><profile_COMMON><technique sid="c"><lambert>
<emission><color>{1} 1</color></emission><diffuse><color>0 0 0 1</color></diffuse>
</lambert></technique></profile_COMMON></effect>"""
GEOMETRY = """<geometry id="g{0}"><mesh><source id="p{0}"><float_array id="a{0}" count="{1}">{2}</float_array>
<technique_common><accessor source="#a{0}" count="{3}" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v{0}"><input semantic="POSITION" source="#p{0}"/></vertices>{4}</mesh></geometry>"""
TRIANGLES = """<triangles material="{0}m" count="2"><input semantic="VERTEX" source="#v{1}" offset="0"/>
<p>{2}</p></triangles>"""


def collada(path):
    """Write three unit squares in a row, red, green and blue: two in one geometry, one in another."""
    colours = {"red": "1 0 0", "green": "0 1 0", "blue": "0 0 1"}
    effects = "".join(EFFECT.format(n, c) for n, c in colours.items())
    materials = "".join(f'<material id="{n}m"><instance_effect url="#{n}e"/></material>' for n in colours)
    geometries = nodes = ""
    for g, names in enumerate((["red", "green"], ["blue"])):
        corners = [(x, 0, z) for x in range(2 * g, 2 * g + len(names) + 1) for z in (0, 1)]
        text = " ".join(str(c) for corner in corners for c in corner)
        parts = "".join(
            TRIANGLES.format(n, g, " ".join(str(2 * k + i) for i in (0, 2, 1, 1, 2, 3))) for k, n in enumerate(names)
        )
        geometries += GEOMETRY.format(g, 3 * len(corners), text, len(corners), parts)
        bound = "".join(f'<instance_material symbol="{n}m" target="#{n}m"/>' for n in names)
        nodes += (
            f'<node id="n{g}"><instance_geometry url="#g{g}"><bind_material><technique_common>{bound}'
            "</technique_common></bind_material></instance_geometry></node>"
        )
    filling = {"effects": effects, "materials": materials, "geometries": geometries, "nodes": nodes}
    path.write_text(COLLADA.format(**filling))
    return path


def motion(scene, q, end=2.0, start=0.0, title="a test"):
    """Return a synthetic solution: q is a function of t."""
    t = np.linspace(start, end, 9)
    points = np.array([q(x) for x in t])
    mech = SimpleNamespace(scene=scene, title=title, model=scene._model, switches=())
    sol = SimpleNamespace(t=t, q=points, mechanism=mech, settings={})
    called = {"__call__": lambda self, times: (np.array([q(x) for x in times]), None)}
    return type("Motion", (SimpleNamespace,), called)(**vars(sol))


def fourbar():
    """Return a model without visuals, whose loop can be opened by moving the rocker alone."""
    model, identity = pin.Model(), pin.SE3.Identity()
    at = {x: pin.SE3(np.eye(3), np.array([x, 0.0, 0.0])) for x in (1.0, 1.5, 2.0)}
    for parent, place, name in ((0, identity, "crank"), (1, at[1.0], "coupler"), (0, at[2.0], "rocker")):
        joint = model.addJoint(parent, pin.JointModelRY(), place, name)
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.array([0.5, 0, 0]), np.eye(3)), identity)
    scene = make_scene(model, None, [Mark("loop", (2, at[2.0]), (3, at[1.5]))])
    return SimpleNamespace(model=model, scene=scene, q=fourbar_q)


def fourbar_q(t):
    angle = 1.2 + np.pi * t
    pin_at = np.array([np.cos(angle), np.sin(angle)])
    d = np.array([2.0, 0.0]) - pin_at
    coupler = np.arctan2(d[1], d[0]) + np.arccos((4 + d @ d - 2.25) / (4 * np.sqrt(d @ d)))
    end = pin_at + 2 * np.array([np.cos(coupler), np.sin(coupler)])
    return np.array([-angle, angle - coupler, -np.arctan2(end[1], end[0] - 2)])


def flag(folder):
    """Return a scene of one moving mesh, scaled and mirrored, with three materials."""
    path = collada(folder / "flag.dae")
    model, visuals = pin.Model(), pin.GeometryModel()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "j")
    scale = np.array([0.1, 0.1, -0.1])
    triangles = coal.MeshLoader().load(str(path), scale)
    visuals.addGeometryObject(pin.GeometryObject("flag", joint, pin.SE3.Identity(), triangles, str(path), scale))
    return make_scene(model, visuals)
