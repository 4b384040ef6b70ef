"""Invalid input to the core's tangents and adjoints: exceptions, never a crash; and failing steps."""

import numpy as np
import pytest
from shared import shared_model

from mbdae import backend
from mbdae.mechanism.discrete_sensitivity.core_parameters import ModelComponent
from mbdae.methods import METHODS

pytestmark = pytest.mark.native
REFUSED = (ValueError, RuntimeError)


@pytest.fixture
def system():
    bound = shared_model("four_bar").system(native=backend.load())
    bound.derivative(0.0, bound.mechanism.point())
    bound.expand()
    return bound


def given(system, m=2, d=3):
    """Parameters, input at the first node, nodes, and the carry."""
    parameters = system.core.bind_parameters(0, [], [], [])
    y = np.array([system.mechanism.point()] * (m + 1))
    carries = np.array([system.derivative(0.0, y[0])[0][system.nv :]] * (m + 1))
    method = METHODS["pherk5"].compiled(backend.load())
    return [parameters, method, False, True, 1e-3 * np.arange(m + 1.0), y, carries], (d, system.ny + carries.shape[1])


def test_what_does_not_fit_is_rejected(system):
    nodes, shape = given(system)
    first, extra = np.ones(shape), np.zeros((3, 1, shape[1]))
    assert system.core.tangent(*nodes, first, np.empty((3, 0))).shape == (3, *shape)
    assert system.core.adjoint(*nodes, extra, first[:1])[0].shape == (1, shape[1])
    assert system.core.adjoint(*nodes, np.zeros((3, *shape)), first)[0].shape == shape
    for i, wrong in ((4, np.empty(0)), (5, nodes[5][:-1]), (6, nodes[6][:, :-1])):
        short = [*nodes[:i], wrong, *nodes[i + 1 :]]
        with pytest.raises(REFUSED):
            system.core.tangent(*short, first, np.empty((3, 0)))
        with pytest.raises(REFUSED):
            system.core.adjoint(*short, extra, first[:1])
    with pytest.raises(REFUSED):
        system.core.tangent(*nodes, first, np.ones((3, 1)))
    with pytest.raises(REFUSED):
        system.core.adjoint(*nodes, extra[:-1], first[:1])
    with pytest.raises(REFUSED):
        system.core.adjoint(*nodes, extra, first[:1, :-1])
    other = shared_model("four_bar").system(native=backend.load())
    other.expand()
    with pytest.raises(ValueError, match="another core"):
        other.core.tangent(*nodes, first, np.empty((3, 0)))


NONE = {"weight": 1.0, "pairs": [], "laws": [], "rows": [], "drivers": []}


def component(*fields):
    return ModelComponent(*fields)._asdict()


def direction(parameter, component, n):
    return {"parameter": parameter, "component": component, "x": [1.0] * n}


def changed(at, laws=(), rows=()):
    return {"parameter": 0, "at": at, "laws": list(laws), "rows": list(rows)}


@pytest.mark.parametrize(
    "wrong",
    [
        (-1, [], [], []),
        (1, [component("mass", 1)], [], []),
        (1, [component("inertia", 9)], [], []),
        (1, [component("inertia", 0)], [], []),
        (1, [component("frame", 5, True)], [], []),
        (1, [component("placement", 1)], [direction(0, 0, 5)], []),
        (1, [component("placement", 1)], [direction(1, 0, 6)], []),
        (1, [component("placement", 1)], [direction(0, 1, 6)], []),
        (1, [], [], [changed([0], laws=[{**NONE, "laws": [{"kind": "nothing"}]}])]),
        (1, [], [], [changed([7], rows=[NONE])]),
        (1, [], [], [changed([0], rows=[{key: x for key, x in NONE.items() if key != "weight"}])]),
    ],
)
def test_wrong_parameters_are_rejected(system, wrong):
    with pytest.raises(REFUSED):
        system.core.bind_parameters(*wrong)


def test_steps_that_cannot_be_taken(system):
    nodes, shape = given(system)
    nodes[5][0, 0] = np.nan
    assert system.core.tangent(*nodes, np.ones(shape), np.empty((3, 0))) is None
    run = backend.load().Run()
    assert system.core.recompute(nodes[1], False, run, nodes[4], nodes[5], nodes[6][0], 1e-7, 1e-10) is None


def test_steps_of_another_run_are_seen(system):
    nodes, _ = given(system)
    run = backend.load().Run()
    nodes[5][1, 0] += 0.1
    segment = nodes[1], False, run, nodes[4], nodes[5], nodes[6][0]
    carries, renewed, steps, _ = system.core.recompute(*segment, 1e-7, 1e-10)
    assert steps == 0
    assert carries.shape == nodes[6].shape
    assert renewed == [0, 0, 0]
