"""Parameters of a tolerance analysis: patterns, redundant closures, functions, invalid input, the command."""

import json

import numpy as np
import pytest
from commands import call
from linkages import four_bar

import mbdae
from mbdae import tolerance
from mbdae.errors import InputError, UnknownNameError

CRANK, ROD, X = "joint.crank_pin.xyz.0", "frame.rod_tip.xyz.0", "position.slider_pin.x"


def test_redundant_closures():
    """Bricard's mechanism closes with its own dimensions only; displacements that it excludes do not act."""
    with pytest.raises(InputError, match="violates redundant closures"):
        tolerance("slider_crank", "crank", [X], {"frame.rod_tip.xyz.1": 1e-4}, points=3)
    found = tolerance("slider_crank", "crank", [X], {"*.xyz.*": 1e-4, ROD: 2e-4}, points=3)
    assert found.left_out == (
        "frame.rod_tip.xyz.1",
        "frame.slider_pin.xyz.1",
        *(f"joint.{n}.xyz.1" for n in ("crank", "crank_pin", "slider")),
    )
    assert found.tolerances[ROD] == 2e-4
    assert set(found.tolerances.values()) == {1e-4, 2e-4}
    mech = mbdae.load("bricard")
    loop = tolerance(
        mech,
        mech.joint_names[0],
        [f"q.{mech.joint_names[1]}"],
        clearances={mech.closures[0].name: 1e-4},
        span=(0.1, 0.4),
        points=3,
    )
    assert (loop.influences.directions < 3).all()


def test_a_later_pattern_has_precedence_and_names_may_have_brackets(tmp_path):
    """The tip of a rod on a hinge at 1 rad: its height has the influences sin 1 and cos 1."""
    (tmp_path / "arm.toml").write_text("""
title = "arm"
[[body]]
name = "arm"
parent = "world"
axis = [0, -1, 0]
mass = 1.0
[[frame]]
name = "tip[1]"
parent = "arm"
xyz = [1, 0, 0]
[start]
q = { arm = 1.0 }
""")
    given = {"frame.*.xyz.?": 1e-3, "frame.*.xyz.[12]": 2e-3, "frame.tip[1].xyz.2": 3e-3}
    found = tolerance(str(tmp_path / "arm.toml"), "arm", ["position.tip[1].z"], given, span=(0.9, 1.1), points=3)
    assert found.tolerances == {f"frame.tip[1].xyz.{i}": 1e-3 * (i + 1) for i in range(3)}
    assert np.abs(found.influences.derivatives[0, 1]) == pytest.approx([np.sin(1), 0, np.cos(1)], abs=1e-12)


def test_functions_give_their_values():
    def make(crank=1.0, rocker=1.5):
        return four_bar((crank, 2.0, rocker, 2.0), {"q": {"crank": 1.2}, "guess": {"coupler": -0.9, "rocker": 1.4}})

    with pytest.raises(InputError, match="given as name = value"):
        tolerance(make, "crank", ["q.rocker"], {"crank": 1e-4})
    found = tolerance(make, "crank", ["q.rocker"], {"crank": 1e-4}, values={"crank": 1.0}, points=5)
    file = tolerance("four_bar", "crank", ["q.rocker"], {"joint.coupler.xyz.0": 1e-4}, points=5)
    np.testing.assert_allclose(found.influences.derivatives, file.influences.derivatives, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([X], {}), "give tolerances of parameters"),
        (([X], {ROD: -1.0}), "the tolerance of 'frame.rod_tip.xyz.0' is a positive number, got -1.0"),
        (([X], {ROD: True}), "is a positive number"),
        (([X], [ROD]), "a tolerance is name = size"),
        (([X], {}, {"wrist pin": 0.0}), "the clearance of 'wrist pin' is a positive number"),
        (([X], {}, {"wrist": 1e-5}), "unknown joint or closure 'wrist'.*valid: wrist pin, crank"),
        (([X], {}, {"slider": 1e-5}), "joint 'slider' slides"),
        (([], {ROD: 1e-4}), "name at least one signal"),
        (([X, X], {ROD: 1e-4}), "named twice"),
        ((["q.crnk"], {ROD: 1e-4}), "unknown signal of a curve 'q.crnk'"),
        (([X], {"frame.*.length": 1e-4}), "unknown pattern of dimensions"),
        (([X], {"frame.rod.xyz.0": 1e-4}), "unknown"),
    ],
)
def test_wrong_input_is_one_line(arguments, message):
    with pytest.raises(InputError, match=message) as e:
        tolerance("slider_crank", "crank", *arguments, points=3)
    assert "\n" not in str(e.value)


def test_wrong_settings():
    for settings, message in (({"sigmas": 0}, "sigmas"), ({"values": {CRANK: 0.1}}, "different names: frame.rod_tip")):
        with pytest.raises(InputError, match=message):
            tolerance("slider_crank", "crank", [X], {ROD: 1e-4}, points=3, **settings)
    found = tolerance("slider_crank", "crank", X, {ROD: 1e-4}, points=3)
    with pytest.raises(InputError, match="second_order=True"):
        _ = found.mean_shift
    with pytest.raises(InputError, match=r"two signals position.slider_pin.x, .y or .z, there are 1"):
        found.band("slider_pin")
    with pytest.raises(UnknownNameError, match="unknown signal 'x'"):
        found.contributions("x")


def test_the_command():
    words = (
        "slider_crank --drive crank --from 0.3 --to 2 --points 3 -s position.slider_pin.x -p frame.rod_tip.xyz.0=5e-5"
    )
    code, out, _ = call(
        "tolerance", *words.split(), "--clearance", "wrist pin=2e-5", "--sigmas", "2", "--second-order", "--json"
    )
    found = tolerance(
        "slider_crank",
        "crank",
        [X],
        {ROD: 5e-5},
        {"wrist pin": 2e-5},
        span=(0.3, 2.0),
        points=3,
        sigmas=2,
        second_order=True,
    )
    assert code == 0
    assert json.loads(out) == {**json.loads(json.dumps(found.to_dict())), "written": []}
