"""Motions of very different frequencies in one mechanism: all are resolved, in modes, root loci and statics."""

import numpy as np
import pinocchio as pin
import pytest
from motions import frozen

import mbdae
from mbdae import JointDamping, JointSpring, Mechanism
from mbdae.errors import InputError
from mbdae.mechanism.forces.spring_damper import SpringDamper

GROWTH = np.sqrt(9.81 / 1.01)  # 1/s: 1 kg 1 m above a hinge, 0.01 kg m^2 about its centre


def sliding(model, name, mass):
    """A body on a slider along x, with a frame of its name."""
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), name)
    model.appendBodyToJoint(joint, pin.Inertia(mass, np.zeros(3), mass * 1e-6 * np.eye(3)), pin.SE3.Identity())
    model.addFrame(pin.Frame(name + "_eye", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME))


def pole_and_chip(stiffness=2e6):
    """An upright pole next to a chip of 1 mg on a spring."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "pole")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.array([0, 0, 1.0]), 0.01 * np.eye(3)), pin.SE3.Identity())
    sliding(model, "chip", 1e-6)
    return Mechanism(model, forces=[JointSpring(name="mount", joint="chip", stiffness=stiffness, damping=1e-3)])


def slides(*springs, mass=1.0):
    """Bodies on sliders, each with a spring to the ground."""
    model = pin.Model()
    model.gravity = pin.Motion.Zero()
    forces = []
    for i, stiffness in enumerate(springs):
        sliding(model, f"slide_{i}", mass)
        forces.append(JointSpring(name=f"spring_{i}", joint=f"slide_{i}", stiffness=stiffness))
    return Mechanism(model, forces=forces)


def test_a_chip_does_not_hide_a_pole_that_falls():
    found = mbdae.modes(pole_and_chip(), np.zeros(2))
    assert not found.stable
    real = np.sort(found.eigenvalues.real[found.eigenvalues.imag == 0])
    np.testing.assert_allclose(real, [-GROWTH, GROWTH], rtol=1e-14)
    fast = found.eigenvalues[found.eigenvalues.imag > 0]
    np.testing.assert_allclose(fast, [-500 + 1j * np.sqrt(2e12 - 500**2)], rtol=1e-12)
    assert [np.abs(shape).argmax() for shape in found.shapes] == [0, 0, 1]
    assert mbdae.equilibrium(pole_and_chip(), np.zeros(2), find="any").stability == "unstable"


def test_a_stable_equilibrium_is_found_with_a_chip():
    """The search continues until the pole hangs, too, whose forces are 1e-6 of the chip's."""
    found = mbdae.equilibrium(pole_and_chip(), np.array([0.3, 1e-4]))
    assert abs(found.q[0] - np.pi) < 1e-12
    assert found.stability == "stable"


def test_masses_coupled_at_a_million_radians_per_second():
    """Equal free masses of 1 kg: two zeros of their centre, and a frequency of sqrt(2 k)."""
    model = pin.Model()
    model.gravity = pin.Motion.Zero()
    for name in ("left", "right"):
        sliding(model, name, 1.0)
    k = 0.5e12
    model.frames[model.getFrameId("right_eye")].placement.translation = np.array([1.0, 0.0, 0.0])
    mech = Mechanism(model, forces=[SpringDamper(frames=("left_eye", "right_eye"), stiffness=k, length=1.0)])
    found = mbdae.modes(mech, np.zeros(2))
    assert np.count_nonzero(found.eigenvalues == 0) == 2
    assert found.eigenvalues.imag.max() == pytest.approx(1e6, rel=1e-12)
    assert 0.01 < found.free_below < 1  # 1e-7 of it: that the centre is free is known to rounding
    assert "cannot be distinguished from free ones (largest |lambda| 1e+06 rad/s)" in str(found)


@pytest.mark.parametrize("name", ["double_pendulum", "flexible_four_bar", "flyball_governor", "heavy_top"])
def test_what_is_rounding_is_not_shown(name):
    """Motions without any dissipation, and those of a damped mechanism that do not move its damper."""
    found = mbdae.modes(frozen(mbdae.load(name)))
    assert len(found.roots)
    parts = np.concatenate([found.roots.real, found.roots.imag])
    assert not ((parts != 0) & (np.abs(parts) < 1e-12 * np.abs(np.tile(found.roots, 2)))).any()
    assert "e-" not in str(found).partition("\n\n")[2].partition("modes below")[0]


@pytest.mark.parametrize("ratio", [1e-3, 1e-12])
def test_small_damping_is_known_next_to_a_stiff_spring(ratio):
    """x'' + 2 ratio w x' + w^2 x = 0 of two bodies, of which the other is 1e6 times as fast."""
    mech = slides(1e12, 1.0)
    mech = Mechanism(mech.model, forces=[*mech.forces, JointDamping(joint="slide_1", damping=2 * ratio)])
    slow, fast = mbdae.modes(mech, np.zeros(2)).roots
    assert slow.real == pytest.approx(-ratio, rel=1e-9)
    assert (fast.real, fast.imag) == (0, pytest.approx(1e6))


@pytest.mark.parametrize("stiffness", [1.0, 0.49, 9.0, 1e6])
def test_critical_damping(stiffness):
    """A double eigenvalue -c / 2 m without a second eigenvector, c^2 = 4 k m: known to the root of EPS."""
    w = np.sqrt(stiffness)
    mech = slides(stiffness)
    mech = Mechanism(mech.model, forces=[*mech.forces, JointDamping(joint="slide_0", damping=2 * w)])
    found = mbdae.modes(mech, np.zeros(1))
    np.testing.assert_allclose(found.eigenvalues, [-w, -w], rtol=1e-7)
    np.testing.assert_array_equal(found.damping, [1.0, 1.0])


def test_a_root_locus_over_a_stiffness_invents_no_change():
    found = mbdae.root_locus(pole_and_chip, "stiffness", np.geomspace(1e-2, 1e8, 11), q=np.zeros(2))
    assert found.changes == ()
    grow = np.abs(found.eigenvalues - GROWTH).min(axis=1)
    assert grow.max() < 1e-13 * GROWTH


PAIRS = [(1e12, 1e-2), (1e12, 1e-8), (1e6, -1e-4), (1.0, -1e-10), (1e-10, -1e-20), (1e12, 1e12), (1e6, 0.0)]


@pytest.mark.parametrize(("stiff", "soft"), PAIRS)
def test_verdicts_on_pairs_of_springs(stiff, soft):
    verdict = mbdae.equilibrium(slides(stiff, soft), np.zeros(2), find="any").verdict
    assert verdict.stability == ("unstable" if soft < 0 else "neutral" if soft == 0 else "stable")
    assert (verdict.unstable, verdict.neutral) == (int(soft < 0), int(soft == 0))


@pytest.mark.parametrize("slow", [1.0, 1e-6])
def test_a_slow_acceleration_is_no_equilibrium(slow):
    """A spring that is stretched by half a metre, at any frequency."""
    mech = slides(slow**2)
    with pytest.raises(InputError, match="joint 'slide_0' accelerates"):
        mbdae.modes(mech, np.array([0.5]))
    assert mbdae.modes(mech, np.zeros(1)).eigenvalues.imag.max() == pytest.approx(slow)
