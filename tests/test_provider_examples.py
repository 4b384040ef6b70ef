"""Examples that use mbdae as a provider of equations run, with the documented results."""

import pytest
from test_examples import example


@pytest.mark.slow
def test_generalized_alpha(capsys):
    orders = example("generalized_alpha").main()
    assert all(1.9 < order < 2.1 for found in orders.values() for order in found), orders
    assert "orders" in capsys.readouterr().out


def test_jax_provider(capsys):
    pytest.importorskip("jax")
    found = example("jax_provider").main(steps=8)
    assert found["run"] < 1e-6
    assert max(found["forward"], found["reverse"], found["acceleration"]) < 1e-9
    assert "reverse" in capsys.readouterr().out


def test_casadi_provider(capsys):
    pytest.importorskip("casadi")
    found = example("casadi_provider").main(steps=20)
    assert found["jacobian"] < 1e-9
    assert 1.9 < found["order"] < 2.1
    assert "observed order" in capsys.readouterr().out


@pytest.mark.native
def test_fmu_casadi(capsys):
    """The optimum of the reduced equation of motion, by another program, from the exported equations."""
    pytest.importorskip("casadi")
    assert abs(example("fmu_casadi").main()["excess"]) < 1e-7
    assert "least effort 167.0765" in capsys.readouterr().out
