"""Inverse dynamics: forward and back, against drivers' multipliers, energies and closed forms; invalid input."""

import numpy as np
import pinocchio as pin
import pytest
from linkages import bar, parallelogram
from scipy.interpolate import make_interp_spline

import mbdae
from mbdae import Driver, Mechanism, inverse_dynamics, kinematics
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.model_settings import Start

COMMANDS = (
    "solve four_bar -t 0.2 -o bar.npz",
    "inverse-dynamics four_bar bar.npz -a crank",
    "inverse-dynamics slider_crank --drive crank --speed 10 --points 30",
)
ARM = [f"panda_joint{i}" for i in range(1, 8)]


def swing(t, values, amplitude=0.2):
    """Smooth motions from given start values."""
    return {n: x + amplitude * (1 - np.cos((2 + i) * t)) for i, (n, x) in enumerate(values.items())}


@pytest.mark.parametrize(
    ("model", "moved", "actuators"),
    [
        ("slider_crank", {"crank": 0.3}, ["slider"]),
        ("delta_robot", {"arm_1": 0.35, "arm_2": 0.35, "arm_3": 0.35}, None),
        ("panda_handle", {"handle": -0.45, "panda_joint1": -0.88, "panda_joint3": -0.89}, ARM),
    ],
)
def test_forward_again(model, moved, actuators):
    """The free mechanism under the efforts repeats the motion; the Panda has more of them than degrees of freedom."""
    mech = mbdae.load(model)
    t = np.linspace(0, 0.4, 241)
    found = inverse_dynamics(mech, {"t": t, **swing(t, moved)}, actuators)
    efforts = make_interp_spline(t, found.efforts, k=7)
    at = [mech.coordinates({n: 0.0}, of_v=True)[1][0] for n in actuators or moved]

    def push(time, q, v):
        out = np.zeros(mech.nv)
        out[at] = efforts(time)
        return out

    kept = [f for f in mech.forces if f.kind != "joint_pid"]
    assert found.replaced == tuple(f.name for f in mech.forces if f not in kept)
    assert all(f"'{name}'" in str(found) for name in found.replaced)
    free = Mechanism(mech.model, mech.closures, [*kept, push])
    q, v = free.assemble(found.q[0], found.v[0])
    sol = mbdae.solve(free, (0, t[-1]), q, v, rtol=1e-11, t_eval=t[::40])
    away = [mech.manifold.difference(a, b) for a, b in zip(found.q[::40], sol.q, strict=True)]
    assert np.abs(away).max() < 1e-9
    np.testing.assert_allclose(sol.v, found.v[::40], rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("model", "driver"),
    [
        ("slider_crank", Driver.harmonic("crank", 0.5, 5.0, offset=0.3, name="motor")),
        ("four_bar", Driver.at_speed(("world", "coupler_tip"), -0.2, start=2.5263, name="cylinder")),
    ],
)
def test_multipliers_of_drivers_are_the_efforts(model, driver):
    mech = mbdae.load(model, drivers=[driver])
    q, v = mech.assemble(q=mbdae.load(model).start[0], v=np.zeros(mech.nv))
    sol = mbdae.solve(mech, (0, 0.4), q, v, rtol=1e-9)
    found = inverse_dynamics(mech, sol)
    assert found.names == (driver.name,)
    expected = sol.effort(driver.name)
    scale = np.abs(expected.effort).max()
    np.testing.assert_allclose(found.efforts[:, 0], expected.effort, rtol=0, atol=1e-11 * scale)
    np.testing.assert_allclose(found.power[:, 0], expected.power, rtol=0, atol=1e-10 * np.abs(expected.power).max())
    rows = sol.lam.shape[1] - 1
    np.testing.assert_allclose(found.lam, sol.lam[:, :rows], rtol=0, atol=1e-11 * np.abs(sol.lam).max())
    assert found.demands[0].energy == pytest.approx(sol.work[-1], rel=1e-3)


def test_units_of_a_joint_whose_name_another_one_begins_with():
    model, body = pin.Model(), pin.Inertia(1.0, np.array([0, 0, -0.1]), 0.01 * np.eye(3))
    joints = [("slide", pin.JointModelPX()), ("slide.tip", pin.JointModelRY())]
    for i, (name, joint) in enumerate(joints):
        model.appendBodyToJoint(model.addJoint(i, joint, pin.SE3.Identity(), name), body, pin.SE3.Identity())
    mech = Mechanism(model)
    sol = mbdae.solve(mech, (0, 0.2), [0.0, 0.3], [0.0, 0.0])
    assert inverse_dynamics(mech, sol, ["slide", "slide.tip"]).units == ("N", "N m")


