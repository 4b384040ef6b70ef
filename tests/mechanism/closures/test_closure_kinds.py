"""Every kind of closure, coupling and driver: rows, derivatives far from the manifold, free motions, invalid keys."""

import re

import closure_kinds
import numpy as np
import pinocchio as pin
import pytest
from chains import random_q, tree

import mbdae
from mbdae import Closure, Driver, Mechanism, finite_differences
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.closures import kinds_in_files
from mbdae.mechanism.closures.closure import KINDS
from mbdae.mechanism.closures.kind_files import KIND_FILES
from mbdae.mechanism.formats.mechanism_file.schema import read_toml

JOINTS = ["revolute", "spherical", "prismatic", "free", "universal", "continuous", "planar", "helical", "composite"]
PARENTS = [0, 1, 2, 0, 4, 5, 4, 0, 8]
CLOSURES = {name: kind.closure for name, kind in closure_kinds.KINDS.items()}
DRIVERS = {
    "joint": Driver.harmonic("helical_7", 0.7, 3.0, phase=0.4, offset=0.1),
    "circle": Driver.at_speed("continuous_5", 2.0, start=0.3),
    "coupling": Driver.polynomial(("revolute_0", "prismatic_2"), (0.1, 0.2, -0.4), coefficients=(0.0, -2.0, 0.5)),
    "gear": Driver.polynomial(("continuous_5", "revolute_0"), (0.1, 0.2, -0.4), coefficients=(0.0, -2.0, 0.5)),
    "distance": Driver.harmonic(("tip_2", "tip_7"), 0.3, 1.0, offset=1.2),
}
SPEEDS = {
    "speed of a joint": Driver(joint="helical_7", speed={"kind": "harmonic", "amplitude": 0.7, "omega": 3.0}),
    "speed of a distance": Driver(
        frames=("tip_2", "tip_7"), speed={"kind": "harmonic", "amplitude": 0.7, "omega": 3.0}
    ),
}
OTHERS = {**closure_kinds.ROLLING, **closure_kinds.HIGHER, **SPEEDS}
CASES = {**CLOSURES, **OTHERS, **{f"driver of a {k}": d for k, d in DRIVERS.items()}}


def mechanism(spec):
    model = tree(JOINTS, PARENTS, seed=3)
    return Mechanism(model, **{"drivers" if isinstance(spec, Driver) else "closures": [spec]})


def test_every_kind_is_tried():
    assert set(CLOSURES) == set(kinds_in_files())


@pytest.mark.parametrize("file", KIND_FILES, ids=lambda file: file.kind)
def test_texts_of_files_say_what_their_classes_are(file):
    found = KINDS[file.kind]
    assert found.__module__ == file.module
    assert file.first == found.__doc__.partition("\n")[0].rstrip(".")
    assert all(getattr(Closure, name).__self__ is found for name in [file.kind, *file.creators])


@pytest.mark.parametrize("name", CASES)
def test_derivatives_far_off_the_manifold(name):
    mech, rng = mechanism(CASES[name]), np.random.default_rng(7)
    system, h = mech.system(), 2e-3
    for _ in range(4):
        q, v, t = random_q(mech.model, rng), rng.standard_normal(mech.nv), rng.uniform(-2, 3)

        def at(s, q=q, v=v):
            return pin.integrate(mech.model, q, s * v)

        _, G = system.closures(q, t)
        derivatives = finite_differences.numerical_jacobian(
            lambda x, q=q, t=t: system.closures(at(1.0, q, x), t)[0], mech.nv, h
        )
        assert derivatives == pytest.approx(np.where(mech.positional, G.T, 0.0).T, abs=2e-9)
        g_t = finite_differences.numerical_derivative(lambda s, q=q, t=t: system.closures(q, t + s)[0], h)
        assert g_t == pytest.approx(np.where(mech.positional, system.g_t(t), 0.0), abs=2e-9)
        # along q(s) = q (+) s v the velocity remains v: d/ds (G v + g_t) = Gdot v + g_tt
        rate = finite_differences.numerical_derivative(lambda s, q=q, v=v, t=t: system.residual(t + s, at(s), v)[1], h)
        assert rate == pytest.approx(system.gamma(q, v, t), abs=2e-8 * (1 + v @ v))


