"""Equilibria: published and closed-form values, starts from anywhere, verdicts, holding torques, and errors by name."""

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner
from columns import column
from motions import frozen
from smooth import SMOOTH

import mbdae
from mbdae import JointSpring, JointTorque, Sampled
from mbdae.__main__ import cli
from mbdae.errors import EquilibriumError, InputError, UnknownNameError
from mbdae.mechanism.equilibrium.equilibrium_equations import Statics
from mbdae.mechanism.formats.mechanism_file.template import Template

COMMANDS = (
    "equilibrium double_pendulum",
    "equilibrium snap_toggle --q pin=-0.5",
    "equilibria four_bar --drive crank",
    "load-path snap_toggle --load press --to 0.2 --plot snap.png",
)
NAMES = SMOOTH
CRANK = -1.82338478542147607  # rad, four_bar: root of the potential's derivative in 30 digits


def disturbed(mech, rng, width=0.6):
    """A closed configuration far from the start."""
    for _ in range(20):
        try:
            return mech.assemble(mech.manifold.integrate(mech.start[0], rng.uniform(-width, width, mech.nv)))[0]
        except mbdae.MbdaeError:
            continue
    return mech.start[0]


def test_four_bar_rests_where_its_potential_is_least():
    found = mbdae.equilibrium(mbdae.load("four_bar"))
    assert abs(found.q[0] - CRANK) < 1e-14
    np.testing.assert_allclose(found.eigenvalues, [19.0474902392289699], rtol=1e-13)
    assert (found.stability, found.verdict.unstable, found.verdict.neutral) == ("stable", 0, 0)


def test_a_governor_turns_steadily():
    """The slider's height at one turn per second, from the reduced equations in one unknown."""
    found = mbdae.equilibrium(mbdae.load("flyball_governor"), v={"shaft": 2 * np.pi})
    names = found.mechanism.joint_names
    assert abs(found.q[names.index("slider")] - 0.69216470264792956) < 1e-13
    np.testing.assert_allclose(found.q[[names.index("rod_1"), names.index("rod_2")]], 0.31271309431474218, atol=1e-13)
    assert found.stability == "stable"
    assert abs(found.holding["shaft"]) < 1e-12  # it turns freely


def test_the_benchmark_with_a_diagonal_spring():
    found = mbdae.equilibrium(mbdae.load("spring_four_bar"))
    np.testing.assert_allclose(found.q[[0, 2]], 2.23433101901759, atol=1e-13)


@pytest.mark.parametrize("name", [n for n in NAMES if n != "rolling_disc"])
def test_disturbed_starts_all_come_to_rest(name):
    mech, rng = mbdae.load(name), np.random.default_rng(1)
    for _ in range(8):
        found = mbdae.equilibrium(mech, disturbed(mech, rng))
        assert found.iterations <= 25
        assert found.residual < 1e-11
        assert found.stability in ("stable", "neutral", "rigid")


@pytest.mark.parametrize("name", ["four_bar", "panda_handle", "stewart_platform"])
def test_a_run_from_an_equilibrium_stays_there(name):
    mech = frozen(mbdae.load(name))
    found = mbdae.equilibrium(mech)
    sol = mbdae.solve(mech, (0, 10), found.q, found.v, s=found.s, rtol=1e-10)
    assert np.abs(sol.q - found.q).max() < 1e-9
    np.testing.assert_allclose(sol.lam[0], found.lam, atol=1e-9 * (1 + np.abs(found.lam).max()))


def test_unstable_poses_are_left_or_reported():
    mech = mbdae.load("four_bar")
    found = mbdae.equilibrium(mech, {"crank": 1.5}, find="any")
    assert (found.stability, found.verdict.unstable) == ("unstable", 1)
    assert abs(found.q[0] - 1.5432) < 1e-4
    assert mbdae.equilibrium(mech, found.q).stability == "stable"
    assert CliRunner().invoke(cli, ["equilibrium", "four_bar", "--q", "crank=1.5", "--find", "any"]).exit_code == 1
    hanging = mbdae.equilibrium(mbdae.load("heavy_top"))
    assert (hanging.stability, hanging.verdict.neutral) == ("neutral", 1)
    assert CliRunner().invoke(cli, ["equilibrium", "heavy_top"]).exit_code == 3


