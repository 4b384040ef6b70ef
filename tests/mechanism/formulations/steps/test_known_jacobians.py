"""G is evaluated once at each configuration of a step: stages begin where the constraint of the one before applies."""

import numpy as np
import pytest
from shared import shared_model

import mbdae
from mbdae.mechanism.closures.constraints import Constraints

STEPS = 4
# configurations of a step where G is needed: those of its stages and of their constraints, and of the projection
METHODS = {"herk4": 7, "herk5": 10, "arnold4": 6, "pherk3": 6, "pherk5": 11}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["four_bar", "stewart_platform"])
def test_each_configuration_has_one_jacobian(name, method, monkeypatch):
    evaluated, evaluate = [], Constraints.jacobian
    _ = shared_model(name).start
    monkeypatch.setattr(Constraints, "jacobian", lambda self: evaluated.append(1) or evaluate(self))

    def run(steps, backend="python"):
        evaluated.clear()
        sol = mbdae.solve(shared_model(name), (0, steps * 1e-3), method=method, step=1e-3, backend=backend)
        return sol, len(evaluated)

    (_, few), (sol, many) = run(STEPS), run(2 * STEPS)
    assert (many - few) / STEPS == METHODS[method]
    np.testing.assert_allclose(sol.y[-1, :-1], run(2 * STEPS, "native")[0].y[-1, :-1], rtol=1e-12, atol=1e-13)
