"""Mechanisms and settings that cannot be exported are rejected by name; the command."""

import json
import re
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest
from commands import call

import mbdae
from mbdae import Actuator, Mechanism, backend
from mbdae.errors import InputError, UnknownNameError
from mbdae.studies.export import export as module
from mbdae.studies.export.fmi_units import base_exponents

pytestmark = pytest.mark.native
COMMANDS = ("export pendulum -o pendulum.fmu --kind cs",)


def slider_crank(*forces):
    m = mbdae.load("slider_crank")
    return Mechanism(m.model, m.closures, [*m.forces, *forces], start=m.start_values, title="press")


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"kind": ["cs", "fmi"]}, "unknown kind 'fmi'"),
        ({"inputs": ["motr"]}, "unknown input 'motr'"),
        ({"outputs": ["q.crnk"]}, "unknown signal 'q.crnk'.*q.crank"),
        ({"outputs": ["position.rod_tip.x"]}, "signal 'position.rod_tip.x' cannot be exported"),
        ({"outputs": ["work"]}, "output 'work' is integrated by the steps of co-simulation"),
        ({"parameters": ["joint.rod.mass"]}, "unknown joint of a source 'rod'"),
        ({"method": "radau5"}, "only half-explicit methods"),
        ({"method": "LSODA"}, "LSODA"),
        ({"events": ["q.crank = 1"]}, "export has no events: it is a setting of mbdae.Simulator"),
        ({"backend": "python"}, "export has no backend: it is a setting of mbdae.Simulator"),
        ({"kind": None}, "kinds are a list of names, got None"),
        ({"kind": [["cs"]]}, r"kinds are a list of names, got \['cs'\]"),
        ({"outputs": 5}, "outputs are a list of names, got 5"),
        ({"inputs": [["motor"]]}, "inputs are a list of names"),
        ({"parameters": [5]}, "parameters are a list of names, got 5"),
    ],
)
def test_unknown_names_and_settings(settings, text, tmp_path):
    with pytest.raises((InputError, UnknownNameError), match=text):
        mbdae.export(mbdae.load("slider_crank"), tmp_path / "x.fmu", **settings)
    assert not list(tmp_path.iterdir())


def test_python_functions_resets_and_wrong_files(tmp_path):
    wind = Actuator(lambda t, q, v, s: np.zeros(3), lambda t, q, v, s: np.zeros(1), {"x": 0.0}, "wind")
    with pytest.raises(InputError, match="force 'wind' is a function of Python, which cannot be exported"):
        mbdae.export(slider_crank(wind), tmp_path / "x.fmu")
    with pytest.raises(InputError, match="resets cannot be exported: heel strike"):
        mbdae.export(mbdae.load("simplest_walker"), tmp_path / "x.fmu")
    odd = mbdae.JointTorque(joint="crank", torque=mbdae.Function(function=np.cos, name="odd"), name="push")
    with pytest.raises(InputError, match="force 'push' is a function of Python, which cannot be exported"):
        mbdae.export(slider_crank(odd), tmp_path / "x.fmu")
    for path in ("press.zip", 5):
        with pytest.raises(InputError, match=f"an FMU is saved as .fmu, got '{path}'"):
            mbdae.export(slider_crank(), path)


@pytest.mark.parametrize("name", ["time", "q.slider", "local[1]", "der(local[1])"])
def test_an_input_with_the_name_of_another_variable(name, tmp_path):
    push = mbdae.JointTorque(joint="crank", torque=mbdae.Input(name=name))
    text = f"input {name!r} has the name of another variable of the FMU: rename it"
    with pytest.raises(InputError, match=re.escape(text)):
        mbdae.export(slider_crank(push), tmp_path / "x.fmu", step=1e-3)
    assert not list(tmp_path.iterdir())


def test_a_runtime_that_was_not_built(monkeypatch, tmp_path):
    monkeypatch.setattr(module, "RUNTIME", "missing.so")
    with pytest.raises(InputError, match="the runtime of exported mechanisms was not built: install mbdae with"):
        mbdae.export(slider_crank(), tmp_path / "x.fmu")


def test_a_parameter_that_is_not_linear(tmp_path):
    with pytest.raises(InputError, match=r"does not depend linearly on parameter .*: it cannot be exported"):
        mbdae.export(mbdae.load("four_bar"), tmp_path / "x.fmu", parameters=["joint.rocker.rpy.2"])