@pytest.fixture(scope="module")
def branch():
    """All equilibria of the four-bar over its crank, and how often derivatives of forces were taken."""
    with pytest.MonkeyPatch.context() as patch:
        taken, derivatives = [], Statics.partials
        patch.setattr(Statics, "partials", lambda *given: taken.append(given) or derivatives(*given))
        return mbdae.equilibria(mbdae.load("four_bar"), "crank"), len(taken)


def test_all_equilibria_of_a_branch(branch, monkeypatch):
    assert sorted(e.stability for e in branch[0]) == ["stable", "stable", "unstable", "unstable"]
    cranks = {e.stability: e.q[0] % (2 * np.pi) for e in branch[0][:2]}  # the circuit of the start comes first
    assert abs(cranks["stable"] - (CRANK + 2 * np.pi)) < 1e-13
    assert abs(cranks["unstable"] - 1.5432) < 1e-4
    monkeypatch.setattr("mbdae.studies.statics.equilibria.POINTS", 61)
    assert len(json.loads(CliRunner().invoke(cli, "equilibria four_bar --drive crank --json").stdout)) == 4


def test_derivatives_of_forces_are_taken_at_equilibria_alone(branch):
    """Of each circuit 361 poses are compared by the sign of the force along it."""
    assert len(branch[0]) == 4
    assert 0 < branch[1] < 100


@pytest.mark.parametrize("name", ["double_pendulum", "flyball_governor", "snap_toggle", "panda_handle", "heavy_top"])
def test_an_equilibrium_is_found_again_from_itself(name):
    """Where no closure transmits force the forces themselves vanish there: their residual is rounding."""
    mech = mbdae.load(name)
    first = mbdae.equilibrium(mech)
    for away in (0.0, 1e-13):
        again = mbdae.equilibrium(mech, mech.manifold.integrate(first.q, np.full(mech.nv, away)))
        assert again.stability == first.stability
        assert again.iterations <= 3
        assert np.abs(mech.manifold.difference(first.q, again.q)).max() < 1e-9 or first.stability == "neutral"


