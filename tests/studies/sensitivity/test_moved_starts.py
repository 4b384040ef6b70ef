"""Derivatives of runs with a corrected start: velocities projected onto the rows of a mode, or all onto closures."""

import tomllib
from functools import cache

import numpy as np
import pytest
from frozen import assert_derivative, compare

import mbdae
from mbdae import Driver
from mbdae.discovery import models_directory
from mbdae.errors import InputError
from mbdae.mechanism.formats.mechanism_file.loaded_model import LoadedModel, parameter_value

WIDTHS = (1e-5, 1e-4, 1e-3)
GIVEN = tomllib.loads((models_directory() / "geneva_drive/mechanism.toml").read_text())
GIVEN["start"]["assemble"] = False  # otherwise a start satisfies the rows of its mode
GENEVA = LoadedModel(mbdae.load(GIVEN))
DRIVEN = LoadedModel(mbdae.load(GIVEN, drivers=[Driver(joint="crank", speed=6.0)]))
SLOT = {"start.q.crank": -0.5, "start.q.wheel": -0.0562421, "start.v.wheel": -2.7935}  # with a few digits
ON_ROWS = [(GENEVA, {}, "closure.dwell.coefficients.0"), (GENEVA, SLOT, "frame.pin.xyz.0"),
           (GENEVA, SLOT, "start.v.crank"), (DRIVEN, SLOT, "frame.pin.xyz.0")]  # fmt: skip


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("project", [False, True])
@pytest.mark.parametrize(("template", "values", "name"), ON_ROWS)
def test_rows_of_a_mode_with_perturbed_velocities(template, values, name, project):
    """Perturbed runs begin with an impact, which projects their velocities onto the rows; a driver does work there."""
    value = parameter_value(template, name)

    @cache
    def run(x):
        made = template.make({**values, name: x})
        return mbdae.solve(made, (0.0, 0.03), step=0.01, method="pherk5", project=project)

    sol, given = run(value), {**values, name: value}
    found = mbdae.sensitivity(sol, given, model=template).dy[..., list(given).index(name)]
    assert_derivative(found, lambda x: run(x).y, value, 1e-11, WIDTHS, mech=sol.mechanism)
    assert np.abs(found[0]).max() > 0.1
    assert run(value + 1e-3).impacts
    compare(sol, given, ["q.wheel", "v.wheel", "energy"], model=template)


@pytest.mark.parametrize("name", ["frame.pin.xyz.0", "start.q.crank", "start.v.crank"])
def test_a_start_that_is_assembled_with_the_rows_of_its_mode(name):
    """The wheel follows the slot at the start already."""
    start = {"q": {"crank": -0.5}, "v": {"crank": 6.0}, "guess": {"wheel": 0.0}}
    model = LoadedModel(mbdae.load(GIVEN | {"start": start}))

    @cache
    def run(x):
        return mbdae.solve(model.make({name: x}), (0.0, 0.03), step=0.01, method="pherk5")

    value = parameter_value(model, name)
    found = mbdae.sensitivity(run(value), {name: value}, model=model).dy[..., 0]
    assert_derivative(found, lambda x: run(x).y, value, 1e-9, WIDTHS, mech=run(value).mechanism)  # assembled to 1e-10
    assert not run(value + 1e-3).impacts


@pytest.mark.parametrize("project", [False, True])
@pytest.mark.parametrize("model", ["slider_crank_with_stop", "four_bar"])
def test_a_given_start_that_is_open(model, project, tmp_path):
    """As after a run with drift; also of a saved run. Steps are those of loose tolerances."""
    mech = mbdae.load(model)
    q, v = mech.assemble({"crank": -1.2}, {"crank": 2.0})
    open_q, names, n = q + 1e-5 * np.eye(mech.nq)[0], ["gravity.2"], 2 * mech.nv
    options = {"rtol": 1e-2, "atol": 1e-2, "first_step": 0.01, "max_step": 0.01, "method": "pherk5", "project": project}
    along = np.random.default_rng(2).uniform(-1, 1, n)

    @cache
    def run(x):
        at = mech.manifold.integrate(open_q, x * along[: mech.nv])
        return mbdae.solve(mech, (0.0, 0.04), at, v + x * along[mech.nv :], **options)

    sol = run(0.0)
    assert len(sol.t) == 5
    assert not sol.impacts
    found = mbdae.sensitivity(sol, names, start=True)
    assert_derivative(found.dy[..., 1 : 1 + n] @ along, lambda x: run(x).y, 0.0, 1e-11, WIDTHS, mech=mech)
    compare(sol, names, ["v.crank", "energy"], start=True)
    sol.save(tmp_path / "run.npz")
    again = mbdae.sensitivity(mbdae.Solution.load(tmp_path / "run.npz"), names, start=True)
    np.testing.assert_allclose(again.dy, found.dy, rtol=0, atol=1e-12)


def test_a_start_of_another_mechanism_is_rejected(tmp_path):
    sol = mbdae.solve(mbdae.load("four_bar"), (0.0, 0.1), step=0.05)
    sol.settings["v"] = [1.0]
    sol.save(tmp_path / "run.npz")
    with pytest.raises(InputError, match="start values that the mechanism does not have"):
        mbdae.Solution.load(tmp_path / "run.npz")
