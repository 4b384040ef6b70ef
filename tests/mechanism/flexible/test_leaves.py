"""Flexible bodies are leaves of the tree: a node takes no child, but a weld."""

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism.flexible import attach_flexible

BAR = """
[[flexible]]
name = "{name}"
parent = "{parent}"
joint = "{joint}"
length = 1.0
young = 7e10
density = 2700.0
area = 1e-4
second_moment = 8e-11
polar_moment = 1.6e-10
modes = 6
nodes = {{ root = 0.0, tip = 1.0 }}
"""
CLAMPED = BAR.format(name="bar", parent="world", joint="fixed")
WELD = '[[closure]]\nkind = "frame"\nframes = ["bar.tip", "arm.root"]\n'


def blade():
    return mbdae.beam(length=1.0, young=7e10, density=2700.0, area=1e-4, second_moment=8e-11, modes=2)


@pytest.mark.parametrize(
    ("child", "text"),
    [
        (
            BAR.format(name="arm", parent="bar.tip", joint="fixed"),
            r"'arm' cannot be a child of a mode of 'bar'.*to a node.*: bar.root, bar.tip",
        ),
        ('[[body]]\nname = "disk"\nparent = "bar.tip"\nmass = 1.0\n', r"'bar.tip' cannot be a parent.*weld it"),
        ('[[frame]]\nname = "flag"\nparent = "bar"\n', r"'bar' cannot be a parent: 'bar' is flexible"),
    ],
)
def test_children_of_nodes_are_rejected(tmp_path, child, text):
    (tmp_path / "bar.toml").write_text(CLAMPED + child)
    with pytest.raises(InputError, match=text):
        mbdae.load(tmp_path / "bar.toml")


def test_a_weld_to_a_node_carries_a_beam(tmp_path):
    """Two beams of 1 m are a cantilever of 2 m: its first frequency is 1.8751^2 sqrt(EI / (rho A L^4)).

    Modes of a cantilever have no moment at the tip, so 1% is left with 6.
    """
    arm = BAR.format(name="arm", parent="world", joint="free")
    start = "[start]\nguess = { arm = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0] }\n"
    (tmp_path / "bar.toml").write_text("gravity = [0.0, 0.0, 0.0]\n" + CLAMPED + arm + WELD + start)
    found = mbdae.modes(mbdae.load(tmp_path / "bar.toml")).frequencies
    expected = 1.8751041**2 * np.sqrt(7e10 * 8e-11 / (0.27 * 2.0**4)) / (2 * np.pi)
    assert found[found > 0].min() == pytest.approx(expected, rel=1.5e-2)


@pytest.mark.parametrize("child", ["joint", "mass"])
def test_models_with_children_of_modes_are_rejected(child):
    model = pin.Model()
    body = attach_flexible(model, "blade", blade(), None)
    at = body.carrier(model)
    with pytest.raises(InputError, match="'tip' cannot be a child of a mode of 'blade'"):
        attach_flexible(model, "tip", blade(), None, at)
    if child == "joint":
        model.addJoint(at, pin.JointModelRX(), pin.SE3.Identity(), "more")
    else:
        model.appendBodyToJoint(at, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    with pytest.raises(InputError, match=r"(more|the mass at blade.mode 2)' cannot be a child of a mode of 'blade'"):
        mbdae.Mechanism(model)
