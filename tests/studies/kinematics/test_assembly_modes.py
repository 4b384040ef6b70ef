"""Assembly modes against brute force: intersections of circles on grids; random loops with known numbers of modes."""

import importlib
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from linkages import LINK, PIVOT, TIP, bar, four_bar, parallelogram, stephenson
from scipy.optimize import brentq

import mbdae
from mbdae import Closure, Mechanism, assembly_modes
from mbdae.errors import InputError
from mbdae.mechanism.model_settings import Start
from mbdae.studies.kinematics.curve import circuits

SCRIPTS = Path(__file__).parents[3] / "examples" / "benchmarks"


def unit(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def roots(f, n=4000):
    """Zeros of a function of an angle, found from a grid."""
    grid = np.linspace(-np.pi, np.pi, n)
    values = [f(x) for x in grid]
    found = [brentq(f, a, b) for a, b, x, y in zip(grid, grid[1:], values, values[1:], strict=False) if x * y < 0]
    return [x for x in found if abs(f(x)) < 1e-6]


def by_coupler(theta):
    """Coupler angles that close the four-bar."""
    pivot = np.array([LINK["ground"], 0.0])
    tip = LINK["crank"] * unit(theta)
    return roots(lambda x: np.linalg.norm(tip + LINK["coupler"] * unit(x) - pivot) - LINK["rocker"])


def third(theta, phi):
    return LINK["crank"] * unit(theta) + TIP[0] * unit(phi) + TIP[1] * unit(phi + np.pi / 2)


def test_four_bar_has_two():
    found = assembly_modes(mbdae.load("four_bar"), "crank")
    assert [m.label for m in found.modes] == ["1a", "2a"]  # a Grashof linkage: two circuits
    expected = np.sort([x - 1.2 for x in by_coupler(1.2)])
    np.testing.assert_allclose(np.sort([m.q[1] for m in found.modes]), expected, atol=1e-9)
    np.testing.assert_allclose(found.modes[0].q, mbdae.load("four_bar").start[0], atol=1e-9)
    assert "2 assembly modes" in str(found)


def test_four_bar_by_its_rocker_has_two_on_one_circuit():
    found = assembly_modes(mbdae.load("four_bar"), "rocker")
    assert [(m.label, m.rising) for m in found.modes] == [("1a", True), ("1b", False)]


def test_stephenson_by_its_crank_has_four():
    found = assembly_modes(stephenson(), "crank")
    expected = []
    for phi in by_coupler(1.2):
        span = np.array(PIVOT) - third(1.2, phi)
        levers = roots(lambda x, d=span: np.linalg.norm(d + LINK["lever"] * unit(x)) - LINK["arm"])
        expected += [(phi - 1.2, lever) for lever in levers]
    assert len(found.modes) == len(expected) == 4
    wrapped = [((m.q[1] + np.pi) % (2 * np.pi) - np.pi, (m.q[4] + np.pi) % (2 * np.pi) - np.pi) for m in found.modes]
    expected = [((a + np.pi) % (2 * np.pi) - np.pi, b) for a, b in expected]
    for pose in expected:
        np.testing.assert_allclose(min(wrapped, key=lambda x, y=pose: np.hypot(*np.subtract(x, y))), pose, atol=1e-8)


@pytest.mark.parametrize("lever", [2.4, -2.7, 3.0])
def test_stephenson_by_its_lever_has_as_many_as_the_coupler_curve_crosses_a_circle(lever):
    found = assembly_modes(stephenson(), "lever", lever)
    centre, count = np.array(PIVOT) + LINK["lever"] * unit(lever), 0
    grid = np.linspace(-np.pi, np.pi, 1500)
    for side in (0, 1):
        values = []
        for theta in grid:
            tip, pivot = LINK["crank"] * unit(theta), np.array([LINK["ground"], 0.0])
            span = pivot - tip
            d = np.linalg.norm(span)
            bend = np.arccos((LINK["coupler"] ** 2 + d**2 - LINK["rocker"] ** 2) / (2 * LINK["coupler"] * d))
            phi = np.arctan2(span[1], span[0]) + (1, -1)[side] * bend
            values.append(np.linalg.norm(third(theta, phi) - centre) - LINK["arm"])
        count += int((np.diff(np.sign(values)) != 0).sum())
    assert len(found.modes) == count
    assert count >= 2


@pytest.mark.slow
def test_modes_are_distinguished_by_named_joints():
    mech = mbdae.load("stewart_platform")
    legs = [f"piston_{i}" for i in range(2, 7)]
    found = assembly_modes(mech, "piston_1", hold=legs, apart="platform", most=150)
    places = np.array([m.q[:3] for m in found.modes])
    assert 2 <= len(places) <= 40  # at most forty solutions: Dietmaier (1998)
    near = np.linalg.norm(places[:, None] - places, axis=2) + np.eye(len(places))
    assert near.min() > 1e-6


def test_where_it_does_not_reach_there_is_none():
    with pytest.raises(InputError, match="no pose was found at 'rocker' = 3"):
        assembly_modes(mbdae.load("four_bar"), "rocker", 3.0, most=100)


@pytest.fixture
def ensembles(monkeypatch):
    """Random mechanisms, and the number of their modes by a polynomial in one unknown."""
    monkeypatch.syspath_prepend(SCRIPTS)
    return importlib.import_module("assembly_modes")


@pytest.mark.slow
@pytest.mark.parametrize(("family", "cases"), [("platform", 14), ("platform of legs", 4), ("rssr", 6), ("wrist", 2)])
def test_no_mode_of_a_random_loop_is_missed(ensembles, family, cases):
    found = ensembles.ensemble(family, cases)
    assert found.missed == []
    assert found.surplus == []
    assert max(found.counts) >= {"platform": 6, "rssr": 2}.get(family, 4)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-3, 1e5])
