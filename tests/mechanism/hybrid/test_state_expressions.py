"""Expressions of the state: values, exact derivatives, and one line for anything else."""

import numpy as np
import pytest

import mbdae
from mbdae.errors import InputError, StepError, UnknownNameError
from mbdae.mechanism.hybrid.state_expressions import Expression, state_columns

MECH = mbdae.load("double_pendulum")
COLUMNS = state_columns(MECH)
Q = [name for name in COLUMNS if name.startswith("q.")]


def test_values_and_derivatives():
    a, b = Q[:2]
    text = f"cos(2*{a})*v{b[1:]} - {b}**3/(1 + t) + sqrt(2 + sin({a}))"
    y, t = np.array([0.3, -0.7, 1.1, 0.4, 0.0]), 0.5
    found = Expression(text, COLUMNS)
    expected = np.cos(0.6) * 0.4 + 0.343 / 1.5 + np.sqrt(2 + np.sin(0.3))
    assert found.value(t, y) == pytest.approx(expected, rel=1e-15)
    by = [-2 * np.sin(0.6) * 0.4 + np.cos(0.3) / (2 * np.sqrt(2 + np.sin(0.3))), -3 * 0.49 / 1.5, 0, np.cos(0.6), 0,
          -0.343 / 1.5**2]  # fmt: skip
    np.testing.assert_allclose(found.partials(t, y, 5), by, rtol=1e-14, atol=1e-16)


def test_equal_expressions_are_parsed_once(monkeypatch):
    """Variants of a mechanism have the same ones."""
    Expression("2*t + 0.125", COLUMNS)
    with monkeypatch.context() as patch:
        patch.setattr("ast.parse", None)
        again = Expression(" 2*t + 0.125", COLUMNS)
    assert again.value(1.0, np.zeros(5)) == 2.125


REFUSED = ("", "1 +", "q", "__import__('os')", "lambda: 1", "True", "[1]", "x" * 2000, "1 if t else 2")


@pytest.mark.parametrize("text", REFUSED)
def test_other_syntax_is_rejected(text):
    with pytest.raises(InputError):
        Expression(text, COLUMNS)


def test_unknown_names_are_listed():
    with pytest.raises(UnknownNameError, match=r"unknown coordinate 'q\.elbow_'"):
        Expression("2*q.elbow_", COLUMNS)
    with pytest.raises(UnknownNameError, match="unknown function 'sinn'"):
        Expression("sinn(t)", COLUMNS)


def test_values_that_are_not_real_are_rejected():
    with pytest.raises(StepError, match="sqrt"):
        Expression("sqrt(-1 - t)", COLUMNS).value(1.0, np.zeros(5))
    with pytest.raises(StepError, match="cannot be computed"):
        Expression("1/t", COLUMNS).value(0.0, np.zeros(5))
