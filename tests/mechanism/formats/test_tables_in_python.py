"""Mechanisms from tables in Python, without a file."""

from math import pi

import numpy as np
import pytest

import mbdae
from mbdae.errors import InputError, MbdaeError, UnknownNameError

MASS, INERTIA, LEAD = 5.0, 2e-3, 0.02
NUT = {"name": "nut", "parent": "world", "joint": "prismatic", "axis": [0, 0, 1], "mass": MASS}
TURNS = {"joint": "revolute", "axis": [0, 0, 1]}
SPINDLE = {"name": "spindle", "parent": "nut", "inertia": [INERTIA] * 3 + [0] * 3, **TURNS}
JACK = {
    "title": "Screw jack",
    "gravity": [0.0, 0.0, -9.81],
    "body": [NUT, SPINDLE],
    "closure": [{"name": "thread", "kind": "screw", "frames": ["world", "spindle"], "lead": LEAD}],
}


def fall(mass: float, lead: float) -> float:
    """Displacement after 1 s: the inertia of the spindle acts as a mass, by the square of the transmission ratio."""
    return -0.5 * 9.81 * mass / (mass + INERTIA * (2 * pi / lead) ** 2)


def test_tables_are_a_mechanism() -> None:
    mech = mbdae.load(JACK)
    assert mech.title == "Screw jack"
    assert mbdae.solve(mech, (0, 1), rtol=1e-9).q[-1, 0] == pytest.approx(fall(MASS, LEAD), rel=1e-9)


def test_their_parameters_can_be_varied() -> None:
    runs = mbdae.sweep(mbdae.load(JACK), {"closure.thread.lead": [0.01, 0.04]}, 1.0, outputs=["final q.nut"], rtol=1e-9)
    assert runs["final q.nut"] == pytest.approx([fall(MASS, 0.01), fall(MASS, 0.04)], rel=1e-9)
    runs = mbdae.sweep(mbdae.load(JACK), {"body.nut.mass": [1.0, 9.0]}, 1.0, outputs=["final q.nut"], rtol=1e-9)
    assert runs["final q.nut"] == pytest.approx([fall(1.0, LEAD), fall(9.0, LEAD)], rel=1e-9)


ENDLESS: dict[str, object] = {}
ENDLESS["body"] = [ENDLESS]
MASSES = {"body.rod.mass": [1.0, 9.0]}
PENDULUM = {"body": [{"name": "rod", "parent": "world", "axis": [0, 1, 0], "mass": 1.0, "com": [0.0, 0.0, -1.0]}]}
SWING = {"force": [{"kind": "joint_spring", "joint": "rod", "stiffness": 2.0}], "start": {"q": {"rod": 0.3}}}
STUDIES = {
    "solve": lambda m: mbdae.solve(m, 1.0).q,
    "Simulator": lambda m: mbdae.Simulator(m).q,
    "root_locus": lambda m: mbdae.root_locus(m, "body.rod.mass", [1.0, 9.0]).eigenvalues,
    "sweep": lambda m: mbdae.sweep(m, MASSES, 1.0, outputs=["final q.rod"])["final q.rod"],
    "ensemble": lambda m: mbdae.ensemble(m, parameters=MASSES, t_span=1.0).q,
}


@pytest.mark.parametrize("study", STUDIES)
def test_studies_take_them(study) -> None:
    np.testing.assert_array_equal(STUDIES[study](PENDULUM | SWING), STUDIES[study](mbdae.load(PENDULUM | SWING)))


def test_files_are_sought_in_the_current_folder(tmp_path, monkeypatch) -> None:
    (tmp_path / "arm.urdf").write_text(
        '<robot name="arm"><link name="base"/><link name="rod"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/></joint></robot>'
    )
    monkeypatch.chdir(tmp_path)
    assert [*mbdae.load({"source": {"file": "arm.urdf"}}).model.names][1:] == ["hinge"]


@pytest.mark.parametrize(
    ("given", "kind", "text"),
    [
        ({}, InputError, "the tables: mechanism: a mechanism needs a source, a \\[\\[body\\]\\]"),
        (JACK | {"bodies": []}, InputError, "the tables: unknown key bodies; known: body, closure"),
        (JACK | {"body": [NUT, SPINDLE | {"parent": "nat"}]}, UnknownNameError, "tables: body.spindle.parent: .*nat"),
        (ENDLESS, InputError, "the tables: its tables are nested too deeply"),
        (42, InputError, "a mechanism is the name of a model, a path or a dict of tables, got 42"),
    ],
)
def test_mistakes_are_named(given: object, kind: type[MbdaeError], text: str) -> None:
    with pytest.raises(kind, match=text):
        mbdae.load(given)  # type: ignore[arg-type]


def test_tables_have_no_parameters() -> None:
    with pytest.raises(UnknownNameError, match="parameter of the tables 'floors'"):
        mbdae.load(JACK, floors=3)