def test_table_of_kinds_has_the_number_of_rows():
    table = dict(re.findall(r"^ {4}(\w+) +(\d) ", Closure.__doc__, re.M))
    assert table == {kind: str(c.m) for kind, c in CLOSURES.items()}
    assert all(mechanism(c).ng == c.m for c in CLOSURES.values())


def pose(axis=(0, 0, 1), turn=0.0, shift=(0.0, 0.0, 0.0)):
    axis = np.array(axis, float) / np.linalg.norm(axis)
    return pin.SE3(pin.exp3(turn * axis), np.array(shift, float))


Z, X = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
TURN_Z, TURN_X, LIFT, SIDE = pose(Z, 0.7), pose(X, 0.4), pose(shift=(0, 0, 0.3)), pose(shift=(0.2, 0, 0))
MOTIONS = {"turn z": TURN_Z, "turn x": TURN_X, "slide z": LIFT, "slide x": SIDE}
FREE = {name: kind.free for name, kind in closure_kinds.KINDS.items() if kind.free is not None}


def floating(closure):
    """Frame b is a free body; a is rotated and shifted in the world."""
    model, place = pin.Model(), pin.SE3(pin.exp3(np.array([0.4, -0.9, 0.3])), np.array([0.2, 0.5, -0.3]))
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), place, "body")
    model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    model.addFrame(pin.Frame("a", 0, place, pin.FrameType.OP_FRAME))
    model.addFrame(pin.Frame("b", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return Mechanism(model, [closure])


@pytest.mark.parametrize("kind", FREE)
def test_what_is_free_and_what_is_kept(kind):
    mech = floating(Closure(kind=kind, frames=("a", "b")))
    for name, move in MOTIONS.items():
        g, _ = mech.residual(pin.SE3ToXYZQUAT(move), np.zeros(6))
        assert (np.abs(g).max() < 1e-14) == (name in FREE[kind]), name
    q = pin.SE3ToXYZQUAT(pose())
    G = mech.system().closures(q)[1]
    assert np.linalg.matrix_rank(G) == mech.ng


def test_a_universal_joint_turns_about_both_of_its_axes():
    mech = floating(Closure.universal("a", "b"))
    both = pose(Z, 0.7) * pose(X, -0.5)
    assert np.abs(mech.residual(pin.SE3ToXYZQUAT(both), np.zeros(6))[0]).max() < 1e-14
    third = pose(Z, 0.7) * pose((0, 1, 0), 0.5)
    assert np.abs(mech.residual(pin.SE3ToXYZQUAT(third), np.zeros(6))[0]).max() > 0.3


@pytest.mark.parametrize("kind", ["revolute", "cylindrical", "parallel", "prismatic", "frame"])
def test_no_frame_is_flipped(kind):
    mech = floating(Closure(kind=kind, frames=("a", "b")))
    turns = [pose(X, np.pi - 0.1), pose(X, 3.0)]
    if kind in ("frame", "prismatic"):
        turns.append(pose((1, 1, 1), 2 * np.pi / 3))
    for turn in turns:
        assert mech.closures[0].flipped(turn.rotation)
        try:  # the rows vanish near this estimate: another root is found, or none
            q, _ = mech.assemble(pin.SE3ToXYZQUAT(turn))
        except InputError as e:
            assert "flipped" in str(e)  # noqa: PT017
        else:
            assert not mech.closures[0].flipped(pin.XYZQUATToSE3(q).rotation)
    assert not mech.closures[0].flipped(pose(X, 0.4).rotation)


WRONG = {
    'kind = "revolut"': "closure.0.kind: Input should be '",
    'frames = ["a", "b"]': "missing key closure.0.kind",
    'kind = "point"\nframes = ["a", "b"]\naxis = [0, 0, 1]': "unknown key closure.0.axis; known: frames, kind, name, w",
    'kind = "in_plane"\nframes = ["a", "b"]\nsecond_axis = [0, 0, 1]': "second_axis; known: axis, frames, kind, name",
    'kind = "coupling"\nframes = ["a", "b"]\ncoefficients = [0, 1]': "closure.0.frames; known: coefficients, curve, jo",
    'kind = "coupling"\njoints = ["a", "b"]': "a coupling needs one of coefficients and curve",
    'kind = "coupling"\njoints = ["a", "a"]\ncoefficients = [0, 1]': "joins joint 'a' with itself",
    'kind = "point"\njoints = ["a", "b"]': "unknown key closure.0.joints; known: frames, kind, name, within (kind",
    'kind = "point"': "missing key closure.0.frames (kind 'point')",
    'kind = "distance"\nframes = ["a", "b"]': "missing key closure.0.length (kind 'distance')",
    'kind = "parallel"\nframes = ["a", "b"]\naxis = [0, 0, 0]': "an axis must not be zero",
    'kind = "frame"\nframes = ["a", "b"]\nlenght = 1': "key closure.0.lenght; known: frames, kind, name, within (kind",
}


@pytest.mark.parametrize("text", WRONG)
def test_wrong_keys_are_named(text):
    with pytest.raises(InputError, match=re.escape(WRONG[text])) as e:
        read_toml("[[closure]]\n" + text, "test.toml")
    assert "\n" not in str(e.value)


def in_toml(value):
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {in_toml(v)}" for k, v in value.items()) + " }"
    return repr(value).replace("'", '"')


@pytest.mark.parametrize("kind", CLOSURES)
def test_a_file_says_the_same_as_the_constructor(kind):
    described = CLOSURES[kind].model_dump(mode="json", exclude_none=True)
    lines = [f"{k} = {in_toml(v)}" for k, v in described.items()]
    assert read_toml("[[closure]]\n" + "\n".join(lines), "test.toml").closure == (CLOSURES[kind],)


def two_wheels(kinds, coefficients):
    model = tree(kinds, [0, 0])
    names = list(model.names)[1:]
    return Mechanism(model, [Closure.coupling(*names, coefficients, name="gears")])


def test_gears_between_unbounded_joints_are_measured_up_to_teeth():
    mech = two_wheels(["continuous", "continuous"], (0.2, -2.5))
    for turns in range(-3, 4):
        y = 0.4 + 2 * np.pi * turns
        q, _ = mech.coordinates({"continuous_0": 0.2 - 2.5 * y, "continuous_1": y})
        assert mech.residual(q, np.zeros(2))[0] == pytest.approx([0], abs=1e-14)
        q, _ = mech.coordinates({"continuous_0": 0.25 - 2.5 * y, "continuous_1": y})
        assert mech.residual(q, np.zeros(2))[0] == pytest.approx([0.05], abs=1e-14)


def test_a_rack_on_an_unbounded_pinion_is_measured_up_to_turns():
    mech = two_wheels(["prismatic", "continuous"], (0.0, 0.05))
    q, _ = mech.coordinates({"prismatic_0": 0.05 * 17.0 + 1e-3, "continuous_1": 17.0})
    assert mech.residual(q, np.zeros(2))[0] == pytest.approx([1e-3], abs=1e-15)
    q, v = mech.assemble(v={"continuous_1": 2.0})
    assert v == pytest.approx([0.1, 2.0])


def test_undefined_couplings_are_rejected_by_name():
    with pytest.raises(InputError, match=r"'gears': the ratio 3.14.* of two unbounded joints is not a fraction"):
        two_wheels(["continuous", "continuous"], (0.0, np.pi))
    with pytest.raises(InputError, match="'gears': powers of an unbounded joint's angle"):
        two_wheels(["revolute", "continuous"], (0.0, 1.0, 1.0))
    with pytest.raises(InputError, match="'gears' needs joints of one coordinate; joint 'spherical_1' has nv = 3"):
        two_wheels(["revolute", "spherical"], (0.0, 1.0))
    with pytest.raises(UnknownNameError, match="unknown joint 'wheel'"):
        Mechanism(tree(["revolute", "revolute"], [0, 0]), [Closure.coupling("wheel", "revolute_1", (0.0, 1.0))])


def test_a_saved_run_keeps_every_kind(tmp_path):
    model = tree(JOINTS, PARENTS, seed=3)
    higher = [closure_kinds.HIGHER[name].model_copy(update={"name": name}) for name in ("open law", "through points")]
    mech = Mechanism(model, closures=[CLOSURES["coupling"], CLOSURES["in_plane"], *higher], drivers=[DRIVERS["joint"]])
    sol = mbdae.solve(mech, (0, 0.05), rtol=1e-6)
    sol.save(tmp_path / "run.npz")
    again = mbdae.Solution.load(tmp_path / "run.npz")
    assert again.mechanism.constraints == mech.constraints
    assert again.lam == pytest.approx(sol.lam, rel=1e-12)