def test_the_size_of_a_platform_does_not_matter(ensembles, scale):
    case = ensembles.platform(12, scale=scale)
    found = assembly_modes(case.mech, case.drive)
    assert len(found.modes) == case.count == 6
    same = assembly_modes(ensembles.platform(12).mech, case.drive)
    unit = np.array([scale, scale, 1, 1])
    np.testing.assert_allclose([m.q / unit for m in found.modes], [m.q for m in same.modes], atol=1e-9)


def test_how_many_starts_agreed_is_said():
    found = assembly_modes(mbdae.load("four_bar"), "crank")
    first, *_ = str(found).splitlines()
    words = re.search(
        r"from (\d+) starts of which (\d+) closed; the rarest was found (\d+) times; .* 1 in (\d+) of", first
    )
    starts, closed, rarest, share = map(int, words.groups())
    assert starts == found.starts >= closed == found.closed == sum(m.hits for m in found.modes)
    assert rarest == min(m.hits for m in found.modes) >= 3
    assert closed >= 3 * np.log(3 / 0.01)  # one more mode as easy as these two would be missed in 1 of 100
    assert share == closed // 3  # with 95 % certainty
    assert not found.warnings


def test_too_few_starts_are_said():
    found = assembly_modes(stephenson(), "lever", -2.7, most=4)
    assert found.starts == 4
    assert "4 starts are too few" in found.warnings[0]
    assert "doubtful: 4 starts are too few" in str(found)


