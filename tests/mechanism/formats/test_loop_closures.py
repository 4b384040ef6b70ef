"""loop_closures.yaml next to a URDF, as CAD exporters write it: a parallelogram that was cut is closed again."""

import numpy as np
import pytest

import mbdae
from mbdae.errors import InputError, UnknownNameError

pytestmark = pytest.mark.filterwarnings("ignore:.*not carried over")  # joint limits, which have separate tests

LINK = """<link name="{0}"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
<inertia ixx="0.001" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/>
<origin xyz="{3} 0 0" rpy="{4} 0 0"/><axis xyz="0 {5} 0"/>
<limit lower="-9" upper="9" effort="1" velocity="1"/></joint>"""
URDF = '<robot name="linkage"><link name="base_link"/>' + "".join(
    [LINK.format(name) for name in ("crank", "coupler", "rocker")]
    + [JOINT.format("base__crank", "base_link", "crank", 0, 0, -1)]
    + [JOINT.format("crank__coupler", "crank", "coupler", 0.2, 3.141592653589793, 1)]
    + [JOINT.format("base__rocker", "base_link", "rocker", 0.5, 0, -1)]
) + "</robot>"  # fmt: skip
LOOPS = """
closures:
- link_a: coupler
  link_b: rocker
  point: [0.7, 0.0, 0.0]
  axis: [0.0, 1.0, 0.0]
dependent: [crank__coupler, base__rocker]
independent: [base__crank]
"""


@pytest.fixture
def package(tmp_path):
    (tmp_path / "urdf").mkdir()
    (tmp_path / "urdf" / "linkage.urdf").write_text(URDF)
    (tmp_path / "loop_closures.yaml").write_text(LOOPS)
    return tmp_path


def test_a_cut_hinge_is_closed(package):
    mech = mbdae.load(package / "urdf" / "linkage.urdf")
    assert [(c.name, c.kind) for c in mech.closures] == [("loop 1", "revolute")]
    assert [m.name for m in mech.motors] == ["base__crank"]
    q, _ = mech.assemble(q={"base__crank": 0.4}, guess={"base__rocker": 0.4, "crank__coupler": 0.4})
    np.testing.assert_allclose(q[[0, 2]], 0.4, atol=1e-10)  # a parallelogram: both cranks have the same angle
    ends = [mech.frame(q, f"loop 1 on {link}") for link in ("coupler", "rocker")]
    np.testing.assert_allclose(ends[0][0], [0.5 + 0.2 * np.cos(0.4), 0, 0.2 * np.sin(0.4)], atol=1e-12)
    np.testing.assert_allclose(ends[0][0], ends[1][0], atol=1e-10)
    sol = mbdae.solve(mech, (0, 0.01))
    sol.save(package / "run.npz")
    assert mbdae.Solution.load(package / "run.npz").mechanism.closures == mech.closures


@pytest.mark.parametrize(
    ("old", "new", "error", "words"),
    [
        ("link_b: rocker", "link_b: roker", UnknownNameError, "unknown frame 'roker'"),
        ("[base__crank]", "[crank]", UnknownNameError, "unknown joint 'crank'"),
        ("  point:", "  points:", InputError, r"loop_closures\.yaml: .*closures\.0\.point"),
        ("closures:", "- [", InputError, r"loop_closures\.yaml is not YAML"),
    ],
)
def test_faults_are_said_by_name(package, old, new, error, words):
    (package / "loop_closures.yaml").write_text(LOOPS.replace(old, new))
    with pytest.raises(error, match=words):
        mbdae.load(package / "urdf" / "linkage.urdf")
