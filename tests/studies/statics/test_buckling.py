"""Branch points where several eigenvalues cross zero at once: columns on springs under gravity."""

import numpy as np
import pinocchio as pin
import pytest
from columns import column

import mbdae
from mbdae import JointSpring, Mechanism

MASS, LENGTH, G = 2.0, 0.5, 9.81
WEIGHT = MASS * G * LENGTH  # N m/rad: a column of this stiffness buckles under its weight


def standing(*stiffness, axes=None, mass=MASS):
    """Columns side by side, or hinged on top of each other about the given axes, on springs (N m/rad)."""
    model, forces, parent = pin.Model(), [], 0
    for i, k in enumerate(stiffness):
        axis = axes[i] if axes else pin.JointModelRY()
        joint = model.addJoint(parent, axis, pin.SE3.Identity(), f"foot_{i}")
        carries = not axes or i == len(stiffness) - 1
        body = pin.Inertia(mass, np.array([0, 0, LENGTH]), 1e-3 * np.eye(3)) if carries else pin.Inertia.Zero()
        model.appendBodyToJoint(joint, body, pin.SE3.Identity())
        if axes:
            parent = joint
        forces.append(JointSpring(name=f"spring_{i}", joint=f"foot_{i}", stiffness=k))
    if axes:  # the hinge between both has a small body
        model.inertias[1] = pin.Inertia(1e-3, np.zeros(3), 1e-3 * np.eye(3))
    return Mechanism(model, forces=forces)


@pytest.mark.parametrize("m", [1, 2, 3, 4])
def test_equal_columns_buckle_at_once(m):
    """A root of multiplicity m at k / (m g l), and a single one of a stiffer column."""
    mech = standing(*[6.25 * WEIGHT] * m, 8.75 * WEIGHT)
    path = mbdae.load_path(mech, "gravity", (1.0, 10.0))
    assert [(e.kind, e.multiplicity) for e in path.critical] == [("branch", m), ("branch", 1)]
    np.testing.assert_allclose([e.factor for e in path.critical], [6.25, 8.75], rtol=1e-10)
    shapes = path.critical[0].shapes
    M = mech.system().inertia(0.0, path.critical[0].q)
    np.testing.assert_allclose(shapes @ M.T @ M @ shapes.T, np.eye(m), atol=1e-9)
    assert np.abs(shapes[:, m]).max() < 1e-6 * np.abs(shapes).max()  # the stiffer one does not buckle
    steps = [int(path.unstable[np.abs(path.factor - x).argmin()]) for x in (3.0, 7.5, 9.5)]
    assert steps == [0, m, m + 1]
    assert (f"in {m} shapes at once" in str(path)) == (m > 1)


def test_a_column_on_two_axes_buckles_in_any_direction():
    """Equal springs about two axes, except for the joints' small masses: the double root k / (m g l)."""
    mech = standing(4.0 * WEIGHT, 4.0 * WEIGHT, axes=(pin.JointModelRX(), pin.JointModelRY()))
    path = mbdae.load_path(mech, "gravity", (1.0, 6.0))
    assert [(e.kind, e.multiplicity) for e in path.critical] == [("branch", 2)]
    assert path.critical[0].factor == pytest.approx(4.0, rel=1e-10)
    assert np.linalg.matrix_rank(path.critical[0].shapes) == 2


def test_a_soft_column_and_a_stiff_one():
    """Both roots are found, though one spring is 1e10 times the other."""
    mech = standing(2.0 * WEIGHT, 2e10 * WEIGHT)
    path = mbdae.load_path(mech, "gravity", (1.0, 4.0))
    assert [e.factor for e in path.critical] == pytest.approx([2.0], rel=1e-10)


def test_free_motions_are_no_branch_points():
    """A hinge with a vertical axis turns freely at every load; in addition two columns buckle at once."""
    mech = standing(3.0 * WEIGHT, 3.0 * WEIGHT)
    model = pin.Model(mech.model)
    joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "free")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    path = mbdae.load_path(Mechanism(model, forces=mech.forces), "gravity", (1.0, 4.0))
    assert [(e.kind, e.multiplicity) for e in path.critical] == [("branch", 2)]
    assert path.critical[0].factor == pytest.approx(3.0, rel=1e-10)
    assert np.abs(path.critical[0].shapes[:, 2]).max() < 1e-6


def test_follower_forces_report_that_roots_may_be_missed(tmp_path):
    """A follower force on the bar has no potential."""
    (tmp_path / "column.toml").write_text(column({"lower": 2.0, "upper": 1.0}, stiffness=1.0, axes="frame"))
    path = mbdae.load_path(mbdae.load(tmp_path / "column.toml"), "load", (0.1, 1.0))
    assert not path.potential
    assert "with double roots may be missing" in str(path)


@pytest.mark.slow
def test_a_four_bar_rests_on_both_circuits():
    """Mirrored about its level ground, heights and the signs of its potential are inverted: minimum becomes maximum."""
    found = mbdae.equilibria(mbdae.load("four_bar"), "crank")
    names = {s: np.sort([e.coordinates["q.crank"] for e in found if e.stability == s]) for s in ("stable", "unstable")}
    assert [len(x) for x in names.values()] == [2, 2]
    turn = 2 * np.pi
    mirrored = np.sort(-names["unstable"] % turn)
    np.testing.assert_allclose(np.sort(names["stable"] % turn), mirrored, atol=1e-12)
    assert np.abs(names["stable"] % turn - -1.82338478542147607 % turn).min() < 1e-12
