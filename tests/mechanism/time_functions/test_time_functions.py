"""Functions of time: derivatives, continuation of tables, jumps."""

import numpy as np
import pytest

from mbdae import Driver, Function, Input, finite_differences
from mbdae.errors import InputError
from mbdae.mechanism.time_functions.input_functions import InputHistory
from mbdae.mechanism.time_functions.time_functions import (
    TIME_FUNCTIONS,
    Constant,
    Harmonic,
    Polynomial,
    Steps,
    TimeTable,
)

FUNCTIONS = {
    "harmonic": Harmonic(amplitude=2.0, omega=3.0, phase=0.4, offset=0.7),
    "polynomial": Polynomial(coefficients=(1.0, -2.0, 0.5, 0.3)),
    "table": TimeTable(points=((0.0, 1.0), (0.4, 2.0), (1.0, -1.0), (1.7, 0.0))),
    "monotone table": TimeTable(points=((0.0, 1.0), (0.4, 2.0), (1.7, 3.0)), interpolation="monotone"),
    "input": Input(name="motor", value=1.5),
    "history of an input": InputHistory(name="motor", pieces=((0.0, 1.0, 0.5), (0.4, 2.0, -1.0), (1.0, 0.0, 0.0))),
    "function": Function(function=np.sin, rate=np.cos, acceleration=lambda t: -np.sin(t)),
}


@pytest.mark.parametrize("signal", FUNCTIONS.values(), ids=FUNCTIONS.keys())
def test_derivatives_of_functions_of_time(signal):
    for t in (0.13, 0.61, 1.2):
        for k in (0, 1, 2):
            derivative = finite_differences.numerical_derivative(lambda h: signal.at(t + h, k), 1e-2)  # noqa: B023
            assert signal.derivative(t, k + 1) == pytest.approx(derivative, abs=1e-9)
            assert k == 2 or signal.at(t, k + 1) == pytest.approx(derivative, abs=1e-9)


def test_tables_and_steps_hold_their_ends():
    table, steps = FUNCTIONS["table"], Steps(points=((0.5, 1.0), (1.0, 4.0)))
    assert [table.at(t) for t in (-5, 0, 1.7, 9)] == pytest.approx([1.0, 1.0, 0.0, 0.0])
    assert [steps.at(t) for t in (0, 0.5, 0.99, 1.0, 7)] == [1, 1, 1, 4, 4]
    assert table.breakpoint(0.2, 1) == 1.7
    assert table.breakpoint(0.2, -1) == 0.0
    assert steps.breakpoint(1.0, 1) == np.inf
    assert steps.breakpoint(1.0, -1) == -np.inf  # the value before the first time is the first value


def test_every_function_of_time_is_tested():
    assert {type(s) for s in FUNCTIONS.values()} | {Steps} >= set(TIME_FUNCTIONS) - {Constant}


@pytest.mark.parametrize("value", [True, 1j, np.complex128(1), 10**400, np.nan])
def test_a_constant_is_a_finite_number(value):
    with pytest.raises(InputError, match="motion"):
        Driver(joint="a", motion=value)
