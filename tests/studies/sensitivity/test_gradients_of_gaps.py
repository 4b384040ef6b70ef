"""Derivatives of gaps, open and closed, with respect to parameters and the start, against quotients of order six."""

import numpy as np
import pytest

import mbdae
from mbdae.finite_differences import numerical_derivative
from mbdae.mechanism.formats.mechanism_file.template import Template

CASES = (
    (
        "slider_crank_with_stop",
        0.525,
        {"stop.slider stop.upper": 0.43, "frame.rod_tip.xyz.0": 0.35, "gravity.2": -9.81},
    ),
    ("woodpecker", 0.03, {"closure.beak.radius": 2e-4, "frame.beak_tip.xyz.0": -0.0049, "frame.pole.xyz.0": 0.0025}),
    ("bouncing_chain", 0.5, {"gravity.2": -9.81}),
)


@pytest.mark.slow
@pytest.mark.parametrize(("model", "T", "parameters"), CASES, ids=[case[0] for case in CASES])
def test_gaps(model, T, parameters):
    template = Template(model)
    sol = mbdae.solve(template.make({}), (0, T), rtol=1e-11, t_eval=[0, T])
    gaps = [name for name in sol.signals() if name.startswith("gap.")]
    assert gaps
    found = mbdae.sensitivity(sol, list(parameters), model=template)
    moved = np.array([found.signal(gap)[-1] for gap in gaps])
    for k, (name, value) in enumerate(parameters.items()):

        def end(x, name=name):
            again = mbdae.solve(template.make({name: x}), (0, T), rtol=1e-11, t_eval=[0, T])
            return np.array([column[-1] for column in again.signals(gaps).values()])

        h = 1e-4 * abs(value)
        expected = numerical_derivative(lambda x, end=end, value=value: end(value + x), h)
        np.testing.assert_allclose(moved[:, k], expected, rtol=1e-6, atol=1e-7 * max(1.0, np.abs(expected).max()))