def test_a_branch_of_equilibria_needs_a_free_joint():
    """The integrators of the delta robot determine its arm angles; and the holding torque of a joint is reported."""
    with pytest.raises(InputError, match="an integrator prescribes 'arm_1'"):
        mbdae.equilibria(mbdae.load("delta_robot"), "arm_1", hold=["arm_2", "arm_3"])
    mech = mbdae.load("double_pendulum")
    found = mbdae.equilibria(mech, "joint2", hold="joint1")
    alone = [mbdae.equilibrium(mech, e.q, hold="joint1", find="any").holding["joint1"] for e in found]
    assert len(found) == 2
    np.testing.assert_allclose([e.holding["joint1"] for e in found], alone, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(("name", "drive", "reason"), [
    ("jansen_walker", "crank", "a driver prescribes 'crank'"),
    ("cam_follower", "cam", "a driver prescribes 'cam'"),
    ("delta_robot", "arm_1", "2 joints besides 'arm_1'"),
])  # fmt: skip
def test_what_is_driven_is_rejected_before_any_pose_is_followed(name, drive, reason, monkeypatch):
    monkeypatch.setattr("mbdae.studies.statics.equilibria.kinematics", None)
    with pytest.raises(InputError, match=reason):
        mbdae.equilibria(mbdae.load(name), drive, span=(-0.5, 0.5))


def test_a_follower_force_flutters(tmp_path):
    """Ziegler's column: masses 2 and 1, springs 1, bars 1: flutter above 7/2 - sqrt(2), where stiffness is positive.

    H. Ziegler, Ing.-Arch. 20 (1952).
    """
    (tmp_path / "column.toml").write_text(column({"lower": 2.0, "upper": 1.0}, stiffness=1.0, axes="frame"))
    model, critical = tmp_path / "column.toml", 3.5 - np.sqrt(2)
    for share, word in ((0.999, "stable"), (1.001, "unstable")):
        mech = Template(model).make({"force.load.force": [-share * critical, 0.0, 0.0]})
        found = mbdae.equilibrium(mech, {"lower": 0.0})
        assert found.stability == word
        assert found.verdict.by == "eigenvalues"
        assert np.linalg.det(found.mechanism.system().inertia(0.0, found.q)) > 0
    path = mbdae.load_path(mbdae.load(model), "load", (0, 3))
    assert not [e for e in path.critical if e.kind == "limit"]


def test_the_holding_torque_balances_the_weight():
    mech = mbdae.load("double_pendulum")
    free = mbdae.equilibrium(mech)
    first = mech.joint_names[0]
    held = mbdae.equilibrium(mech, {first: 1.0}, hold=first)
    q, h = held.q, 1e-5
    up, down = (mech.energy(mech.manifold.integrate(q, s * h * np.eye(2)[0]), np.zeros(2))[1] for s in (1, -1))
    assert held.holding[first] == pytest.approx((up - down) / (2 * h), rel=1e-8)
    assert free.holding == {}
    both = mbdae.equilibrium(mech, {first: 1.0}, hold=mech.joint_names)
    assert both.stability == "rigid"
    assert set(both.holding) == set(mech.joint_names)


def test_reactions_carry_the_weight():
    """No acceleration, and the multipliers are those of the run's solve: of least norm."""
    mech = mbdae.load("four_bar")
    found = mbdae.equilibrium(mech)
    rates, lam = mech.system().derivative(0.0, np.concatenate([found.q, found.v, found.s, [0.0]]))
    assert np.abs(rates).max() < 1e-12
    np.testing.assert_allclose(found.lam, lam, atol=1e-12)
    assert np.linalg.norm(found.reaction("pin").force) == pytest.approx(np.linalg.norm(lam))


def test_integrators_find_their_reference():
    mech = mbdae.load("delta_robot")
    found = mbdae.equilibrium(mech)
    rates = mech.system().derivative(0.0, np.concatenate([found.q, found.v, found.s, [0.0]]))[0][mech.nv : -1]
    assert np.abs(rates).max() < 1e-9
    assert found.stability == "stable"
    assert found.verdict.by == "eigenvalues"


def random_load(mech, rng):
    """The mechanism with torques on some joints and springs on others."""
    joints = zip(mech.joint_names, list(mech.model.joints)[1:], strict=True)
    plain = [name for name, joint in joints if joint.nq == joint.nv == 1]
    forces = list(mech.forces)
    for i, name in enumerate(rng.permutation(plain)[:3].tolist()):
        size = 10 ** rng.uniform(-1, 2)
        made = JointTorque(joint=name, torque=size * rng.standard_normal(), name=f"push {i}")
        spring = JointSpring(joint=name, stiffness=size, rest=float(rng.standard_normal()), name=f"spring {i}")
        forces.append(made if rng.random() < 0.5 else spring)
    return mbdae.Mechanism(mech.model, mech.closures, forces, drivers=mech.drivers, start=mech.start_values)


@pytest.mark.slow
def test_random_loads_end_in_an_equilibrium_or_a_reason():
    rng, reasons, found = np.random.default_rng(7), [], 0
    models = {n: mbdae.load(n) for n in NAMES}
    for i in range(60):
        mech = random_load(models[NAMES[i % len(NAMES)]], rng)
        try:
            assert mbdae.equilibrium(mech).residual < 1e-7
            found += 1
        except EquilibriumError as e:
            reasons.append(str(e))
    assert found >= 42
    assert all(re.match("no (stable )?equilibrium", text) and "\n" not in text for text in reasons)


# -- rejections --------------------------------------------------------------------------------------------------------


def test_what_falls_has_no_equilibrium():
    mech = mbdae.Mechanism(mbdae.load("heavy_top").model, title="falling")
    with pytest.raises(EquilibriumError, match=r"no stable equilibrium found.*of the largest force.*joint 'top'") as e:
        mbdae.equilibrium(mech)
    assert e.value.residual > 0.1
    assert e.value.joint == "top"


def test_a_disc_falls_flat_where_its_contact_is_none():
    """No equilibrium exists beyond the edge on which the contact is singular, and none is found by stepping over it."""
    mech, rng = mbdae.load("rolling_disc"), np.random.default_rng(1)
    for _ in range(10):
        with pytest.raises(EquilibriumError, match="most at joint 'lean'") as e:
            mbdae.equilibrium(mech, disturbed(mech, rng))
        assert abs(e.value.q[5]) < 1.6


def test_a_pose_in_which_closures_lose_rank_gets_no_verdict():
    mech = Template("n_four_bar?N=1").make({"gravity": [0.0, 0.0, 0.0]})
    found = mbdae.equilibrium(mech, np.zeros(3))
    assert found.stability == "singular"
    assert "lose rank" in str(found)


@pytest.mark.parametrize(
    ("named", "error", "text"),
    [
        ({"find": "best"}, UnknownNameError, "valid: stable, any"),
        ({"hold": "knee"}, UnknownNameError, "unknown joint 'knee'"),
        ({"v": {"crank": 1.0}}, InputError, "do not satisfy the closures"),
        ({"q": {"crank": "up"}}, InputError, "crank"),
    ],
)
def test_wrong_arguments_are_named(named, error, text):
    with pytest.raises(error, match=text):
        mbdae.equilibrium(mbdae.load("four_bar"), **named)


def test_sampled_controllers_are_rejected():
    mech = mbdae.load("double_pendulum")
    force = Sampled(lambda t, q, v: -q, rate=10, name="computer")
    with pytest.raises(InputError, match="'computer' is a sampled controller"):
        mbdae.equilibrium(mbdae.Mechanism(mech.model, (), [force]))


def test_it_is_a_table_by_the_names_of_signals(tmp_path):
    """A row whose forces are those of a run that begins there at rest; files that pandas reads; LaTeX."""
    pandas = pytest.importorskip("pandas")
    mech = mbdae.load("spring_four_bar")
    rest, held = mbdae.equilibrium(mech), mbdae.equilibrium(mech, hold="left")
    sol = mbdae.solve(mech, (0, 1e-6), rest.q, rest.v, method="herk2", step=1e-6)
    frame, moving, named = rest.to_pandas(), sol.signals(), sol.to_columns().units
    names = [n for n in frame.columns if n in moving]
    assert {"q.left", "force.pin", "force.pin.x", "torque.pin.y"} <= set(names)
    for name in names:
        assert frame[name][0] == pytest.approx(moving[name][0], abs=1e-9), name
        assert frame.attrs["units"][name] == named[name]
    frame = held.to_pandas()
    assert frame.attrs["units"]["holding.left"] == "N m"
    assert frame["holding.left"][0] == held.holding["left"]
    done = CliRunner().invoke(cli, ["equilibrium", "spring_four_bar", "--hold", "left", "-o", str(tmp_path / "e.csv")])
    assert f"wrote {tmp_path / 'e.csv'}" in done.output
    pandas.testing.assert_frame_equal(pandas.read_csv(tmp_path / "e.csv"), frame, rtol=1e-12)
    assert "force.pin & " in held.to_latex()
    assert ">holding.left</td>" in held._repr_html_()
    assert re.search(r"left is held by \S+ N m$", str(held), re.M)
    slid = mbdae.equilibrium(mbdae.load("slider_crank"), hold=["slider"])
    assert re.search(r"slider is held by \S+ N$", str(slid), re.M)
    assert held.to_xarray()["force.pin"].attrs["units"] == "N"
