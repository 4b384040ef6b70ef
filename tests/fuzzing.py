"""Files with mistakes: mutants of every kind of file that mbdae reads, tried in processes of their own.

    python tests/fuzzing.py --count 2600

A mutant may be read or refused in one line of an `mbdae.errors.MbdaeError`; it must not end the process, print a
traceback, or keep silent for longer than ``PATIENCE``.
"""

import argparse
import json
import random
import re
import select
import shutil
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

DATA = Path(__file__).parent / "data"
PATIENCE = 20.0  # s without an answer
SPELLED = ["nan", "inf", "-inf", "1e300", "-1", "0", "", "x", "1 2", "1e999", "1e-320", "0x10", "10" * 200, "1e9",
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


def mangled(text, rng):
    """A text with one to three numbers, words or pieces replaced, removed or doubled, or cut off."""
    for _ in range(rng.randint(1, 3)):
        kind = rng.choice(["number", "number", "number", "word", "tag", "double", "cut", "letter"])
        pattern = {"number": r"-?\d+(\.\d+)?(e-?\d+)?", "word": r"[A-Za-z_]{2,}"}.get(kind, r"<[^>]*>|[^<\n]+")
        pieces = [m.span() for m in re.finditer(pattern, text)] or [(0, len(text))]
        a, b = rng.choice(pieces)
        if kind == "number":
            text = text[:a] + rng.choice(SPELLED) + text[b:]
        elif kind == "word":
            c, d = rng.choice(pieces)
            text = text[:a] + text[c:d] + text[b:]
        elif kind == "letter":
            text = text[:a] + rng.choice(["\x1b", "\x00", "é", "{", '"', "-", "&x;", "*a", "\n", "#", "'"]) + text[a:]
        else:
            text = {"tag": text[:a] + text[b:], "double": text[:b] + text[a:], "cut": text[:b]}[kind]
    return text


def bent(data, rng):
    """Bytes with one to three of them changed, cut off or doubled."""
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


def changed(table, rng):
    """A table of JSON with one to three of its entries replaced, removed, or moved."""
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


def saved(path, rng, runs):
    """A saved run with its bytes bent, its data changed, or its arrays of other shapes."""
    source = rng.choice(runs)
    if rng.random() < 0.2:
        path.write_bytes(bent(source.read_bytes(), rng))
        return
    with np.load(source) as file:
        arrays = {name: file[name] for name in file.files}
    if rng.random() < 0.1:
        name = rng.choice(sorted(set(arrays) - {"meta"}))
        x = arrays[name]
        arrays[name] = rng.choice([x[:-1], x * np.nan, x[::-1], x.astype("<f4"), x.astype(int), x[..., None], x[:0]])
    else:
        arrays["meta"] = np.array(json.dumps(changed(json.loads(str(arrays["meta"])), rng)))
    np.savez(path, **arrays)


def models_of_runs(folder):
    """Saved runs of mechanisms that stand in files in different ways."""
    sys.path.insert(0, str(Path(__file__).parent))
    from chains import JOINTS, tree

    import mbdae

    kinds = sorted(JOINTS)
    made = [
        mbdae.Mechanism(tree(kinds, list(range(len(kinds))))),
        mbdae.load("four_bar"),
        mbdae.load(DATA / "robot"),
        mbdae.load(DATA / "mjcf" / "trees.xml"),
    ]
    paths = []
    for i, mech in enumerate(made):
        paths.append(folder / f"run{i}.npz")
        mbdae.solve(mech, (0, 1e-3), method="herk2", step=5e-4).save(paths[-1])
    return paths


class Mutants:
    """Makes mutants in a folder, one after another; the same seed makes the same file."""

    KINDS = ("urdf", "mjcf", "replicated", "toml", "parameters", "yaml", "sweep", "obj", "mtl", "stl", "dae", "saved")

    def __init__(self, folder):
        self.folder = folder
        self.runs = []
        self.inside = folder / "model"
        self.inside.mkdir()
        shutil.copy(DATA / "mjcf" / "materials.xml", self.inside)

    def make(self, kind, seed):
        """Write a mutant; return its path, with parameters."""
        rng, here = random.Random(f"{kind} {seed}"), self.inside
        match kind:
            case "urdf":
                return self._text("x.urdf", (DATA / "robot" / "robot.urdf").read_text(), rng)
            case "mjcf":
                name = rng.choice(["trees", "loops", "actuated"])
                return self._text("x.xml", (DATA / "mjcf" / f"{name}.xml").read_text(), rng)
            case "replicated":
                return self._text("x.xml", REPLICATED, rng)
            case "toml":
                from mbdae.mechanism.library import models_directory

                source = rng.choice(sorted(models_directory().glob("*/mechanism.toml")))
                for file in source.parent.glob("*.urdf"):
                    shutil.copy(file, here)
                return self._text("x.toml", source.read_text(), rng)
            case "parameters":
                (here / "tower.py").write_text(PARAMETRIC)
                return str(here / "tower.py") + "?" + mangled("floors=2&height=0.5", rng)
            case "yaml":
                shutil.copy(DATA / "robot" / "robot.urdf", here)
                return self._text("robot.yaml", (DATA / "robot" / "robot.yaml").read_text(), rng)
            case "sweep":
                return self._text("sweep.toml", rng.choice(SWEEPS), rng)
            case "obj" | "mtl" | "stl" | "dae":
                return self._mesh(kind, rng)
            case "saved":
                self.runs = self.runs or models_of_runs(self.folder)
                saved(here / "x.npz", rng, self.runs)
                return str(here / "x.npz")
        raise ValueError(kind)

    def _text(self, name, text, rng):
        (self.inside / name).write_text(mangled(text, rng), encoding="utf-8")
        return str(self.inside / name)

    def _mesh(self, kind, rng):
        here, files = self.inside, {"box.obj": CUBE, "box.mtl": MATERIAL, "box.stl": STL, "box.dae": DAE}
        for name, text in files.items():
            (here / name).write_text(text)
        name = f"box.{kind}"
        if kind == "stl" and rng.random() < 0.6:
            triangle = np.array([0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0], "<f4").tobytes() + b"\0\0"
            (here / name).write_bytes(bent(b"\0" * 80 + (1).to_bytes(4, "little") + triangle, rng))
        else:
            (here / name).write_text(mangled(files[name], rng), encoding="utf-8")
        (here / "shown.urdf").write_text(SHOWN.replace("NAME", "box.obj" if kind == "mtl" else name))
        return str(here / "shown.urdf")


class Enough(Exception):
    """The work goes on: it tells of its progress."""


def attempt(kind, path):
    """Use a file as the commands do; return what came of it in a word."""
    import mbdae
    from mbdae.studies.card import card
    from mbdae.studies.sweep import sweep
    from mbdae.studies.sweep_toml import read_sweep

    def tell(*_):
        raise Enough

    if kind == "sweep":
        arguments = {"max_steps": 2000, **read_sweep(path)}  # a run of an hour is no mistake, and shows its progress
        return "read" if sweep(**arguments, progress=tell) else "nothing"
    if kind == "saved":
        sol = mbdae.Solution.load(path)
        mech = sol.mechanism
        repr(sol), sol.signals(), sol((sol.t[0] + sol.t[-1]) / 2)
    else:
        mech = mbdae.load(path)
        sol = mbdae.solve(mech, (0.0, 1e-4), method="herk2", step=5e-5)
        assert np.isfinite(sol.q).all()
    str(card(mech))
    mbdae.animate(sol, Path(path.partition("?")[0]).with_name("page.html"))
    return sol.status


def child():
    """Answer for each kind and path on the standard input with a line: a word, or what went wrong."""
    from mbdae.errors import MbdaeError

    answers = sys.stdout
    sys.stdout = sys.stderr
    for line in sys.stdin:
        kind, path = json.loads(line)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                answer = attempt(kind, path)
        except Enough:
            answer = "busy"
        except MbdaeError as e:
            said = str(e)
            answer = type(e).__name__ if len(said.splitlines()) == 1 and said.isprintable() else f"! {said!r}"
        except BaseException as e:
            import traceback

            where = "; ".join(f"{f.name} {f.lineno}" for f in traceback.extract_tb(e.__traceback__)[-3:])
            answer = f"! {type(e).__name__}: {e} ({where})"
        print(json.dumps(answer), file=answers, flush=True)


class Child:
    """A process that tries files, started again after it ended."""

    def __init__(self):
        self.process = None

    def ask(self, kind, path):
        """What came of a file; what is wrong begins with ``!``."""
        if self.process is None or self.process.poll() is not None:
            self.process = subprocess.Popen(
                [sys.executable, __file__, "--child"],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            )  # fmt: skip
            self.process.stdin.write(json.dumps(["warm up", ""]) + "\n")
            self.process.stdin.flush()
            self._answer(60)
        self.process.stdin.write(json.dumps([kind, path]) + "\n")
        self.process.stdin.flush()
        return self._answer(PATIENCE)

    def _answer(self, patience):
        ready, _, _ = select.select([self.process.stdout], [], [], patience)
        line = self.process.stdout.readline() if ready else ""
        if line:
            return json.loads(line)
        if ready:
            return f"! the process ended with {self.process.wait()}"
        self.close()
        return f"! no answer in {patience:g} s"

    def close(self):
        """End the process."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process.stdin.close()
            self.process.stdout.close()
            self.process = None


def hunt(kinds, count, first=0, keep=None):
    """Try ``count`` mutants of each kind; return those that went wrong, and how often each answer came."""
    wrong, answers, worker = [], {}, Child()
    with tempfile.TemporaryDirectory() as folder:
        mutants = Mutants(Path(folder))
        try:
            for kind in kinds:
                for seed in range(first, first + count):
                    path = mutants.make(kind, seed)
                    answer = worker.ask(kind, path)
                    answers[kind, answer[:40]] = answers.get((kind, answer[:40]), 0) + 1
                    if answer.startswith("!"):
                        wrong.append(f"{kind} {seed}: {answer}")
                        if keep:
                            shutil.copytree(mutants.inside, keep / f"{kind}_{seed}", dirs_exist_ok=True)
                            print(wrong[-1], flush=True)
        finally:
            worker.close()
    return wrong, answers


def main():
    """Try many mutants, and say which went wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=2600, help="of all kinds together")
    parser.add_argument("--kinds", nargs="*", default=Mutants.KINDS)
    parser.add_argument("--first", type=int, default=0, help="seed of the first mutant of each kind")
    parser.add_argument("--keep", type=Path, default=Path("mutants"), help="folder for those that went wrong")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        child()
        return
    started = time.perf_counter()
    wrong, answers = hunt(args.kinds, -(-args.count // len(args.kinds)), args.first, args.keep)
    for (kind, answer), n in sorted(answers.items()):
        print(f"{n:6d} {kind:10s} {answer}")
    print(f"{len(wrong)} went wrong, {time.perf_counter() - started:.0f} s")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
