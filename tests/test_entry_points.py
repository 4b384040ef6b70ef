"""Plug-ins: methods, forces and readers by entry points, and errors in them by name."""

import subprocess
import sys
from pathlib import Path

import pytest

METHODS = """\
from mbdae.methods.tableau import Tableau

ralston = Tableau("ralston3", A="0\\n1/2\\n0 3/4", b="2/9 1/3 4/9")
taken = Tableau("herk1", A=((),), b=("1",))
"""
FORCES = '''\
import numpy as np
from typing import Literal
from mbdae.mechanism.forces.force import Force, ForceElement, single_velocity_joint


class HouseDrag(Force):
    """tau = -drag |v| v."""

    kind: Literal["house_drag"] = "house_drag"
    joint: str
    drag: float

    def bind(self, model, data):
        return HouseElement(self.name, single_velocity_joint(model, self.joint, "a house_drag").idx_v, self.drag)


class HouseElement(ForceElement):
    """Its law."""

    def __init__(self, name, i, c):
        super().__init__(name)
        self.i, self.c = i, c

    def generalized_force(self, t, q, v):
        tau = np.zeros(len(v))
        tau[self.i] = -self.c * abs(v[self.i]) * v[self.i]
        return 0.0, tau
'''
CLOSURES = '''\
from typing import Literal
from mbdae.mechanism.closures.frame_joint import TwoAxisJoint
from mbdae.mechanism.closures.kinds.point import PointClosure


class HouseClosure(TwoAxisJoint):
    """3 rows: b moves in the plane of a that the axis is normal to."""

    kind: Literal["house_plane"] = "house_plane"
    translation, direction = "along", "axis"


class Second(PointClosure):
    """3 rows: a point once more."""
'''
READERS = """\
import numpy as np
import pinocchio as pin
from mbdae.mechanism.formats.reader import Reader
from mbdae.mechanism.imported_model import ImportedModel


def pendulums(path):
    n = int(path.read_text())
    return "title = 'read'\\n" + "".join(
        f"[[body]]\\nname = 'b{i}'\\nparent = '{'world' if not i else f'b{i - 1}'}'\\njoint = 'revolute'\\n"
        f"axis = [0, 1, 0]\\nxyz = [0, 0, -1]\\nmass = 1.0\\ncom = [0, 0, -1]\\n"
        "inertia = [0.1, 0.1, 0.1, 0, 0, 0]\\n"
        for i in range(n)
    )


def dumbbells(path, places, source):
    model = pin.Model()
    for i in range(int(path.read_text())):
        number = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"d{i}")
        model.appendBodyToJoint(number, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    return ImportedModel(model, None, dict, left_out=("paint",))


dumb = Reader("dumbbells", (".dumb",), dumbbells)
taken = Reader("other", (".other", ".sdf"), dumbbells)
"""
POINTS = """
[mbdae.methods]
ralston3 = house_methods:ralston
taken = house_methods:taken
gone = house_methods:gone
[mbdae.forces]
house_drag = house_forces:HouseDrag
[mbdae.closures]
house_plane = house_closures:HouseClosure
second = house_closures:Second
[mbdae.readers]
hut = house_readers:pendulums
dumb = house_readers:dumb
taken = house_readers:taken
"""
PROGRAM = """
import warnings
with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    import mbdae
    mbdae.METHODS, mbdae.load
print(*(str(w.message) for w in said if "entry point" in str(w.message)), sep="\\n")
mech = mbdae.load("a.hut", forces=[mbdae.HouseDrag(joint="b1", drag=2.0)])
sol = mbdae.solve(mech, (0, 0.1), method="ralston3", step=0.01, backend="python")
print(mech.nv, sol.status, "power.house_drag 1" in sol.signals())
with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    print(mbdae.load("c.dumb").nv, said[0].message)
plane = mbdae.Mechanism(mech.model, [mbdae.Closure(kind="house_plane", frames=("b1", "world"))])
print(plane.ng, plane.row_names[0])
for wrong in (
    lambda: mbdae.load("b.hut"),
    lambda: mbdae.solve(mech, (0, 0.1), method="radau5"),
    lambda: mbdae.load("c.dumb", free_flyer=True),
    lambda: mbdae.load("d.other"),
):
    try:
        wrong()
    except mbdae.MbdaeError as e:
        print(e)
"""


@pytest.fixture
def house(tmp_path):
    for name, text in (("methods", METHODS), ("forces", FORCES), ("closures", CLOSURES), ("readers", READERS)):
        (tmp_path / f"house_{name}.py").write_text(text)
    info = tmp_path / "house-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: house\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(POINTS)
    (tmp_path / "a.hut").write_text("2")
    (tmp_path / "b.hut").write_text("two")
    (tmp_path / "c.dumb").write_text("3")
    (tmp_path / "d.other").write_text("3")
    return tmp_path


@pytest.mark.slow
def test_what_packages_add_is_found_and_what_is_wrong_is_named(house):
    root = str(Path(__file__).parent.parent)
    code = f"import sys; sys.path[:0] = [{str(house)!r}, {root!r}]\n{PROGRAM}"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=house, timeout=120)
    assert out.returncode == 0, out.stderr
    lines = out.stdout.splitlines()
    left_out = "of mbdae.{} in house is ignored: {}"
    warned = "".join(lines[:4])
    assert "entry point 'taken' " + left_out.format("methods", "expected a Tableau of a new name") in warned
    assert "entry point 'gone' " + left_out.format("methods", "AttributeError") in warned
    assert "entry point 'second' " + left_out.format("closures", "expected a class of closures with a new") in warned
    assert "entry point 'taken' " + left_out.format("readers", "expected a function of a path, or a Reader") in warned
    assert lines[4] == "2 finished True"
    assert lines[5] == "18 c: not carried over: paint"
    assert lines[6] == "3 b1-world"
    assert "the reader of .hut files fails on" in lines[7]
    assert lines[8].startswith("force 'house_drag 1' has no partials: implicit methods")
    assert lines[9] == "free_flyer does not belong to c.dumb"
    assert lines[10].startswith("cannot read d.other: expected a .toml, .py, ")
