"""Deformation of flexible bodies at rest: sag rho A g L^4/(8 EI) of the tip, stress rho A g L^2 y/(2 I) at the root."""

import json

import numpy as np
import pinocchio as pin
import pytest

import mbdae

LENGTH, YOUNG, DENSITY, AREA, MOMENT, Y = 1.0, 7e10, 2700.0, 1e-4, 8e-10, 5e-3
LOAD = DENSITY * AREA * 9.81
SAG, STRESS = LOAD * LENGTH**4 / (8 * YOUNG * MOMENT), LOAD * LENGTH**2 * Y / (2 * MOMENT)


@pytest.fixture(scope="module")
def cantilever():
    model, options = pin.Model(), {"loads": ["gravity y"], "elements": 16, "stiffening": False, "fibre": (Y, 0.0)}
    model.gravity.linear = np.array([0.0, -9.81, 0.0])
    mbdae.attach_flexible(model, "bar", mbdae.beam(LENGTH, YOUNG, DENSITY, AREA, MOMENT, **options), None)
    return mbdae.Mechanism(model)


def test_an_equilibrium_has_displacements_strains_and_stresses(cantilever):
    found = mbdae.equilibrium(cantilever)
    for values in (found.deformation, found.to_dict()["deformation"]):
        assert values["displacement.bar.B.y"] == pytest.approx(-SAG, rel=1e-9)
        assert values["stress.bar.A"] == pytest.approx(STRESS, rel=3e-3)
        assert values["strain.bar.A"] == pytest.approx(values["stress.bar.A"] / YOUNG, rel=1e-12)
    table = found.to_columns()
    assert table.values["displacement.bar.B.y"] == [found.deformation["displacement.bar.B.y"]]
    assert table.units["stress.bar.A"] == "N/m^2"
    assert f"displacement.bar.B.y = {-SAG:.8g} m" in str(found)
    assert f"  strain.bar.A = {found.deformation['strain.bar.A']:.8g}" in str(found).splitlines()
    assert "displacement.bar.B.z" not in str(found)


def test_a_load_path_has_them_along_it(cantilever):
    path = mbdae.load_path(cantilever, "gravity")
    columns = path.to_columns()
    np.testing.assert_allclose(columns.values["displacement.bar.B.y"], -SAG * path.factor, atol=1e-9 * SAG)
    assert columns.units["displacement.bar.B.y"] == "m"
    assert json.loads(json.dumps(path.to_dict()))["deformation"]["stress.bar.A"][-1] == pytest.approx(STRESS, rel=3e-3)


@pytest.mark.slow
def test_a_path_ends_where_linear_modes_have_no_meaning():
    """A column with a small lateral force: its deflection grows without bound below pi^2 EI/(4 L^2)."""
    model = pin.Model()
    mbdae.attach_flexible(model, "bar", mbdae.beam(LENGTH, YOUNG, DENSITY, AREA, 0.1 * MOMENT, modes=3), None)
    press = mbdae.Wrench(frame="bar.B", force=(-1.0, 1e-3, 0.0), name="press")
    path = mbdae.load_path(mbdae.Mechanism(model, forces=[press]), "press", (0.0, 16.0))
    buckling = np.pi**2 * YOUNG * 0.1 * MOMENT / (4 * LENGTH**2)
    assert not path.complete
    assert 0.99 * buckling < path.factor[-1] < 1.003 * buckling  # three modes
    assert path.warning.startswith("bar bends beyond the range of linear modes, by 1")
