"""Paths of equilibria under a load that grows: closed forms of a truss and of a buckling column."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from columns import column

import mbdae
from mbdae.__main__ import cli
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.formats.template import Template

L0 = np.sqrt(1.25)


def press(z):
    """Force in units of 100 N that holds the toggle's pin at height z."""
    return 20 * z * (L0 / np.sqrt(1 + z * z) - 1)


def test_the_toggle_snaps_through_where_its_force_is_largest():
    path = mbdae.load_path(mbdae.load("snap_toggle"), "press", (0, 2))
    z = np.sqrt(L0 ** (2 / 3) - 1)
    assert [e.kind for e in path.critical] == ["limit", "limit"]
    np.testing.assert_allclose([e.factor for e in path.critical], [press(z), -press(z)], rtol=1e-12)
    np.testing.assert_allclose([e.q[0] for e in path.critical], [z, -z], rtol=1e-6)
    np.testing.assert_allclose(path.factor, press(path.q[:, 0]), atol=1e-11)
    inside = np.abs(path.q[:, 0]) < z * (1 - 1e-5)
    outside = np.abs(path.q[:, 0]) > z * (1 + 1e-5)
    assert path.unstable[inside].all()
    assert not path.unstable[outside].any()
    assert path.complete
    assert path.factor[-1] == pytest.approx(2)


def test_a_column_buckles(tmp_path):
    """A bar of 2 m with a spring at its foot stands until P l = k."""
    (tmp_path / "column.toml").write_text(column({"bar": 1.0}, stiffness=6.0, tip=2.0))
    path = mbdae.load_path(mbdae.load(tmp_path / "column.toml"), "load", (0, 5))
    assert [e.kind for e in path.critical] == ["branch"]
    assert path.critical[0].factor == pytest.approx(3.0, rel=1e-9)
    apart = np.abs(path.factor - 3.0) > 1e-6
    np.testing.assert_array_equal(path.unstable[apart] > 0, path.factor[apart] > 3.0)


def test_a_path_is_plain_data():
    """A path that comes to its end by Newton's corrections has numbers of numpy in it."""
    path = mbdae.load_path(mbdae.load("four_bar"), "gravity", (1.0, 1.1))
    assert path.complete is True
    assert json.loads(json.dumps(path.to_dict()))["complete"] is True


def test_weight_is_a_load_too():
    """Turned upwards, gravity takes the four-bar over: the same poses stand at every share of it."""
    path = mbdae.load_path(mbdae.load("four_bar"), "gravity", (1.0, 0.1))
    np.testing.assert_allclose(path.coordinates["q.crank"], -1.82338478542147607, atol=1e-13)


@pytest.mark.parametrize(
    ("load", "span", "error", "text"),
    [
        ("push", (0, 1), UnknownNameError, "valid: left spring, right spring, press, gravity"),
        ("press", (1, 1), InputError, "from one factor to another"),
    ],
)
def test_wrong_loads_are_named(load, span, error, text):
    with pytest.raises(error, match=text):
        mbdae.load_path(mbdae.load("snap_toggle"), load, span)


def test_a_load_and_its_end_belong_together():
    said = CliRunner().invoke(cli, ["statics", "snap_toggle", "--load", "press"])
    assert "takes --load and --to" in str(said.exception)


@pytest.mark.parametrize("name", ["heavy_top", "cart_pole", "double_pendulum", "panda_handle"])
def test_what_hangs_goes_on_hanging_in_a_stronger_field(name):
    """Motions without force are left alone, forces that vanish in the equilibrium balance, and nothing buckles."""
    mech = mbdae.load(name)
    path = mbdae.load_path(mech, "gravity", (1.0, 3.0))
    assert path.complete
    assert not path.critical
    if name != "panda_handle":  # which has springs
        assert np.abs([mech.manifold.difference(path.q[0], q) for q in path.q]).max() < 1e-9


@pytest.mark.parametrize("name", ["four_bar", "double_pendulum", "panda_handle", "flyball_governor"])
def test_a_path_cannot_begin_where_anything_is_an_equilibrium(name):
    with pytest.raises(InputError, match=r"at factor 0 .* begin at another factor"):
        mbdae.load_path(mbdae.load(name), "gravity", (0.0, 1.0))


def test_what_slides_without_end_needs_a_range():
    """Under less than its snapping load the toggle has three equilibria; 0.2 of 100 N is z (1 / l - 1 / L0) = 0.2."""
    mech = Template("snap_toggle").make({"force.press.force": [0.0, 0.0, -20.0]})
    with pytest.raises(InputError, match="'pin' slides on without end"):
        mbdae.equilibria(mech, "pin")
    found = mbdae.equilibria(mech, "pin", span=(-1.0, 1.0))
    assert [e.stability for e in found] == ["stable", "unstable", "stable"]
    said = CliRunner().invoke(cli, ["statics", "snap_toggle", "--all", "pin", "--from", "-1", "--to", "1", "--json"])
    assert [e["stability"] for e in json.loads(said.stdout)] == ["stable"]