def test_a_circuit_that_is_not_closed_is_doubtful():
    """A crank geared to a slider: it slides without bound."""
    model = pin.Model()
    bar(model, 0, (0, 0), 1.0, "crank")
    slide = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(slide, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    mech = Mechanism(model, [Closure.coupling("slide", "crank", (0.1, 0.3))])
    found = assembly_modes(mech, "crank", 0.5)
    assert [m.q[1] for m in found.modes] == pytest.approx([0.1 + 0.3 * 0.5])
    assert found.warnings == ("circuit 1: it was not traced back to its first pose",)


def test_a_rack_has_one_pose_and_one_equilibrium_at_each_of_its_positions():
    """A pinion turns as often as it likes; a spring of 50 N/m carries the rack of 2 kg at -m g/k, without a warning."""
    rack = {"name": "rack", "parent": "world", "joint": "prismatic", "mass": 2.0}
    pinion = {"name": "pinion", "parent": "world", "inertia": [0.1, 0.1, 0.1, 0, 0, 0]}
    mesh = {"kind": "coupling", "joints": ["rack", "pinion"], "coefficients": [0, 0.1]}
    spring = {"kind": "joint_spring", "joint": "rack", "stiffness": 50.0}
    tables = {"body": [rack, pinion], "closure": [mesh], "force": [spring]}
    found = assembly_modes(tables, "rack", 0.3)
    assert [m.q[1] for m in found.modes] == pytest.approx([3.0])
    assert not found.warnings
    rounding = replace(found.modes[0], q=np.array([-6e-55, 3.0]))
    assert "rack 0 m, pinion 3 rad; rack" in str(replace(found, modes=[rounding]))
    (rest,) = mbdae.equilibria(tables, "rack", span=(-1, 1))
    assert rest.q[0] == pytest.approx(-2.0 * 9.81 / 50.0, rel=1e-12)


def test_a_missed_passage_of_the_input_is_doubtful(monkeypatch):
    """On one circuit an input that reverses rises as often as it falls."""
    whole = circuits._crossings_of
    monkeypatch.setattr(circuits, "_crossings_of", lambda curve, u: whole(curve, u)[:1])
    found = assembly_modes(mbdae.load("four_bar"), "rocker")
    assert any("is inconsistent" in warning for warning in found.warnings)


def test_a_crank_that_turns_for_ever_closes_its_circuit_after_a_turn():
    """Double crank: 1.0 is the ground; each of two circuits has the crank's value once a turn, the degree is 1."""
    linkage = four_bar((2.0, 1.8, 2.2, 1.0), {"q": {"crank": 1.0}, "guess": {"coupler": -2.0, "rocker": 1.5}})
    found = assembly_modes(linkage, "crank")
    assert [m.label for m in found.modes] == ["1a", "2a"]
    assert found.warnings == ()
    assert all(m.rising for m in found.modes)


def test_a_coupling_that_counts_turns_has_one_mode():
    """Wheels of ratio 3: after a turn of the large one the small one meshes elsewhere, which is no other assembly."""
    model = pin.Model()
    bar(model, 0, (0, 0), 1.0, "large")
    bar(model, 0, (4.0, 0), 1.0, "small")
    mech = Mechanism(model, [Closure.coupling("large", "small", (0.0, 3.0))], start=Start(q={"large": 0.3}))
    found = assembly_modes(mech, "large")
    np.testing.assert_allclose([m.q for m in found.modes], [[0.3, 0.1]], atol=1e-12)
    assert found.warnings == ()


@pytest.mark.parametrize("counts", [pin.JointModelRY, pin.JointModelPX])
@pytest.mark.parametrize("mesh", [("wheel", "rocker", (0.1, 1 / 2)), ("rocker", "wheel", (0.1, 1 / 0.37))])
def test_a_wheel_or_a_rack_that_counts_turns_of_a_linkage_adds_no_modes(counts, mesh):
    """The rocker's angle closes the linkage up to full turns, after each of which the wheel meshes elsewhere."""
    plain = mbdae.load("four_bar")
    model = plain.model.copy()
    wheel = model.addJoint(0, counts(), pin.SE3.Identity(), "wheel")
    model.appendBodyToJoint(wheel, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    mech = Mechanism(model, [*plain.closures, Closure.coupling(*mesh)], start=plain.start_values)
    found = assembly_modes(mech, "crank")
    tips = [LINK["crank"] * unit(1.2) + LINK["coupler"] * unit(x) for x in sorted(by_coupler(1.2), reverse=True)]
    rockers = [np.arctan2(y, x - LINK["ground"]) for x, y in tips]
    turns = [(m.q[2] - alone) / (2 * np.pi) for m, alone in zip(found.modes, rockers, strict=True)]
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)
    assert found.warnings == ()
    assert len(assembly_modes(mech, "crank", apart="wheel", most=10).modes) > 2


def test_a_parallelogram_has_a_mode_on_each_of_its_branches():
    found = assembly_modes(parallelogram(), "crank")
    assert len(found.modes) == 2
    assert found.warnings == ()


def test_poses_that_are_not_isolated_end_the_search():
    """A parallelogram is in line at crank = 0, and its rocker rotates about the crank's tip while the crank rests."""
    found = assembly_modes("n_four_bar", "crank_0", 0.0)
    assert found.warnings == ("poses are not isolated: the mechanism can move while the input is locked",)
    assert found.starts < 200
    assert all(m.margin < 1e-9 for m in found.modes)
