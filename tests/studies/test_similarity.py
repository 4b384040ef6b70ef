"""Modes, linearizations, root loci, equilibria and load paths are independent of units.

Five mechanisms (hinges, sliders, closed loops with redundant rows, a free platform with controllers, rolling) in five
systems of units: results change by their dimension, to 1e-9 of their size.
"""

from functools import cache

import numpy as np
import pytest
from unit_systems import SI, UNIT_SYSTEMS

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism.formats.mechanism_file.template import Template
from mbdae.studies.statics import continuation

NAMES = ("four_bar", "slider_crank", "flyball_governor", "stewart_platform", "bicycle")
OTHERS = [units for units in UNIT_SYSTEMS if units is not SI]
STEADY = {"flyball_governor": {"shaft": 2 * np.pi}}
IN, OUT = {"four_bar": "coupler_tip", "slider_crank": "rod_tip", "stewart_platform": "socket_1"}, "xyz"
each = pytest.mark.parametrize("units", OTHERS, ids=lambda units: units.name)
EXACT = 1e-9


@cache
def made(name, units):
    mech = mbdae.load(name, speed=5.0) if name == "bicycle" else mbdae.load(name)
    return units.mechanism(mech)


def steady(name, units):
    return {joint: speed / units.time for joint, speed in STEADY.get(name, {}).items()} or None


@cache
def modes_of(name, units):
    return mbdae.modes(made(name, units), v=steady(name, units))


@cache
def path_of(name, load, span, units):
    return mbdae.load_path(made(name, units), load, span, v=steady(name, units))


@cache
def equilibrium_of(name, units):
    return mbdae.equilibrium(made(name, units), v=steady(name, units))


@cache
def linear(name, units):
    sides = {"inputs": [f"{IN[name]}.{x}" for x in OUT], "outputs": [f"position.{IN[name]}.{x}" for x in OUT]}
    return mbdae.linearize(made(name, units), **sides)


@cache
def stays_of(units):
    """The roots over the stiffness of a stay that keeps the toggle flat."""

    def governed(stiffness):
        mech = Template("snap_toggle").make({"force.press.force": [0.0, 0.0, 0.0]})
        spring = mbdae.JointSpring(joint="pin", stiffness=stiffness / units.of(0, 1, -2), name="stay")
        return units.mechanism(mbdae.Mechanism(mech.model, forces=[*mech.forces, spring], start=mech.start_values))

    values = np.linspace(230.0, 240.0, 2) * units.of(0, 1, -2)
    return mbdae.root_locus(governed, "stiffness", values, q=np.zeros(1))


def matched(found, expected):
    """Eigenvalues, each matched with the nearest of the remaining ones."""
    left = list(found)
    return np.array([left.pop(int(np.abs(np.array(left) - z).argmin())) for z in expected])


@each
@pytest.mark.parametrize("name", NAMES)
def test_modes(name, units):
    """Each eigenvalue relative to its size, none lost, with the same verdict."""
    expected, found = modes_of(name, SI), modes_of(name, units)
    z = found.eigenvalues * units.time
    assert (z == 0).sum() == (expected.eigenvalues == 0).sum()
    z = matched(z, expected.eigenvalues)
    assert (np.abs(z - expected.eigenvalues) <= EXACT * np.abs(expected.eigenvalues)).all()
    assert (found.stable, found.around) == (expected.stable, expected.around)


@each
@pytest.mark.parametrize("name", NAMES)
def test_equilibria(name, units):
    mech, expected, found = made(name, SI), equilibrium_of(name, SI), equilibrium_of(name, units)
    apart = mech.manifold.difference(expected.q, found.q / units.configuration(mech))
    still = expected.verdict.neutral  # free motions may come to rest anywhere
    assert still or np.abs(apart / mech.coordinate_scales).max() < EXACT
    assert (found.stability, found.verdict.unstable, still) == (
        expected.stability, expected.verdict.unstable, found.verdict.neutral
    )  # fmt: skip
    largest = np.abs(expected.eigenvalues).max(initial=0.0)
    np.testing.assert_allclose(found.eigenvalues * units.time**2, expected.eigenvalues, atol=EXACT * largest)
    lam = expected.lam * units.multipliers(mech)
    size = np.abs(expected.lam).max(initial=0.0) * units.multipliers(mech)
    assert still or (np.abs(found.lam - lam) <= EXACT * size + 1e-300).all()


@each
@pytest.mark.parametrize("name", IN)
def test_linearizations(name, units):
    """The response of a frame's position to a force on it, over ten decades of frequency."""
    expected, found = linear(name, SI), linear(name, units)
    omega = np.geomspace(1e-4, 1e6, 21)
    H = found.response(omega / units.time) * units.of(0, 1, -2)  # N/m
    reference = expected.response(omega)
    size = np.abs(reference).max((1, 2), keepdims=True)
    assert (np.abs(H - reference) <= EXACT * size).all()
    np.testing.assert_allclose(found.band() * units.time, expected.band(), rtol=EXACT)


@each
@pytest.mark.parametrize(("name", "load", "span"), [
    ("snap_toggle", "press", (0.0, 0.5)), ("four_bar", "gravity", (1.0, 1.2)), ("spring_four_bar", "gravity", (1, 1.1)),
    ("flyball_governor", "gravity", (1.0, 1.1)), ("slider_crank", "gravity", (1.0, 0.9)),
])  # fmt: skip
def test_load_paths(name, load, span, units, monkeypatch):
    """The same points, since steps are measured in rad and characteristic lengths, and the same critical points."""
    monkeypatch.setattr(continuation, "MAX_STEP", 0.3)  # on all points of a coarse path
    mech = made(name, SI)
    expected, found = path_of(name, load, span, SI), path_of(name, load, span, units)
    np.testing.assert_allclose(found.factor, expected.factor, atol=EXACT)
    q = found.q / units.configuration(mech)
    assert np.abs(q - expected.q).max() < EXACT
    np.testing.assert_array_equal(found.unstable, expected.unstable)
    assert [e.kind for e in found.critical] == [e.kind for e in expected.critical]
    np.testing.assert_allclose([e.factor for e in found.critical], [e.factor for e in expected.critical], rtol=EXACT)


@pytest.mark.slow
@each
def test_root_loci(units):
    """The same roots, and the same critical stiffness."""
    expected, found = stays_of(SI), stays_of(units)
    factor = units.of(0, 1, -2)
    assert expected.changes == pytest.approx([2000 * (np.sqrt(1.25) - 1)], rel=1e-9)
    np.testing.assert_allclose(found.changes, np.array(expected.changes) * factor, rtol=EXACT)
    scale = np.abs(expected.eigenvalues)
    assert (np.abs(found.eigenvalues * units.time - expected.eigenvalues) <= EXACT * scale).all()


@each
def test_what_is_no_equilibrium_is_none_in_any_unit(units):
    """Slowed down 1e6 times, a falling start is not steady either."""
    mech = made("four_bar", SI)
    with pytest.raises(InputError, match="accelerates"):
        mbdae.modes(made("four_bar", units), mech.start[0] * units.configuration(mech))
