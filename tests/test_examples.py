"""The examples run, and show what they say."""

import importlib.util
from pathlib import Path

import numpy as np

EXAMPLES = Path(__file__).parent.parent / "examples"


def example(name):
    spec = importlib.util.spec_from_file_location(Path(name).stem, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_thesis_tables(capsys):
    errors = example("thesis_tables").main(steps=(40, 80, 160))
    order = {name: np.log2(e[-2, 0] / e[-1, 0]) for name, e in errors.items()}
    for name in ("kutta3", "rk4", "rule38"):
        assert 1.8 < order[name] < 2.3
    assert order["pherk3"] > 2.8
    assert order["pherk4"] > 3.8
    assert errors["pherk4"][-1, 0] < 1e-3 * errors["rule38"][-1, 0]
    assert "classical" in capsys.readouterr().out


def test_andrews_benchmark(capsys):
    rows = example("benchmarks/andrews").main()
    assert len(rows) == 4
    assert all(ratio <= 1.1 for *_, ratio in rows), rows
    assert "Fortran" in capsys.readouterr().out


def test_pherk6(capsys):
    result = example("pherk6").main(rtol=(1e-7, 1e-8))
    assert result["conditions"].holds
    assert result["study"].holds, str(result["study"])
    assert "pherk6" in capsys.readouterr().out


def test_stiff(capsys):
    result = example("stiff").main()
    assert result["radau5"]["steps"] < 0.25 * result["herk5"]["steps"]
    assert abs(result["radau5"]["crank"] - result["pherk5"]["crank"]) < 1e-5
    assert "radau5" in capsys.readouterr().out