@pytest.mark.slow
def test_power_is_the_rate_of_energy():
    mech = mbdae.load("slider_crank")
    turn = kinematics(mech, "crank", points=721)
    found = inverse_dynamics(mech, turn, speed=10.0)
    energy = [sum(mech.energy(q, v)) for q, v in zip(found.q, found.v, strict=True)]
    rate = make_interp_spline(found.t, energy, k=7)(found.t, 1)
    np.testing.assert_allclose(found.power[8:-8, 0], rate[8:-8], rtol=0, atol=1e-9 * np.abs(rate).max())
    demand = found.demands[0]
    assert demand.energy == pytest.approx(0, abs=1e-9)  # a full turn
    effort = make_interp_spline(found.over, found.efforts[:, 0], k=7)
    assert demand.peak == pytest.approx(abs(effort(demand.at)), rel=1e-10)
    assert demand.peak == pytest.approx(
        np.abs(effort(np.linspace(found.over[0], found.over[-1], 200_001))).max(), rel=1e-8
    )
    assert demand.rms == pytest.approx(np.sqrt(np.mean(found.efforts[:-1] ** 2)), rel=1e-6)


def test_two_motors_share_by_their_speeds():
    """Q = r_1 tau_1 + r_2 tau_2 with least norm: tau_i = r_i Q / (r_1^2 + r_2^2); with weights r_i / w_i."""
    mech = mbdae.load("four_bar")
    turn = kinematics(mech, "crank", points=31)
    alone = inverse_dynamics(mech, turn, speed=2.0).efforts[:, 0]
    r = turn.ratio("rocker")
    both = inverse_dynamics(mech, turn, ["crank", "rocker"], speed=2.0).efforts
    np.testing.assert_allclose(both, alone[:, None] * np.column_stack([r**0, r]) / (1 + r**2)[:, None], atol=1e-12 * 40)
    more = inverse_dynamics(mech, turn, ["crank", "rocker"], speed=2.0, weights={"rocker": 4.0}).efforts
    shares = np.column_stack([r**0, r / 4]) / (1 + r**2 / 4)[:, None]
    np.testing.assert_allclose(more, alone[:, None] * shares, atol=1e-12 * 40)


def test_a_run_that_is_free_takes_no_effort():
    mech = mbdae.load("four_bar")
    sol = mbdae.solve(mech, (0, 1), rtol=1e-8)
    found = inverse_dynamics(mech, sol, "crank")
    np.testing.assert_allclose(found.efforts, 0, atol=1e-11)
    np.testing.assert_allclose(found.lam, sol.lam, atol=1e-10)
    np.testing.assert_allclose(found.reaction("pin").force, sol.reaction("pin").force, atol=1e-10)
    columns = found.signals()
    names = [name for name in columns if name.startswith(("force.pin", "torque.pin"))]
    assert len(names) == 8
    for name, values in sol.signals(names).items():  # magnitudes, and components along the first frame
        np.testing.assert_allclose(columns[name], values, atol=1e-10)


def test_a_table_is_followed(tmp_path):
    mech = mbdae.load("slider_crank")
    t = np.linspace(0, 0.5, 51)
    rows = "\n".join(f"{a!r},{b!r}" for a, b in zip(t.tolist(), (0.3 + 10 * t).tolist(), strict=True))
    (tmp_path / "motion.csv").write_text(f"t,crank\n{rows}\n")
    found = inverse_dynamics(mech, tmp_path / "motion.csv", "crank")
    turn = inverse_dynamics(mech, kinematics(mech, "crank", span=(0.3, 5.3), points=51), speed=10.0)
    np.testing.assert_allclose(found.efforts, turn.efforts, atol=1e-8)
    sol = mbdae.solve(mech, (0, 0.2), rtol=1e-9, t_eval=np.linspace(0, 0.2, 101))
    sol.save(tmp_path / "run.csv")
    again = inverse_dynamics(mech, tmp_path / "run.csv", "crank")
    assert np.abs(again.efforts[10:-10]).max() < 1e-4
    found.save(tmp_path / "efforts.csv")
    assert (tmp_path / "efforts.csv").read_text().startswith("t,effort.crank,speed.crank,power.crank,lam.")


def test_poses_with_rank_loss_are_reported():
    mech = parallelogram()
    q = np.array([[u, -u, u] for u in (3.0, np.pi, 3.3)])
    v = np.tile([1.0, -1.0, 1.0], (3, 1))
    found = inverse_dynamics(mech, (np.array([0.0, 0.5, 1.0]), q, v, 0 * v), "crank")
    assert np.isnan(found.efforts[:, 0]).tolist() == [False, True, False]
    assert found.undetermined.tolist() == [0.5]
    assert "closures lose rank" in str(found)
    with pytest.raises(InputError, match=r"branch point crank = 3\.14159265"):
        inverse_dynamics(mech, kinematics(mech, "crank", span=(np.pi - 1, np.pi + 1), points=3), speed=1.0)


def pendulum():
    model = pin.Model()
    first = bar(model, 0, (0, 0), 1.0, "upper")
    bar(model, first, (1, 0), 1.0, "lower")
    return Mechanism(model, start=Start(q={"upper": 0.1}))


