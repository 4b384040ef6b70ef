"""Paths of equilibria under a growing load: closed forms of a truss and of a buckling column."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from columns import column

import mbdae
from mbdae.__main__ import cli
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.formats.mechanism_file.template import Template

L0 = np.sqrt(1.25)


def press(z):
    """Force in units of 100 N that holds the toggle's pin at height z."""
    return 20 * z * (L0 / np.sqrt(1 + z * z) - 1)


@pytest.mark.slow
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
    """A bar of 2 m with a spring at its foot is upright until P l = k."""
    (tmp_path / "column.toml").write_text(column({"bar": 1.0}, stiffness=6.0, tip=2.0))
    path = mbdae.load_path(mbdae.load(tmp_path / "column.toml"), "load", (0, 5))
    assert [e.kind for e in path.critical] == ["branch"]
    assert path.critical[0].factor == pytest.approx(3.0, rel=1e-9)
    apart = np.abs(path.factor - 3.0) > 1e-6
    np.testing.assert_array_equal(path.unstable[apart] > 0, path.factor[apart] > 3.0)


def test_a_path_is_plain_data():
    """A path that ends after Newton's corrections contains numpy numbers."""
    path = mbdae.load_path(mbdae.load("four_bar"), "gravity", (1.0, 1.1))
    assert path.complete is True
    assert json.loads(json.dumps(path.to_dict()))["complete"] is True


def test_weight_is_a_load_too():
    """With reversed gravity the four-bar is inverted: the poses are equal at every load factor."""
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


@pytest.mark.slow
def test_the_command_follows_a_load_to_its_full_size_and_names_unknown_ones():
    """One Newton path, two calls: --to is 1 when left out, as the end of ``span``."""
    said = CliRunner().invoke(cli, ["load-path", "snap_toggle", "--load", "press", "--json"], catch_exceptions=False)
    path = mbdae.load_path(mbdae.load("snap_toggle"), "press")
    assert json.loads(said.stdout)["factor"] == path.to_dict()["factor"]
    assert path.factor[-1] == pytest.approx(1.0)
    with pytest.raises(UnknownNameError, match="unknown force 'presss'"):
        CliRunner().invoke(cli, ["load-path", "snap_toggle", "--load", "presss"], catch_exceptions=False)


@pytest.mark.parametrize("name", ["heavy_top", "cart_pole", "double_pendulum", "panda_handle"])
def test_a_hanging_equilibrium_persists_in_a_stronger_field(name):
    """Motions without stiffness are ignored, forces that vanish in the equilibrium balance, and nothing buckles."""
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


def test_an_unbounded_slider_needs_a_range():
    """Below its snapping load the toggle has three equilibria; 0.2 of 100 N is z (1 / l - 1 / L0) = 0.2."""
    mech = Template("snap_toggle").make({"force.press.force": [0.0, 0.0, -20.0]})
    with pytest.raises(InputError, match="'pin' slides without bound"):
        mbdae.equilibria(mech, "pin")
    found = mbdae.equilibria(mech, "pin", span=(-1.0, 1.0))
    assert [e.stability for e in found] == ["stable", "unstable", "stable"]
    words = ["equilibria", "snap_toggle", "--drive", "pin", "--from", "-1", "--to", "1", "--json"]
    said = CliRunner().invoke(cli, words)
    assert [e["stability"] for e in json.loads(said.stdout)] == ["stable"]