def test_a_parameter_on_which_the_start_depends(tmp_path):
    """A cart runs against a clutch that pushes another one: the impact at the start depends on the masses."""
    carts = "".join(
        f'[[body]]\nname = "{x}"\nparent = "world"\njoint = "prismatic"\naxis = [1, 0, 0]\nmass = 1.0\n' for x in "ab"
    )
    clutch = '[[clutch]]\nname = "push"\njoints = ["a", "b"]\ndirection = -1\n'
    (tmp_path / "carts.toml").write_text(f"{carts}{clutch}[start]\nv = {{ a = 1.0 }}\n")
    mech = mbdae.load(tmp_path / "carts.toml")
    text = "parameter 'body.a.mass' changes the start, by assembly or an impact: it cannot be exported"
    with pytest.raises(InputError, match=text):
        mbdae.export(mech, tmp_path / "x.fmu", parameters=["body.a.mass"])
    at_rest = {"q": np.zeros(2), "v": np.zeros(2)}
    assert mbdae.export(mech, tmp_path / "x.fmu", parameters=["body.a.mass"], **at_rest).parameters == ("body.a.mass",)


def test_the_command_writes_it(tmp_path):
    path = tmp_path / "press.fmu"
    code, out, _ = call(
        "export", "slider_crank", "-o", str(path), "--kind", "cs", "--outputs", "q.slider,v.slider", "--step", "0.001",
        "--json",
    )  # fmt: skip
    assert code == 0
    found = json.loads(out)
    assert (found["kinds"], found["outputs"]) == (["cs"], ["q.slider", "v.slider"])
    with zipfile.ZipFile(path) as file:
        names, text = file.namelist(), file.read("modelDescription.xml")
    assert {"modelDescription.xml", "resources/mechanism.json", "documentation/index.html"} < {*names}
    root = ElementTree.fromstring(text)
    units = {x.get("name"): x.find("BaseUnit").attrib for x in root.iter("Unit")}
    assert units == {"m": {"m": "1"}, "m/s": {"m": "1", "s": "-1"}, "s": {"s": "1"}}


@pytest.mark.parametrize(
    ("name", "output", "unique"),
    [
        ("differential_drive", "lam.left_wheel.1", True),
        ("differential_drive", "lam.left_wheel.2", False),  # both wheels on one axle hold the robot sideways
        ("slider_crank", "lam.wrist pin.1", True),
    ],
)
def test_loads_that_are_not_unique_have_no_derivatives(name, output, unique, tmp_path):
    """Reported is their minimum norm; the core differentiates those of independent rows."""
    unit = mbdae.export(mbdae.load(name), tmp_path / "x.fmu", kind="me", outputs=["t", output])
    with zipfile.ZipFile(unit.path) as file:
        interface = ElementTree.fromstring(file.read("modelDescription.xml")).find("ModelExchange")
    for provided in ("providesDirectionalDerivatives", "providesAdjointDerivatives"):
        assert interface.get(provided, "false") == str(unique).lower()


def test_times_of_the_default_experiment(tmp_path):
    step = np.float64(1e-3)  # whose repr is no number
    unit = mbdae.export("slider_crank", tmp_path / "x.fmu", kind="cs", step=step, t=2.0)
    with zipfile.ZipFile(unit.path) as file:
        found = ElementTree.fromstring(file.read("modelDescription.xml")).find("DefaultExperiment").attrib
    assert {name: float(x) for name, x in found.items()} == {"startTime": 2.0, "stopTime": 12.0, "stepSize": 1e-3}


def test_units_are_products_of_base_units():
    assert base_exponents("N m s/rad^2") == {"kg": 1, "m": 2, "s": -1, "rad": -2}
    assert base_exponents("1") == {}
    assert base_exponents("furlong/s") is None


def test_the_core_travels_without_libraries():
    """Symbols are hidden but those of the interface; no Python, no Pinocchio."""
    from pathlib import Path

    data = Path(backend.load().__file__).with_name("_native_fmi3.so").read_bytes()
    assert b"fmi3DoStep" in data
    assert b"libpython" not in data
    assert b"libpinocchio" not in data
    assert b"libboost" not in data