@pytest.mark.parametrize(
    ("mech", "motion", "actuators", "words"),
    [
        (pendulum, {"t": [0, 1, 2], "upper": [0, 0.1, 0.2], "lower": [0, 0.2, 0]}, "upper", "cannot produce"),
        (pendulum, {"t": [0, 1, 2], "upper": [0, 0.1, 0.2]}, "upper", "1 degrees of freedom are undetermined when"),
        (pendulum, {"t": [0, 1, 2], "knee": [0, 0.1, 0.2]}, "upper", "unknown joint of one coordinate"),
        (pendulum, {"t": [0, 2, 1], "upper": [0, 1, 2]}, "upper", "must increase"),
        (pendulum, {"upper": [0, 1, 2]}, "upper", "has a column t"),
        (pendulum, {"t": [0, 1, 2], "upper": [0, 0, 0], "lower": [0, 0, 0]}, None, "name the joints"),
        (pendulum, "nowhere.csv", "upper", r"no file 'nowhere\.csv': a motion is"),
        (pendulum, 7, "upper", "a motion is a Solution"),
        (pendulum, ([0.0], [[0, 0, 0]], [[0, 0]], [[0, 0]]), "upper", "q of a motion"),
        (pendulum, ([], *[np.empty((0, 2))] * 3), "upper", "t of a motion is finite and has shape"),
        (pendulum, {"t": 0.0, "upper": [0, 1, 2]}, "upper", "three numbers at least, got 1"),
        (pendulum, {"t": [0, 1, 2], "upper": [0, 1]}, "upper", "'upper' of a motion has 2 values at 3 times"),
        (pendulum, {"t": [0, 1, 2], "upper": [0, np.nan, 1]}, "upper", "'upper' of .* no finite value in row 2"),
        (lambda: mbdae.load("four_bar"), ([0.0], *[[[0, 0, 0]]] * 3), "crank", "'pin'"),
    ],
)
def test_wrong_input_is_one_line(mech, motion, actuators, words):
    with pytest.raises(InputError, match=words) as reported:
        inverse_dynamics(mech(), motion, actuators)
    assert "\n" not in str(reported.value)


def test_a_table_is_read_as_measurements_are(tmp_path):
    """Also as spreadsheets write it, with the mark of their encoding; a column that occurs twice is ambiguous."""
    path = tmp_path / "motion.csv"
    path.write_text("t,upper,upper\n0,0,1\n1,1,1\n2,2,1\n")
    with pytest.raises(InputError, match="two columns are named 'upper'"):
        inverse_dynamics(pendulum(), path, "upper")
    path.write_text("t,upper,lower\n0,0,0\n1,1,0\n2,2,0\n", "utf-8-sig")
    read = inverse_dynamics(pendulum(), path, ["upper", "lower"])
    assert read.t.tolist() == [0, 1, 2]
    parquet, arrow = pytest.importorskip("pyarrow.parquet"), pytest.importorskip("pyarrow")
    parquet.write_table(arrow.table({"t": [0, 1, 2], "upper": [0.0, 1, 2], "lower": [0.0] * 3}), tmp_path / "m.parquet")
    again = inverse_dynamics(pendulum(), tmp_path / "m.parquet", ["upper", "lower"])
    np.testing.assert_array_equal(again.efforts, read.efforts)


@pytest.mark.parametrize("heading", ["upper [mm]", "q.upper [rad/s]", "t [N]"])
def test_a_heading_of_another_kind_is_rejected(heading, tmp_path):
    """An angle in mm would be one in rad, three orders of magnitude off."""
    path, name = tmp_path / "motion.csv", heading.partition(" ")[0]
    path.write_text(("t,q.upper,q.lower\n0,0,0\n1,1,0\n2,2,0\n").replace(name, heading, 1))
    with pytest.raises(InputError, match=rf"column '(q\.)?{name}' is in '.*', valid: (s|rad), "):
        inverse_dynamics(pendulum(), path, ["upper", "lower"])


def test_wrong_names_and_weights():
    mech = mbdae.load("four_bar")
    turn = kinematics(mech, "crank", points=3)
    with pytest.raises(UnknownNameError, match="unknown actuator 'crnk'"):
        inverse_dynamics(mech, turn, "crnk", speed=1.0)
    with pytest.raises(InputError, match="give the constant speed of 'crank'"):
        inverse_dynamics(mech, turn)
    for weights, words in (({"crank": 0.0}, "weight of 'crank' must be"), ({"crank": "a"}, "weight of 'crank' must be"),
                           ([1.0], "weights are a table")):  # fmt: skip
        with pytest.raises(InputError, match=words):
            inverse_dynamics(mech, turn, speed=1.0, weights=weights)
    with pytest.raises(InputError, match="whose joints are not those"):
        inverse_dynamics(mbdae.load("slider_crank"), turn, speed=1.0)


@pytest.mark.parametrize("name", ["gone.npz", "gone.csv"])
def test_a_missing_motion_is_reported_first(name):
    """Also where actuators are to be named."""
    with pytest.raises(InputError, match=name):
        inverse_dynamics(mbdae.load("four_bar"), name)
