"""The tests' change of units preserves the mechanism: mass matrix, rows and forces change by their dimensions alone."""

import numpy as np
import pytest
from unit_systems import UNIT_SYSTEMS

import mbdae

NAMES = ("four_bar", "slider_crank", "flyball_governor", "bicycle", "stewart_platform", "slider_crank_with_stop")


def equations(mech, q, v):
    """Mass matrix, rows, forces and speeds of the rows at a state."""
    system = mech.system()
    U = system.inertia(0.0, q)
    G = system.jacobian()
    f = system.force(0.0, q, v, np.array(list(mech.states.values())))[0]
    return U.T @ U, G, f, G @ v + system.g_t(0.0)


@pytest.mark.parametrize("units", UNIT_SYSTEMS, ids=lambda units: units.name)
@pytest.mark.parametrize("name", NAMES)
def test_other_units_are_the_same_mechanism(name, units):
    mech = mbdae.load(name)
    q, v = mech.start
    v = v + np.random.default_rng(0).standard_normal(mech.nv)
    M, G, f, gdot = equations(mech, q, v)
    per, rows = units.coordinates(mech), units.rows(mech)
    other = units.mechanism(mech)
    found = equations(other, q * units.configuration(mech), v * units.speeds(mech))
    expected = (
        M * units.of(2, 1) / np.outer(per, per),
        G * rows[:, None] / per,
        f * units.efforts(mech),
        gdot * rows / units.time,
    )
    scales = (
        np.sqrt(np.outer(M.diagonal(), M.diagonal())) * units.of(2, 1) / np.outer(per, per),
        np.ones_like(G) * rows[:, None] / per,
        np.abs(f).max(initial=0.0) * units.efforts(mech),
        rows / units.time * np.abs(v).max(),
    )
    for a, b, size in zip(found, expected, scales, strict=True):
        np.testing.assert_array_less(np.abs(a - b), 1e-12 * size + 1e-300)
