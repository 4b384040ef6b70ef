"""Wrists of three concurrent axes: orientations are counted once, unless there are bodies between the axes."""

import importlib
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae import Closure, Mechanism, assembly_modes
from mbdae.mechanism.equations.axis_chains import axis_chains
from mbdae.mechanism.model_settings import Start

SCRIPTS = Path(__file__).parents[3] / "examples" / "benchmarks"
ARM, WRIST, DRIVE = range(1, 4), range(4, 7), 7  # joints of the random mechanism
BALL = """
<mujoco>
  <worldbody>
    <body name="arm">
      <joint name="arm" type="hinge" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 1 0 0" size="0.02"/>
      <body name="rod" pos="1 0 0">
        <joint name="x" type="hinge" axis="1 0 0"/>
        <joint name="y" type="hinge" axis="0 1 0"/>
        <joint name="z" type="hinge" axis="0 0 1"/>
        <geom type="capsule" fromto="0 0 0 1 0 0" size="0.02"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def wrist(monkeypatch):
    """A random arm with a wrist of three hinges, and the number of its modes."""
    monkeypatch.syspath_prepend(SCRIPTS)
    case = importlib.import_module("assembly_modes").wrist(1)
    return case.mech, case.count


def with_massless_links(mech):
    model = mech.model.copy()
    for link in WRIST[:-1]:
        model.inertias[link] = pin.Inertia.Zero()
    return Mechanism(model, mech.closures, start=mech.start_values)


def with_one_joint(mech, kind, angles):
    """Replace the three hinges by one joint with these angles."""
    old, model = mech.model, pin.Model()
    parent = 0
    for i in (*ARM, WRIST[-1], DRIVE):
        joint = kind if i == WRIST[-1] else old.joints[i]
        above = 0 if i == DRIVE else parent
        parent = model.addJoint(above, joint, old.jointPlacements[WRIST[0] if i == WRIST[-1] else i], old.names[i])
        model.appendBodyToJoint(parent, old.inertias[i], pin.SE3.Identity())
        for name in ("end", "target"):
            frame = old.frames[old.getFrameId(name)]
            if frame.parentJoint == i:
                model.addFrame(pin.Frame(name, parent, frame.placement, pin.FrameType.OP_FRAME))
    guess = {old.names[i]: float(mech.start[0][i - 1]) for i in ARM} | {old.names[WRIST[-1]]: angles}
    return Mechanism(model, mech.closures, start=Start(q={"drive": 0.0}, guess=guess))


def three_hinges():
    joint = pin.JointModelComposite(3)
    for axis in (pin.JointModelRX(), pin.JointModelRY(), pin.JointModelRZ()):
        joint.addJoint(axis, pin.SE3.Identity())
    return joint


def count(mech):
    found = assembly_modes(mech, "drive", 0.0)
    assert found.warnings == ()
    return len(found.modes)


def test_bodies_between_the_axes_have_two_poses_for_each_orientation(wrist):
    mech, modes = wrist
    assert axis_chains(mech) == []
    assert count(mech) == modes == 4


def test_links_without_mass_are_no_bodies(wrist):
    mech, modes = wrist
    found = assembly_modes(with_massless_links(mech), "drive", 0.0)
    assert len(found.modes) == modes / 2
    elbows = [m.q[ARM[-1] - 1] for m in found.modes]
    assert abs(elbows[0] - elbows[1]) > 1e-3


@pytest.mark.parametrize("kind", [three_hinges(), pin.JointModelSphericalZYX()], ids=["composite", "ZYX"])
def test_three_angles_of_one_joint_are_an_orientation(wrist, kind):
    mech, modes = wrist
    model, q = mech.model, mech.start[0]
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    turn = data.oMi[ARM[-1]].rotation.T @ data.oMi[WRIST[-1]].rotation
    zyx = tuple(pin.rpy.matrixToRpy(turn)[::-1].tolist())
    angles = zyx if kind.shortname() == "JointModelSphericalZYX" else tuple(q[WRIST[0] - 1 : WRIST[-1]].tolist())
    assert count(with_one_joint(mech, kind, angles)) == modes / 2


def test_what_is_attached_to_a_link_ends_its_chain(wrist):
    """A frame, or a wheel that a coupling moves."""
    mech = with_massless_links(wrist[0])
    (chain,) = axis_chains(mech)
    assert (chain.before, chain.last, sorted(chain.columns.tolist())) == (3, 6, [3, 4, 5])
    geared = Mechanism(mech.model, [*mech.closures, Closure.coupling("arm_1", "wrist_2", (0.0, 0.5))])
    assert axis_chains(geared) == []
    model = mech.model.copy()
    model.addFrame(pin.Frame("pin", WRIST[0], pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    (chain,) = axis_chains(Mechanism(model, mech.closures))
    assert (chain.before, chain.last) == (4, 6)


@pytest.mark.filterwarnings("ignore:.*not carried over")
def test_several_joints_of_an_mjcf_body_are_a_chain(tmp_path):
    (tmp_path / "ball.xml").write_text(BALL)
    mech = mbdae.load(tmp_path / "ball.xml")
    (chain,) = axis_chains(mech)
    np.testing.assert_array_equal(np.sort(chain.columns), [1, 2, 3])
