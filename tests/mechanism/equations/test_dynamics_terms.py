"""M, G, bias and frames of a mechanism at a configuration, against energies, differences and poses."""

from typing import get_args

import numpy as np
import pytest
from chains import JOINTS
from shared import shared_model

import mbdae
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.formats.body_tables import JointKind
from mbdae.mechanism.tree.joints import file_kind
from mbdae.studies.info.info import info


@pytest.mark.parametrize("name", ["four_bar", "bricard", "humanoid_stance"])
def test_terms_agree_with_energy_and_closures(name):
    mech = shared_model(name)
    q, v = mech.start
    v = np.random.default_rng(0).normal(size=mech.nv)
    M = mech.mass_matrix(q)
    np.testing.assert_array_equal(M, M.T)
    assert v @ M @ v / 2 == pytest.approx(mech.energy(q, v)[0], rel=1e-13)
    np.testing.assert_allclose(mech.jacobian(q) @ v, mech.residual(q, v)[1], atol=1e-13)
    h, still = 1e-5, np.zeros(mech.nv)
    system, there = mech.system(), [mech.manifold.integrate(q, k * h * v) for k in (1, -1)]
    high, low = (system.energy(x, still)[1] - system.laws.potential(x) for x in there)
    assert mech.bias(q, still) @ v == pytest.approx((high - low) / (2 * h), rel=1e-6, abs=1e-6)


def test_frames_are_where_closures_meet():
    mech = shared_model("four_bar")
    q, v = mech.start
    tip, R = mech.frame(q, "coupler_tip")
    np.testing.assert_allclose(tip, mech.frame(q, "rocker_tip")[0], atol=1e-12)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
    with pytest.raises(UnknownNameError, match="frame 'nowhere'"):
        mech.frame(q, "nowhere")
    with pytest.raises(InputError, match="q has shape"):
        mech.mass_matrix(q[:-1])
    with pytest.raises(InputError, match="v has shape"):
        mech.bias(q, v[:-1])


@pytest.mark.parametrize("kind", JOINTS)
def test_a_joint_is_called_as_in_mechanism_files(kind):
    words = {"rx": "revolute", "ruby": "continuous", "py": "prismatic", "euler": "spherical"}
    assert file_kind(JOINTS[kind](np.random.default_rng(1))) == words.get(kind, kind)


def test_a_card_calls_the_joints_of_a_file_as_the_file_does(tmp_path):
    kinds = [k for k in get_args(JointKind) if k != "fixed"]
    bodies = [f'[[body]]\nname = "{k}"\nparent = "world"\njoint = "{k}"\n' for k in kinds]
    bodies = [f"{body}mass = 1.0\ninertia = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]\n" for body in bodies]
    (tmp_path / "all.toml").write_text("\n".join(bodies))
    found = dict(info(mbdae.load(tmp_path / "all.toml")).joints)
    assert found == {k: k for k in kinds}
