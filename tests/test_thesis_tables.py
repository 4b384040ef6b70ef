"""The tables of the thesis: orders and errors of explicit methods on its problems."""

import numpy as np
import pytest
from test_examples import example


@pytest.mark.slow
def test_thesis_tables_of_any_numbers_of_steps(capsys):
    example("thesis_tables").main(steps=(40, 120))
    assert " 3.0 " in next(line for line in capsys.readouterr().out.splitlines() if line.startswith("  radau3 "))


def test_thesis_tables_of_one_number_of_steps(capsys):
    assert example("thesis_tables").main(steps=(20,))["rk4"].shape == (1, 2)
    assert "statement of the thesis" in capsys.readouterr().out


@pytest.mark.slow
def test_thesis_tables(capsys):
    errors = example("thesis_tables").main(steps=(80, 160))
    order = {name: np.log2(e[-2, 0] / e[-1, 0]) for name, e in errors.items()}
    for name in ("kutta3", "rk4", "rule38"):
        assert 1.8 < order[name] < 2.3
    assert order["pherk3"] > 2.8
    assert order["pherk4"] > 3.8
    assert errors["pherk4"][-1, 0] < 1e-3 * errors["rule38"][-1, 0]
    text = capsys.readouterr().out
    assert "classical" in text
    assert "statement of the thesis" in text
