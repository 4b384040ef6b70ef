"""Kinematics, assembly modes and inverse dynamics of five mechanisms in (mm, t, s), (km, g, h), Ms and us."""

import numpy as np
import pytest
from unit_systems import UNIT_SYSTEMS, UnitSystem

import mbdae
from mbdae import Mechanism, Stop
from mbdae.mechanism.tree.joints import angle_components

LEGS = [f"piston_{i}" for i in range(2, 7)]
DRIVES = {  # input, locked joints, a range without dead points
    "four_bar": ("rocker", [], (1.2, 2.4)),
    "slider_crank": ("slider", [], (0.3, 0.4)),
    "spatial_slider_crank": ("crank", [], (0.0, 3.0)),
    "stewart_platform": ("piston_1", LEGS, (0.31, 0.33)),
    "delta_robot": ("arm_1", ["arm_2", "arm_3"], (0.3, 0.6)),
}
WITHIN = 1e-9


def near(found, expected, factor=1.0):
    """The same values to 1e-9 of the largest of them."""
    found, expected = np.asarray(found) / factor, np.asarray(expected)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(expected))
    assert np.nanmax(np.abs(found - expected), initial=0.0) <= WITHIN * np.nanmax(np.abs(expected), initial=1e-12)


@pytest.mark.parametrize("name", DRIVES)
def test_kinematics_know_no_units(name):
    mech, (drive, hold, _) = mbdae.load(name), DRIVES[name]
    expected = mbdae.kinematics(mech, drive, hold=hold, points=31)
    assert expected.dead_points or name == "spatial_slider_crank"
    for units in UNIT_SYSTEMS[1:]:
        found = mbdae.kinematics(units.mechanism(mech), drive, hold=hold, points=31)
        u, x = units.length if found.unit == "m" else 1.0, units.coordinates(mech)
        near(found.u, expected.u, u)
        near(found.q, expected.q, units.configuration(mech))
        near(found.rates, expected.rates, x / u)
        near(found.accelerations, expected.accelerations, x / u**2)
        near([p[0] for p in found.dead_points], [p[0] for p in expected.dead_points], u)
        assert found.segments[0].ended == expected.segments[0].ended
        if expected.output:
            near(found.transmission, expected.transmission)


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in DRIVES if n != "delta_robot"])
def test_assembly_modes_know_no_units(name):
    mech, (drive, hold, _) = mbdae.load(name), DRIVES[name]
    apart = "platform" if name == "stewart_platform" else ()
    most = 8 if apart else 20
    expected = mbdae.assembly_modes(mech, drive, hold=hold, apart=apart, most=most)
    for units in UNIT_SYSTEMS[1:]:
        found = mbdae.assembly_modes(units.mechanism(mech), drive, hold=hold, apart=apart, most=most)
        assert str(found).splitlines()[0].partition(", on")[2] == str(expected).splitlines()[0].partition(", on")[2]
        assert [(m.label, m.rising, m.hits) for m in found.modes] == [
            (m.label, m.rising, m.hits) for m in expected.modes
        ]
        for a, b in zip(
            found.modes, expected.modes, strict=True
        ):  # up to full turns: some are half a turn off the start
            x = mech.manifold.difference(b.q, a.q / units.configuration(mech))
            x -= 2 * np.pi * np.round(x / (2 * np.pi)) * angle_components(mech.model)
            assert np.abs(x).max() < WITHIN * np.abs(b.q).max()
        near([m.margin for m in found.modes], [m.margin for m in expected.modes])


@pytest.mark.parametrize("name", DRIVES)
def test_inverse_dynamics_knows_no_units(name):
    mech, (drive, hold, span) = mbdae.load(name), DRIVES[name]
    actuators = [drive, *hold]

    def efforts(mech, length, time):
        turn = mbdae.kinematics(mech, drive, span=(span[0] * length, span[1] * length), hold=hold, points=11)
        return mbdae.inverse_dynamics(mech, turn, actuators, speed=3.0 * length / time)

    expected = efforts(mech, 1.0, 1.0)
    assert np.isfinite(expected.efforts).all()
    for units in UNIT_SYSTEMS[1:]:
        slides = expected.units[0] == "N"
        found = efforts(units.mechanism(mech), units.length if slides else 1.0, units.time)
        near(found.t, expected.t, units.time)
        near(found.efforts, expected.efforts, units.energy / (units.length if slides else 1.0))


@pytest.mark.parametrize(("drive", "output"), [("crank", "slider"), ("slider", "crank")])
def test_transmission_angles_know_no_units(drive, output):
    """Nor in light years."""
    mech = mbdae.load("slider_crank")
    expected = mbdae.kinematics(mech, drive, points=9, output_joint=output).transmission
    assert np.isfinite(expected).all()
    for units in (*UNIT_SYSTEMS[1:], UnitSystem("ly, kg, s", length=1e-16)):
        near(mbdae.kinematics(units.mechanism(mech), drive, points=9, output_joint=output).transmission, expected)


@pytest.mark.slow
def test_stops_are_passed_in_all_units():
    """A crank of 0.1 m and a rod of 0.35 m: the slider reaches 0.45 m."""
    plain = mbdae.load("slider_crank")
    stop = Stop(joint="slider", upper=0.45 - 1e-4)
    mech = Mechanism(plain.model, plain.closures, start=plain.start_values, stops=[stop])
    expected = [p.most for p in mbdae.kinematics(mech, "crank").violations]
    assert expected == pytest.approx([1e-4], rel=1e-3)
    for units in UNIT_SYSTEMS[1:]:
        found = mbdae.kinematics(units.mechanism(mech), "crank").violations
        assert [p.most / units.length for p in found] == pytest.approx(expected, rel=1e-6)
