"""Units of parameters by their dotted names, from dimensional analysis, and of the functions of time of forces."""

import pytest

import mbdae
from mbdae.mechanism.formats.mechanism_file.parameter_units import function_units, parameter_unit
from mbdae.mechanism.formats.mechanism_file.template import Template
from mbdae.units import substituted

FILE = """
[[body]]
name = "crank"
parent = "world"
joint = "revolute"
axis = [0, 1, 0]
mass = 2.0
com = [0.1, 0, 0]
inertia = [0.01, 0.01, 0.01, 0, 0, 0]
[[body]]
name = "slide"
parent = "world"
joint = "prismatic"
axis = [0, 0, 1]
mass = 1.0
[[force]]
name = "hinge spring"
kind = "joint_spring"
joint = "crank"
stiffness = 1.0
damping = 0.1
[[force]]
name = "coil"
kind = "joint_spring"
joint = "slide"
stiffness = 10.0
[[force]]
name = "motor"
kind = "dc_motor"
joint = "crank"
voltage = 12.0
resistance = 1.0
constant = 0.1
[[force]]
name = "drive"
kind = "joint_pid"
joint = "slide"
kp = 5.0
reference = { kind = "harmonic", amplitude = 0.1, omega = 3.0 }
[start]
q = { crank = 0.1, slide = 0.2 }
v = { crank = 1.0 }
"""
UNITS = {
    "gravity.2": "m/s^2",
    "body.crank.mass": "kg",
    "body.crank.inertia.1": "kg m^2",
    "force.hinge spring.stiffness": "N m/rad",
    "force.hinge spring.damping": "N m s/rad",
    "force.coil.stiffness": "N/m",
    "force.motor.voltage": "V",
    "force.motor.gear": "",  # of the angle of the rotor over that of the joint
    "force.drive.kp": "N/m",
    "force.drive.reference.amplitude": "m",
    "force.drive.reference.omega": "rad/s",
    "start.q.crank": "rad",
    "start.q.slide": "m",
    "start.v.crank": "rad/s",
    "duration": "s",
}


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("units") / "machine.toml"
    path.write_text(FILE)
    return path


def test_units_follow_the_kind_of_joint(path):
    template = Template(path)
    assert {name: parameter_unit(template, name) for name in UNITS} == UNITS


def test_functions_of_time_have_the_units_of_their_keys(path):
    assert function_units(mbdae.load(path)) == {"motor": "V", "drive": "m"}


@pytest.mark.parametrize(
    ("unit", "symbols", "expected"),
    [
        ("e s/q", {"e": "N m", "q": "rad"}, "N m s/rad"),
        ("y/x", {"y": "m", "x": "N"}, "m/N"),
        ("y/x", {"y": "rad/s", "x": "rad"}, "1/s"),
        ("y/x", {"y": "m", "x": "m"}, ""),
        ("e/q", {"e": "N"}, ""),  # a symbol that is unknown
    ],
)
def test_symbols_are_replaced_by_their_units(unit, symbols, expected):
    assert substituted(unit, symbols) == expected
