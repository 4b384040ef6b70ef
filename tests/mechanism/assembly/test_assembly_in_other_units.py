"""Assembly of five mechanisms in (mm, t, s), (km, g, h), Ms and us: distant and close estimates, with velocities."""

import numpy as np
import pytest
from unit_systems import UNIT_SYSTEMS

import mbdae
from mbdae.errors import MbdaeError

MECHANISMS = ("four_bar", "slider_crank", "spatial_slider_crank", "stewart_platform", "andrews_squeezer")


@pytest.mark.parametrize("name", MECHANISMS)
def test_assembly_knows_no_units(name):
    mech, rng = mbdae.load(name), np.random.default_rng(1)
    moves = [width * rng.uniform(-1, 1, mech.nv) for width in (0.05, 0.4, 1.5)]
    speeds = rng.uniform(-1, 1, mech.nv)
    expected = [assembled(mech, mech.start[0], x * mech.coordinate_scales, speeds * mech.coordinate_scales)
                for x in moves]  # fmt: skip
    assert expected[0][0]
    for units in UNIT_SYSTEMS[1:]:
        other = units.mechanism(mech)
        start, x = mech.start[0] * units.configuration(mech), other.coordinate_scales
        for move, (closed, *values) in zip(moves, expected, strict=True):
            found, *others = assembled(other, start, move * x, speeds * x / units.time)
            assert found == closed
            for number, value, factor in zip(
                others, values, (units.configuration(mech), units.speeds(mech)), strict=True
            ):
                np.testing.assert_allclose(number / factor, value, atol=1e-9 * np.abs(value).max(initial=0.0))


def assembled(mech, start, move, v):
    """Whether it is assembled from a displaced start, and q and v, or nothing."""
    try:
        q, v = mech.assemble(mech.manifold.integrate(start, move), v)
    except MbdaeError:
        return False, np.zeros(mech.nq), np.zeros(mech.nv)
    return True, q, v


@pytest.mark.parametrize("name", MECHANISMS)
def test_starts_are_rejected_in_all_units(name):
    """The violation of a start is relative to the mechanism's size."""
    mech = mbdae.load(name)
    q, v = mech.start
    for units in UNIT_SYSTEMS:
        other = units.mechanism(mech)
        at, there = q * units.configuration(mech), v * units.speeds(mech)
        for size, rejected in ((1e-8, False), (1e-3, True)):
            x = size * np.random.default_rng(0).uniform(0.5, 1, mech.nv) * other.coordinate_scales
            moved = other.manifold.integrate(at, x)
            if not rejected:
                other.point(moved, there)
                continue
            with pytest.raises(MbdaeError, match="not consistent"):
                other.point(moved, there)


@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "spatial_slider_crank"])
def test_velocities_of_starts_are_rejected_in_all_units(name):
    """A violation is relative to the largest velocity, and to the rate of a fall over the mechanism's size."""
    mech = mbdae.load(name)
    q, v = mech.start
    for units in UNIT_SYSTEMS:
        other = units.mechanism(mech)
        at, there = q * units.configuration(mech), v * units.speeds(mech)
        x = np.random.default_rng(0).uniform(0.5, 1, mech.nv) * other.coordinate_scales / units.time
        other.point(at, there + 1e-8 * x)
        with pytest.raises(MbdaeError, match="not consistent"):
            other.point(at, there + 1e-3 * x)
