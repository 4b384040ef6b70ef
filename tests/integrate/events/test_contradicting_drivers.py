"""Drivers that part smoothly from what closures and other drivers admit: a run ends there, and names them.

The second driver differs by c t^p from what the first one and the closures prescribe: all agree to p - 1 derivatives
at t = 0. Which level of the constraints shows it first depends on the method.
"""

import re

import numpy as np
import pytest
from bodies import body, load
from motions import FAR
from shared import shared_model
from unit_systems import UNIT_SYSTEMS

import mbdae
from mbdae import Closure, Driver, Mechanism

RADIUS = 0.1
FARTHER = 1e3 * FAR  # s: smallest steps of 2e-6 s, where the ends of runs are known less precisely than by dead points
NAMES = r"('one' and 'other'|'other' and 'one').* contradict each other"


def pair(mech, one, other, begin, rates, c, p):
    """The mechanism with two drivers; the second one's motion departs by c t^p."""
    first = Driver.polynomial(one, [begin, rates[0]], name="one")
    second = Driver.polynomial(other, [begin, rates[1], *[0.0] * (p - 2), c], name="other")
    return Mechanism(mech.model, mech.closures, drivers=[first, second])


def same_joint(_, c, p):
    mech = shared_model("four_bar")
    return pair(mech, "crank", "crank", float(mech.start[0][0]), (1.0, 1.0), c, p)


def gears(folder, c, p):
    wheels = [body(name, "continuous", axis=[0.0, 0.0, 1.0], xyz=[x, 0.0, 0.0]) for name, x in (("a", 0.0), ("b", 3.0))]
    mesh = Closure(kind="coupling", joints=("b", "a"), coefficients=(0.0, -2.0), name="mesh")
    return pair(load(folder, wheels, [mesh]), "a", "b", 0.0, (1.0, -2.0), c, p)


def wheel(folder, c, p):
    """A wheel that rolls on the ground, driven by its hub and by its carriage."""
    carriage = body("carriage", "prismatic", axis=[1.0, 0.0, 0.0], xyz=[0.0, 0.0, RADIUS])
    hub = body("hub", "continuous", "carriage", axis=[0.0, 1.0, 0.0])
    road = {"kind": "rolling", "frames": ("world", "hub"), "radius": RADIUS, "axis": (0.0, 1.0, 0.0), "contact": False}
    mech = load(folder, [carriage, hub], [Closure(**road, name="road")])
    return pair(mech, "hub", "carriage", 0.0, (1.0, RADIUS), RADIUS * c, p)


SCENES = {"same joint": same_joint, "gears": gears, "wheel": wheel}


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("method", ["pherk5", "herk4", "radau5"])
@pytest.mark.parametrize(("c", "p"), [(0.5, 2), (0.5, 4), (1e-3, 3)])
@pytest.mark.parametrize("scene", SCENES)
def test_a_run_ends_where_drivers_part(tmp_path, scene, c, p, method):
    sol = mbdae.solve(SCENES[scene](tmp_path, c, p), (0, FARTHER), method=method, max_steps=2000)
    assert sol.status in ("driver", "newton")
    np.testing.assert_array_less(c * sol.t[-1] ** p, 1e-6)
    assert re.search(NAMES, sol.message), sol.message


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{"method": "pherk5"}, {"method": "radau5"}, {"step": 0.01}], ids=str)
@pytest.mark.parametrize("scene", SCENES)
def test_the_stabilized_form_ends_there_too(tmp_path, scene, options):
    """Position rows end the run of a joint and of gears, speeds that of a wheel, whose rolling has no position rows."""
    sol = mbdae.solve(SCENES[scene](tmp_path, 0.5, 4), (0, FAR), formulation="ggl", max_steps=2000, **options)
    assert sol.status in ("rank", "driver")
    np.testing.assert_array_less(0.5 * sol.t[-1] ** 4, 1e-6)
    assert re.search(NAMES, sol.message), sol.message


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{"project": False}, {"step": 0.01}, {"formulation": "index1"}], ids=str)
@pytest.mark.parametrize("scene", SCENES)
def test_runs_that_project_nothing_name_them_at_the_end(tmp_path, scene, options):
    options = {"method": "dop853", **options} if "formulation" in options else options
    sol = mbdae.solve(SCENES[scene](tmp_path, 0.5, 4), (0, 1), **options)
    assert sol.status == "doubtful"
    assert re.search(r"('one'|'other') and .*('one'|'other').* contradict each other", sol.message), sol.message


