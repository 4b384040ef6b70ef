"""Projection in the core, by the rows in use where these suffice, against the pseudoinverse of all rows in Python."""

import numpy as np
import pytest
from shared import shared_model

import mbdae
from mbdae import backend

pytestmark = pytest.mark.native
MODELS = ["four_bar", "slider_crank", "stewart_platform", "jansen_walker", "bricard", "bicycle", "mecanum_platform"]


def both(name, **parameters):
    """A mechanism, its start, and its systems in Python and in the core, which know the rank."""
    mech = mbdae.load(name, **parameters)
    y, systems = mech.point(), (mech.system(), mech.system(native=backend.load()))
    for system in systems:
        system.derivative(0.0, y)
    return mech, y, *systems


@pytest.mark.parametrize("away", [1e-9, 1e-6])
@pytest.mark.parametrize("name", MODELS)
def test_the_nearest_point_is_that_of_the_pseudoinverse(name, away):
    mech, y, python, native = both(name)
    off = python.add(y, away * np.random.default_rng(0).standard_normal(python.ny))
    expected, found = python.project_state(0.0, off), native.core.project_state(0.0, off)
    assert np.abs(found - off).max() > 0.1 * away, "nothing was moved"
    size = 1 + np.abs(y).max()
    assert np.abs(found - expected).max() < 1e-13 * size + 1e-7 * away
    assert max(np.abs(r).max() for r in mech.residual(*python.split(found))) < 1e-13 * size


def test_many_rows_are_projected_as_few():
    _, y, python, native = both("n_four_bar", N=40)
    off = python.add(y, 1e-4 * np.random.default_rng(0).standard_normal(python.ny))
    assert np.abs(native.core.project_state(0.0, off) - python.project_state(0.0, off)).max() < 1e-13


def test_rows_that_the_rows_in_use_leave_open_are_closed():
    """At a flat four-bar one of the rows in use decides too little: all rows are closed by the pseudoinverse."""
    mech = shared_model("four_bar")
    q, v = mech.assemble(q={"crank": 1e-3})
    y = np.concatenate([q, v, [0.0]])
    native = mech.system(native=backend.load())
    native.derivative(0.0, np.concatenate([*mech.assemble(q={"crank": 1.0}), [0.0]]))  # rows in use of another pose
    off = native.add(y, 1e-7 * np.random.default_rng(0).standard_normal(native.ny))
    found, expected = native.core.project_state(0.0, off), mech.system().project_state(0.0, off)
    assert np.abs(mech.residual(*native.split(found))[0]).max() < 1e-12
    assert np.abs(found - expected).max() < 1e-9


def test_the_motion_along_the_manifold_is_left():
    """Off the manifold all five rows of Bricard's loop are independent: the pseudoinverse moves the loop, too."""
    mech, y, python, native = both("bricard")
    off = python.add(y, 1e-4 * np.random.default_rng(0).standard_normal(python.ny))
    moved = [python.difference(off, s(0.0, off))[: mech.nv] for s in (native.core.project_state, python.project_state)]
    M = np.diag(np.ones(mech.nv))
    M[:] = python.inertia(0.0, off[: mech.nq])
    sizes = [np.linalg.norm(M @ x) for x in moved]
    assert sizes[0] <= sizes[1]
