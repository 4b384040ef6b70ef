"""Wrong keys, wrong files and studies that take no FMU are named in one line."""

import sys

import pytest
from motors import motor
from test_fmu_motion import END, FILE, STEP, cart, drive

import mbdae
from mbdae.errors import InputError, MbdaeError
from mbdae.mechanism.fmu import interface


def message(action):
    with pytest.raises(MbdaeError) as e:
        action()
    assert "\n" not in str(e.value)
    return str(e.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"file": "none.fmu"}, ["no such file: none.fmu"]),
        ({"file": __file__}, ["test_fmu_rejections.py is not an FMU: File is not a zip file"]),
        ({"inputs": {"angel": "q.cart 0"}}, ["unknown input of FMU 'motor'", "'angle'", "valid: angle, speed"]),
        ({"inputs": {"torque": "q.cart 0"}}, ["unknown input of FMU 'motor'", "valid: angle, speed"]),
        ({"inputs": {"angle": "q.card 0"}}, ["unknown signal 'q.card 0'", "q.cart 0"]),
        ({"inputs": {"angle": "work"}}, ["input 'angle' of", "'work' belongs to a run"]),
        ({"outputs": {"angle": "cart 0"}}, ["unknown output of FMU 'motor'", "valid: torque"]),
        ({"outputs": {"torque": "card 0"}}, ["unknown joint or input of output 'torque'", "valid: cart 0"]),
        ({"outputs": {}}, ["outputs"]),
        ({"parameters": {"kpp": 1}}, ["unknown parameter of FMU 'motor'", "kp, kd, T, gain"]),
        ({"parameters": {"kp": "large"}}, ["parameter 'kp'", "type Float64, got 'large'"]),
        ({"parameters": {"steps": 1.5}}, ["parameter 'steps'", "type Int32, got 1.5"]),
        ({"parameters": {"steps": 2**31}}, ["parameter 'steps'", "type Int32, got 2147483648"]),
        ({"step": 0.0}, ["step", "greater than 0"]),
        ({"step": -1.0}, ["step", "greater than 0"]),
        ({"rate": 10.0}, ["unknown key rate", "step"]),
    ],
)
def test_wrong_keys(changes, words, tmp_path):
    path = motor(tmp_path)
    found = message(lambda: cart(drive(path, **changes)))
    for word in words:
        assert word in found


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kind": "ModelExchange"}, "is an FMU for model exchange; only FMUs for co-simulation can drive a mechanism"),
        ({"platform": "riscv-plan9"}, "has no library for .*, only for riscv-plan9"),
        ({"fmi": "4.0"}, "is not an FMU: Unsupported FMI version: 4.0"),
    ],
)
def test_wrong_fmus(changes, words, tmp_path):
    path = motor(tmp_path, **changes)
    with pytest.raises(InputError, match=words):
        cart(drive(path))


def test_without_fmpy(tmp_path, monkeypatch):
    path = motor(tmp_path, name="new.fmu")
    monkeypatch.setitem(sys.modules, "fmpy", None)
    interface._interface_of.cache_clear()
    with pytest.raises(InputError, match=r"FMUs need the package fmpy, which is not installed: pip install 'mbdae"):
        cart(drive(path))


def test_a_file_elsewhere(tmp_path):
    (tmp_path / "inner").mkdir()
    motor(tmp_path, name="motor.fmu")
    (tmp_path / "inner" / "cart.toml").write_text(FILE)
    with pytest.raises(InputError, match="outside of"):
        mbdae.load(tmp_path / "inner" / "cart.toml")
    (tmp_path / "cart.toml").write_text(FILE.replace("motor.fmu", "engine.fmu"))
    with pytest.raises(InputError, match=r"'engine.fmu' is not found in"):
        mbdae.load(tmp_path / "cart.toml")


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("version", [2, 3])
def test_the_message_of_a_step_that_fails(version, tmp_path):
    m = cart(drive(motor(tmp_path, version), parameters={"fail": 0.5}))
    sol = mbdae.solve(m, (0, END), step=STEP)
    assert sol.status == "force"
    assert sol.t[-1] == pytest.approx(0.52)
    assert sol.message.startswith("FMU 'motor of cart 0' cannot step from t = 0.5 s by 0.02 s: ")
    assert "the winding is too hot" in sol.message
    again = mbdae.solve(m, (0, 0.3), step=STEP)  # begins with a new instance
    assert again.success


def test_no_derivatives_and_no_export(tmp_path):
    motor(tmp_path, name="motor.fmu")
    (tmp_path / "cart.toml").write_text(FILE)
    m = mbdae.load(tmp_path / "cart.toml")
    sol = mbdae.solve(m, (0, END), step=STEP)
    for action, words in (
        (lambda: mbdae.sensitivity(sol, ["body.cart 0.mass"]), "force 'motor' is an FMU: runs with it are not diff"),
        (lambda: mbdae.equilibrium(m), "'motor' is a sampled controller"),
        (lambda: mbdae.solve(m, (1, 0)), "'motor' is sampled: a run with it cannot go backwards"),
        (lambda: m.ode(), "the states of sampled controllers jump"),
    ):
        assert words in message(action)
    simulator = mbdae.Simulator(m, step=STEP)
    simulator.advance(STEP)
    assert "runs with it are not differentiable" in message(lambda: simulator.tangent())


@pytest.mark.native
def test_no_export(tmp_path):
    m = cart(drive(motor(tmp_path)))
    words = "force 'motor of cart 0' is an FMU, which cannot be exported"
    assert words in message(lambda: mbdae.export(m, tmp_path / "x.fmu", kind="cs"))
    m = cart(mbdae.Sampled(lambda t, q, v: -v, rate=10, name="brake"))
    words = "force 'brake' is a function of Python, which cannot be exported"
    assert words in message(lambda: mbdae.export(m, tmp_path / "x.fmu", kind="cs"))