@pytest.mark.parametrize("formulation", ["index2", "ggl"])
@pytest.mark.parametrize("options", [{"step": 0.02}, {}], ids=str)
@pytest.mark.parametrize("name", ["four_bar", "bricard"])
def test_a_driven_overconstrained_loop_is_no_contradiction(name, options, formulation):
    """Its redundant rows are kept to the drift of the run alone."""
    mech = shared_model(name)
    driver = Driver.at_speed(mech.model.names[1], 0.5, start=mech.start[0][0])
    sol = mbdae.solve(mbdae.load(name, drivers=[driver]), (0, 1), formulation=formulation, **options)
    assert "contradict" not in sol.message
    assert sol.t[-1] == 1, sol.message


@pytest.mark.parametrize("units", UNIT_SYSTEMS[1:], ids=lambda units: units.name)
@pytest.mark.parametrize("method", ["pherk5", "radau5"])
def test_drivers_part_in_all_units(method, units):
    def run(mech, units):
        atol = 1e-9 * np.concatenate([units.coordinates(mech), units.speeds(mech), [units.energy]])
        options = {"rtol": 1e-7, "atol": atol, "first_step": 1e-3 * units.time, "max_steps": 2000}
        return mbdae.solve(mech, (0, FAR * units.time), method=method, **options)

    mech = same_joint(None, 0.5, 4)
    known, found = run(mech, UNIT_SYSTEMS[0]), run(units.mechanism(mech), units)
    assert found.status == known.status
    np.testing.assert_allclose(found.t[-1], known.t[-1] * units.time, rtol=1e-6)


@pytest.mark.parametrize("scene", SCENES)
def test_equal_drivers_are_no_contradiction(tmp_path, scene):
    sol = mbdae.solve(SCENES[scene](tmp_path, 0.0, 3), (0, 1))
    assert sol.success, sol.message


def valve(folder, *lift):
    """A valve that a spring presses on its seat, and on a cam without clearance."""
    slides = [body(name, "prismatic", axis=[1.0, 0.0, 0.0]) for name in ("cam", "valve")]
    tree = load(folder, slides, [])
    seat = mbdae.Stop(joint="valve", lower=0.0, name="seat")
    contact = mbdae.Stop(joints=("valve", "cam"), coefficients=(0.0, 1.0), lower=0.0, name="contact")
    spring = mbdae.JointTorque(joint="valve", torque=-10.0)
    driver = Driver.polynomial("cam", lift, name="lift")
    return Mechanism(tree.model, forces=[spring], drivers=[driver], stops=[seat, contact])


def test_contacts_that_are_closed_without_clearance_are_named(tmp_path):
    """Normal forces are not unique at the start, and neither contact opens where the cam lifts."""
    mech = valve(tmp_path, 0.0, 0.0, 0.0, 0.1)
    sol = mbdae.solve(mech, (0, 1), *mech.assemble())
    assert sol.status == "driver"
    assert "'seat' and 'contact' are closed without clearance between them: give one of them a gap" in sol.message


@pytest.mark.usefixtures("back_end")
def test_a_cam_without_clearance_opens_the_valve(tmp_path):
    """It accelerates from the start: the seat exerts no force, the cam that of the spring and m a."""
    mech = valve(tmp_path, 0.0, 0.0, 0.5)
    sol = mbdae.solve(mech, (0, 1), *mech.assemble())
    assert sol.success, sol.message
    np.testing.assert_allclose(sol.q[:, 1], sol.t**2 / 2, atol=1e-12)
    efforts = sol.signals(["effort.contact", "effort.seat"])
    np.testing.assert_allclose(efforts["effort.contact"], 10.0 + mech.model.inertias[2].mass, rtol=1e-9)
    assert not efforts["effort.seat"].any()
