"""Limits of URDF and MJCF files become stops on request."""

import numpy as np
import pytest

import mbdae
from mbdae.errors import InputError

URDF = """<robot name="r"><link name="base"/><link name="cart"><inertial><mass value="2"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="rail" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
<limit lower="-0.1" upper="0.2" effort="0" velocity="0"/></joint></robot>"""
MJCF = """<mujoco><worldbody><body name="cart"><joint name="rail" type="{}" axis="0 0 1" range="{} {}"/>
<geom type="sphere" size="0.1" mass="2"/></body></worldbody></mujoco>"""
FILES = {
    "rail.urdf": (URDF, -0.1, 0.2),
    "slide.xml": (MJCF.format("slide", -0.1, 0.2), -0.1, 0.2),
    "hinge.xml": (MJCF.format("hinge", -10, 20), -np.pi / 18, np.pi / 9),  # in degrees in the file
}


@pytest.mark.parametrize("joint", ["", 'joint = "rail"\n'], ids=["all", "one"])
@pytest.mark.parametrize("name", FILES)
def test_a_body_bounces_between_the_limits_of_its_joint(name, joint, tmp_path):
    # without gravity a crossing takes width/e^k at speed e^k
    text, lower, upper = FILES[name]
    (tmp_path / name).write_text(text)
    file = tmp_path / "mechanism.toml"
    file.write_text(
        f'source = "{name}"\ngravity = [0, 0, 0]\n[[stop]]\nlimits = true\nrestitution = 0.8\n{joint}'
        "[start]\nv = { rail = 1.0 }\n"
    )
    e, mech = 0.8, mbdae.load(file)
    sol = mbdae.solve(mech, (0, 3.0))
    t = np.array([x.t for x in sol.impacts])
    assert sol.status == "finished"
    assert mech.row_names == ["rail stop", "rail stop"]
    assert [x.where for x in sol.impacts[:3]] == [("rail stop upper",), ("rail stop lower",), ("rail stop upper",)]
    ways = np.array([upper, *(upper - lower) / e ** np.arange(1, len(t))])
    np.testing.assert_allclose(t, ways.cumsum(), rtol=0, atol=1e-12)
    assert len(t) >= 4
    q = np.array([sol(x)[0][0] for x in np.linspace(0, 3.0, 2001)])
    assert min(q.min() - lower, upper - q.max(), sol.q.min() - lower, upper - sol.q.max()) > -1e-9


def test_limits_that_are_no_stops_are_named(tmp_path):
    body = '<body name="{0}"><joint name="{0}" type="slide" range="0 1"/><geom size="0.1" mass="2"/></body>'
    (tmp_path / "two.xml").write_text(f"<mujoco><worldbody>{body.format('a')}{body.format('b')}</worldbody></mujoco>")
    file = tmp_path / "mechanism.toml"
    file.write_text('[[source]]\nfile = "two.xml"\nprefix = "l_"\n[[stop]]\njoint = "l_a"\nlimits = true\n')
    with pytest.warns(UserWarning, match="limits of joints b$"):
        assert mbdae.load(file).row_names == ["l_a stop", "l_a stop"]


@pytest.mark.parametrize("name", ["", 'name = "rail end"\n'])
def test_ends_in_the_wrong_order_are_named_by_stop_or_joint(name, tmp_path):
    body = '[[body]]\nname = "rail"\nparent = "world"\njoint = "prismatic"\naxis = [1, 0, 0]\nmass = 1.0\n'
    stop = f'[[stop]]\n{name}joint = "rail"\nlower = 0.5\nupper = 0.25\n'
    (tmp_path / "m.toml").write_text(body + stop)
    with pytest.raises(InputError) as caught:
        mbdae.load(tmp_path / "m.toml")
    what = "stop.rail end" if name else "stop.rail"
    assert str(caught.value).endswith(f"m.toml: {what}: lower must lie below upper, got lower = 0.5 and upper = 0.25")
