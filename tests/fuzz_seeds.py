"""Small files of every format that mbdae reads, and random mutations of them."""

import json
import re

import numpy as np

NUMBER_TEXTS = ["nan", "inf", "-inf", "1e300", "-1", "0", "", "x", "1 2", "1e999", "1e-320", "0x10", "10" * 200, "1e9",
           "1000000000", "-1000000000", "99999999999999999999", "0.5", "../../x", "/etc/passwd"]  # fmt: skip
NUMBERS = [-1, 0, 1, 7, 1e9, 1e300, -1e300, 2**31, 2**63, 0.1]
VALUES = [None, True, -1, 0, 1e308, 2**40, "x", "", [], {}, [[]], {"x": 1}, 0.5, "../x", "\x1b[31m"]

CUBE = """mtllib box.mtl
o box
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
vt 0 0
usemtl red
f 1/1 2/1 3/1
f 1 2 4
f -1 -2 -3
"""
MATERIAL = "newmtl red\nKd 1 0 0\nmap_Kd box.png\n"
STL = """solid a
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
endsolid a
"""
DAE = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.5"/><up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="9">0 0 0 1 0 0 0 1 0</float_array><technique_common>
<accessor source="#a" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source><vertices id="v">
<input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 1 2</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s">
<node id="n"><matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
SHOWN = """<robot name="shown"><link name="base"/><link name="arm"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><geometry><mesh filename="NAME" scale="1 1 -1"/></geometry></visual></link>
<joint name="j" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0.6 0.8"/></joint></robot>"""
TABLEAU = """name = "own3"
title = "Ralston's method"
order = 3
order_linear = 3
order_own = 1
A = [[], ["1/2"], ["0", "3/4"]]
b = ["2/9", "1/3", "1/6 + sqrt(3)/9 - sqrt(3)/9 + 5/18"]
b_embedded = ["7/24", "1/4", "11/24"]
order_embedded = 2
"""
TABLE = "t,q.crank,v.crank\n0,0.3,1.0\n0.5,0.7,1.1\n1,1.3e0,-1.2\n2,1.5,0.1\n"
SWEEP = """model = "slider_crank"
end = 0.02
times = 5
outputs = ["peak q.crank", "final v.slider", "q.crank"]
seed = 3
workers = 1
executor = "threads"
[settings]
rtol = 1e-6
[KIND]
"""
SAMPLE = """[random]
n = 3
[random.parameters]
start.q.crank = { distribution = "normal", loc = 0.3, scale = 0.01 }
"""
SWEEPS = tuple(
    SWEEP.replace("[KIND]\n", runs)
    for runs in (
        SAMPLE,
        "[grid]\nstart.q.crank = { from = 0.1, to = 0.3, n = 3 }\nstart.v.crank = [1.0, 2.0]\n",
        "[[run]]\nstart.q.crank = 0.1\n[[run]]\nstart.q.crank = 0.2\n",
    )
)
REPLICATED = """<mujoco><option timestep="0.001"/><worldbody>
<replicate count="2" euler="0 0 90"><replicate count="2" offset="1 0 0"><body><joint name="j" axis="0 1 0"/>
<geom size="0.1"/></body></replicate></replicate></worldbody></mujoco>"""
PARAMETRIC = """def mechanism(floors: int = 2, height: float = 0.5) -> dict:
    names = ["world", *(f"floor_{i}" for i in range(min(floors, 20)))]
    body = {"joint": "revolute", "axis": [0, 1, 0], "xyz": [0, 0, height], "mass": 1.0, "com": [0, 0, 0.5]}
    return {"title": "Tower", "body": [{**body, "name": n, "parent": p} for p, n in zip(names, names[1:])]}
"""


def mutated_text(text, rng):
    """Return a text with one to three numbers, words or tags replaced, removed or duplicated, or truncated."""
    for _ in range(rng.randint(1, 3)):
        kind = rng.choice(["number", "number", "number", "word", "tag", "double", "cut", "letter"])
        pattern = {"number": r"-?\d+(\.\d+)?(e-?\d+)?", "word": r"[A-Za-z_]{2,}"}.get(kind, r"<[^>]*>|[^<\n]+")
        pieces = [m.span() for m in re.finditer(pattern, text)] or [(0, len(text))]
        a, b = rng.choice(pieces)
        if kind == "number":
            text = text[:a] + rng.choice(NUMBER_TEXTS) + text[b:]
        elif kind == "word":
            c, d = rng.choice(pieces)
            text = text[:a] + text[c:d] + text[b:]
        elif kind == "letter":
            text = text[:a] + rng.choice(["\x1b", "\x00", "é", "{", '"', "-", "&x;", "*a", "\n", "#", "'"]) + text[a:]
        else:
            text = {"tag": text[:a] + text[b:], "double": text[:b] + text[a:], "cut": text[:b]}[kind]
    return text


def mutated_bytes(data, rng):
    """Return bytes with one to three mutations: changed, truncated or duplicated."""
    for _ in range(rng.randint(1, 3)):
        at, end = sorted(rng.randint(0, len(data)) for _ in "ab")
        data = rng.choice(
            [
                data[:at] + rng.randbytes(1) + data[at + 1 :],
                data[:at] + rng.randbytes(4) + data[at + 4 :],
                data[:at] + b"\xff\xff\xff\x7f" + data[at + 4 :],
                data[:at],
                data[:end] + data[at:],
            ]
        )
    return data


def mutated_table(table, rng):
    """Return a JSON table with one to three of its entries replaced, removed or duplicated."""
    table = json.loads(json.dumps(table))
    for _ in range(rng.randint(1, 3)):
        inner, key, path = table, None, []
        while isinstance(inner, dict | list) and inner and (not path or rng.random() < 0.9):
            holder, key = inner, rng.choice(list(inner)) if isinstance(inner, dict) else rng.randrange(len(inner))
            inner = inner[key]
            path.append(key)
        if key is None:
            break
        number = isinstance(inner, int | float) and rng.random() < 0.7
        action = rng.choice(["replace"] * 4 + ["remove", "double"])
        if action == "replace":
            holder[key] = rng.choice(NUMBERS if number else VALUES)
        elif action == "remove":
            del holder[key]
        elif isinstance(holder, list):
            holder.insert(key, inner)
    return table


def write_mutated_run(path, rng, runs):
    """Write a saved run with changed bytes, changed metadata, or arrays of other shapes."""
    source = rng.choice(runs)
    if rng.random() < 0.2:
        path.write_bytes(mutated_bytes(source.read_bytes(), rng))
        return
    with np.load(source) as file:
        arrays = {name: file[name] for name in file.files}
    if rng.random() < 0.1:
        name = rng.choice(sorted(set(arrays) - {"meta"}))
        x = arrays[name]
        arrays[name] = rng.choice([x[:-1], x * np.nan, x[::-1], x.astype("<f4"), x.astype(int), x[..., None], x[:0]])
    elif rng.random() < 0.05:  # far larger than the file
        name, n = rng.choice([*arrays, "event_0_t", "more"]), rng.choice([2**20, 2**24])
        shape = rng.choice([(n,), (n, 2), (*np.shape(arrays.get(name, 0.0))[:1], n // 4), ()])
        arrays[name] = rng.choice([np.zeros(shape), np.full((), "x" * n)])
        np.savez_compressed(path, **arrays)
        return
    else:
        arrays["meta"] = np.array(json.dumps(mutated_table(json.loads(str(arrays["meta"])), rng)))
    np.savez(path, **arrays)
