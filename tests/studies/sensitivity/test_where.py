"""Which runs are differentiated: the list in mbdae/native/README.md."""

import numpy as np
import pytest

import mbdae

pytestmark = pytest.mark.native
FRICTION = mbdae.CoulombFriction(closure="pin", coefficient=0.4, radius=0.3, velocity=0.5)


def four_bar(*forces):
    return mbdae.load("four_bar", forces=list(forces))


def with_user_rows():
    geared = mbdae.Closure.rows(lambda q: np.array([1.0, -0.5]), ("crank", "rocker"), velocity=True)
    return mbdae.Mechanism(four_bar().model, [geared])


RUNS = {
    "half-explicit": (four_bar, {}),
    "step doubling": (four_bar, {"method": "herk4"}),
    "projected": (four_bar, {"project": True}),
    "a Python law": (lambda: four_bar(lambda t, q, v: -0.1 * v), {}),
    "stops": (lambda: mbdae.load("slider_crank_with_stop"), {}),
    "stiction": (lambda: mbdae.load("stick_slip_slider"), {}),
    "GGL": (four_bar, {"formulation": "ggl"}),
    "Radau IIA": (four_bar, {"method": "radau5"}),
    "Radau IIA of the GGL form": (four_bar, {"method": "radau5", "formulation": "ggl"}),
    "closure friction": (lambda: four_bar(FRICTION), {}),
    "user rows": (with_user_rows, {}),
}


@pytest.mark.parametrize("name", RUNS)
def test_where_runs_are_differentiated(name):
    make, options = RUNS[name]
    sol = mbdae.solve(make(), (0.0, 0.02), **{"step": 0.01, "method": "pherk5", **options})
    found = mbdae.sensitivity(sol, start=True)
    assert np.isfinite(found.dy).all()
