"""Rank loss during a run: detected, reported, crossed where positions are projected, never silently."""

import json
import pickle

import numpy as np
import pinocchio as pin
import pytest
from click.testing import CliRunner
from shared import shared_model

import mbdae
from mbdae.__main__ import cli
from mbdae.errors import AssemblyError, StepError, UnknownNameError
from mbdae.integrate.run import backward_steps

HORIZONTAL = [0.714355529, 1.228159387, 2.65687, 3.170674, 4.599385]  # s: when the cranks of two four-bars lie along x


def cranks(sol):
    names = sol.mechanism.joint_names
    return sol.q[:, [i for i, name in enumerate(names) if name.startswith("crank")]]


def fall():
    """The time at which the cranks lie along x, by the quadrature of energy, for one four-bar with equal bars."""
    from scipy.integrate import quad

    # N = 1: J = 2/3 + 1 kg m^2 (two cranks, a coupler that does not rotate), weight arm 2/2 + 1 m
    inertia, arm = 2 / 3 + 1, 2.0
    energy = inertia / 2 + 9.81 * arm
    rate = lambda a: 1 / np.sqrt(2 * (energy - 9.81 * arm * np.cos(a)) / inertia)  # noqa: E731
    return [quad(rate, 0, a, epsabs=1e-13)[0] for a in (np.pi / 2, 3 * np.pi / 2)]


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{"project": True}, {"formulation": "ggl"}, {"project": True, "method": "herk4"}])
def test_passed_and_reported_where_positions_are_kept(options):
    sol = mbdae.solve(mbdae.load("n_four_bar", N=1), (0, 1.4), rtol=1e-8, **options)
    assert sol.success
    np.testing.assert_allclose([x.t for x in sol.singular], fall(), atol=1e-6)
    assert np.ptp(cranks(sol), axis=1).max() < 1e-10
    for x in sol.singular:
        assert (x.rank, x.rank_there, x.closures) == (2, 1, ("pin_1",))
        assert abs(np.sin(x.q[0])) < 1e-6
        np.testing.assert_allclose(x.v[0], sol(x.t).v[0], rtol=1e-6)


def test_a_crossing_uses_nodes_of_the_run_when_no_backward_step_succeeds(monkeypatch):
    asked = []

    def rejected(run, *_):
        asked.append(run.t)
        raise StepError("step_size", "rounding forbids steps so sharp")

    monkeypatch.setattr(backward_steps, "time_loop", rejected)
    sol = mbdae.solve(mbdae.load("n_four_bar", N=1), (0, 2), rtol=1e-8, project=True)
    assert asked
    assert sol.success
    np.testing.assert_allclose([x.t for x in sol.singular], fall(), atol=1e-6)
    assert np.ptp(cranks(sol), axis=1).max() < 1e-10
    assert mbdae.drift(sol).energy_relative < 1e-6


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9])
def test_drifted_loops_are_closed_before_a_singular_configuration(rtol):
    sol = mbdae.solve(mbdae.load("n_four_bar", N=2), (0, 2.8), rtol=rtol, project=False)
    assert sol.success, sol.message
    assert np.ptp(cranks(sol), axis=1).max() < max(1e-6, 2 * rtol)
    np.testing.assert_allclose([x.t for x in sol.singular], HORIZONTAL[:3], atol=max(1e-6, 100 * rtol))


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{"method": "DOP853", "formulation": "index1"}, {"step": 0.011}])
def test_loops_that_have_drifted_open_stop_before(options):
    """Open by 1e-12 m and more they may continue folded, whatever the energy; closer to closed they pass."""
    sol = mbdae.solve(mbdae.load("n_four_bar", N=2), (0, 10), **options)
    assert sol.status == "rank"
    assert "rank 4 falls to 2" in sol.message
    assert "pin_1, pin_2" in sol.message
    assert "project=True" in sol.message
    assert sol.t[-1] <= sol.singular[-1].t
    assert np.ptp(cranks(sol), axis=1).max() < 1e-4
    np.testing.assert_allclose([x.t for x in sol.singular], HORIZONTAL[: len(sol.singular)], atol=0.015)


@pytest.mark.parametrize("rtol", [1e-6, 1e-8])
def test_tiny_implicit_steps_do_not_go_astray_in_silence(rtol):
    sol = mbdae.solve(shared_model("n_four_bar"), (4, 5), *later(), rtol=rtol, method="radau5", project=True)
    assert sol.success or sol.status == "rank"
    assert np.ptp(cranks(sol), axis=1).max() < 1e-6


def test_nor_do_runs_that_stay_near_singular_configurations():
    """Such a run folds the row and continues with one crank at rest, where every configuration is singular."""
    sol = mbdae.solve(mbdae.load("n_four_bar", N=3), (0, 2), rtol=1e-7, method="radau9", project=False)
    assert sol.success or (sol.status == "rank" and "singular configuration" in sol.message)
    assert np.ptp(cranks(sol), axis=1).max() < 1e-4


def later():
    sol = mbdae.solve(shared_model("n_four_bar"), (0, 4), rtol=1e-9, project=True)
    return sol.q[-1], sol.v[-1]


@pytest.mark.slow
def test_a_run_that_leaves_its_branch_in_a_singular_configuration_ends(monkeypatch):
    """One crank is at rest and the other bars rotate: loops stay closed, and energy is conserved."""
    from mbdae.integrate.steppers import stepper

    projected, jumped = stepper.project_end, []

    def jumping(run, t, state):
        if t > fall()[0] + 0.004 and not jumped:
            jumped.append(t)
            state = state._replace(y=np.array([0.0, -0.05, -0.05, 0.0, -7.0, -7.0, 0.0]))
        return projected(run, t, state)

    monkeypatch.setattr(stepper, "project_end", jumping)
    sol = mbdae.solve(mbdae.load("n_four_bar", N=1), (0, 1), step=0.002, project=True, backend="python")
    assert sol.status == "rank"
    assert "left its branch there" in sol.message
    assert sol.t[-1] < jumped[0]


def test_commands_and_files(tmp_path):
    path = str(tmp_path / "run.npz")
    run = CliRunner().invoke(cli, ["solve", "n_four_bar", "-t", "1", "--project", "-o", path])
    assert run.exit_code == 0
    assert "singular configuration: rank 4 falls to 2 at t = 0.71435" in run.output
    sol = mbdae.Solution.load(path)
    assert abs(sol.singular[0].t - HORIZONTAL[0]) < 1e-6
    assert sol.singular[0].closures == ("pin_1", "pin_2")
    stopped = CliRunner().invoke(cli, ["solve", "n_four_bar", "-t", "4", "--step", "0.011", "--json"])
    assert stopped.exit_code == 1
    assert json.loads(stopped.stdout)["singular"][0]["rank_there"] == 2


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{}, {"project": True}, {"formulation": "ggl"}])
def test_a_start_in_a_singular_configuration_is_rejected_when_the_rank_rises(options):
    mech = mbdae.load("n_four_bar", N=1)
    sol = mbdae.solve(mech, (0, 1), np.zeros(3), np.array([1.0, -1.0, 1.0]), **options)
    assert sol.status in ("rank", "newton")
    assert "rank" in sol.message


@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "panda_handle"])
def test_regular_motions_have_none(name):
    assert mbdae.solve(shared_model(name), (0, 2), rtol=1e-6).singular == []


@pytest.mark.usefixtures("back_end")
def test_fixed_steps_to_a_singular_configuration_say_so():
    mech, end = mbdae.load("n_four_bar", N=1), fall()[0]
    options = {"step": end / 64}
    sol = mbdae.solve(mech, (0, end), project=True, **options)
    assert sol.status == "rank"
    assert "singular configuration" in sol.message
    assert sol.t[-1] < end
    assert mbdae.solve(mech, (0, 0.99 * end), project=True, **options).success


@pytest.mark.usefixtures("back_end")
def test_every_closure_that_loses_rank_is_named():
    """All pins of a row of linkages do, at once."""
    found = mbdae.solve(mbdae.load("n_four_bar", N=6), (0, 1), rtol=1e-6, project=True).singular[0]
    assert found.closures == tuple(f"pin_{i}" for i in range(1, 7))
    assert (found.rank, found.rank_there) == (12, 6)
    assert "6 closures from pin_1 to pin_6" in str(found)


@pytest.mark.usefixtures("back_end")
def test_backwards():
    mech = mbdae.load("n_four_bar", N=1)
    there = mbdae.solve(mech, (0, 1), rtol=1e-8, project=True)
    back = mbdae.solve(mech, (1, 0), there.q[-1], there.v[-1], rtol=1e-8, project=True)
    np.testing.assert_allclose(back.singular[0].t, there.singular[0].t, atol=1e-6)
    np.testing.assert_allclose(back.q[-1], there.q[0], atol=1e-6)


def test_comparisons_pass_singular_configurations():
    """Their reference projects positions where loops would drift open, and errors are those of the steps."""
    mech = mbdae.load("n_four_bar", N=1)
    study = mbdae.compare(mech, (0, 1), methods=["project:pherk5", "pherk5"], rtol=[1e-5], repeats=1)
    kept, drifted = study.points
    assert study.uncertainty["q"] < 1e-7
    assert kept.errors["q"] < 1e-3
    assert drifted.status in ("rank", "finished")


def test_errors_are_passed_on_from_other_processes():
    for error in (StepError("rank", "text"), UnknownNameError("model", "x", ["y"]), AssemblyError("open", "pin", 0.1)):
        again = pickle.loads(pickle.dumps(error))
        assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("method", ["herk3", "herk5", "pherk5", "radau5"])
@pytest.mark.parametrize("step", [0.25, 0.1])
def test_fixed_steps_that_would_end_there_cross(method, step):
    """Without gravity a crank rotates a quarter turn per second: the bars are in line at 1 s and 3 s, on the grid."""
    mech = mbdae.load("n_four_bar", N=1)
    mech.model.gravity.linear = np.zeros(3)
    q, v = mech.assemble({"crank_0": np.pi / 2}, {"crank_0": -np.pi / 2})
    sol = mbdae.solve(mech, (0, 4), q, v, method=method, step=step, project=True)
    assert sol.success, sol.message
    np.testing.assert_allclose([x.t for x in sol.singular], [1.0, 3.0], atol=1e-6)
    np.testing.assert_allclose(cranks(sol)[-1], -3 * np.pi / 2, atol=1e-9)
    assert np.ptp(cranks(sol), axis=1).max() < 1e-9
    grid = np.arange(round(4 / step) + 1) * step
    assert np.isclose(sol.t[:, None], grid, atol=1e-9).sum() == len(grid) - 2


# -- near to a singular configuration --------------------------------------------------------------------------------


def bars(gap=0.0, gravity=0.0, **options):
    """A crank and a rocker of 1 m, a coupler of 2 m, on a ground that is longer by a gap."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    inertia = pin.Inertia(1.0, np.zeros(3), 0.1 * np.eye(3))
    for name, parent, at in (("crank", 0, 0.0), ("coupler", 1, 1.0), ("rocker", 0, 2.0 + gap)):
        joint = model.addJoint(parent, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([at, 0, 0])), name)
        model.appendBodyToJoint(joint, inertia, pin.SE3(np.eye(3), np.array([0.5, 0, 0])))
    for name, joint, length in (("a", 2, 2.0), ("b", 3, 1.0)):
        tip = pin.SE3(np.eye(3), np.array([length, 0, 0]))
        model.addFrame(pin.Frame(name, joint, tip, pin.FrameType.OP_FRAME))
    return mbdae.Mechanism(model, [mbdae.Closure.point("a", "b", name="pin")], **options)


SIGNS = np.array([1.0, -1.0, 1.0])  # of the angles of a parallelogram; without gravity it turns at a constant rate


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("method", ["pherk5", "herk5"])
@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-6, 1e-3, 0.05, -0.05])
def test_a_terminal_event_next_to_one_is_met(method, angle):
    event = mbdae.Event(lambda t, q, v: q[0] - angle, terminal=True)
    sol = mbdae.solve(bars(), (0, 3), 1.2 * SIGNS, -3 * SIGNS, method=method, rtol=1e-7, events=event)
    assert (sol.status, sol.t[-1]) == ("event", pytest.approx((1.2 - angle) / 3, abs=1e-9))
    np.testing.assert_allclose(sol.q[-1], angle * SIGNS, atol=1e-8)
    np.testing.assert_allclose(sol.v[-1], -3 * SIGNS, atol=1e-7)
    onward = mbdae.solve(bars(), (sol.t[-1], 2), sol.q[-1], sol.v[-1], method=method, rtol=1e-7)
    if abs(angle) < 1e-5:
        assert onward.status == "rank"
        assert "singular configuration" in onward.message
    else:
        np.testing.assert_allclose(onward.q[-1], (1.2 - 6) * SIGNS, atol=1e-4)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("end", [0.4, 0.39, 0.4 + 1e-7, 0.42])
def test_a_run_may_end_next_to_one(end):
    sol = mbdae.solve(bars(), (0, end), 1.2 * SIGNS, -3 * SIGNS, max_step=0.05)
    assert sol.success, sol.message
    np.testing.assert_allclose(sol.q[-1], (1.2 - 3 * end) * SIGNS, atol=1e-9)
    np.testing.assert_allclose(sol.v[-1], -3 * SIGNS, atol=1e-7)


@pytest.mark.parametrize("rate", [2.0, 1.5])
def test_a_sampled_controller_passes_with_the_mechanism(rate):
    brake = mbdae.Sampled(lambda t, q, v: 2 * (-4 - v[:1]), rate=rate, joints="crank", name="brake")
    sol = mbdae.solve(bars(gravity=9.81, forces=[brake]), (0, 2), 1.2 * SIGNS, -8 * SIGNS, rtol=1e-7)
    assert sol.success, sol.message
    assert sol.singular
    assert np.abs(sol.q - sol.q[:, :1] * SIGNS).max() < 1e-6


@pytest.mark.parametrize("gap", [1e-3, 1e-5, 1e-7])
def test_bars_with_a_gap_turn_round_the_corner(gap):
    mech = bars(gap, 9.81)
    q, v = mech.assemble({"crank": 1.2}, {"crank": -5.0}, guess={"coupler": -1.2, "rocker": 1.2})
    exact = mbdae.solve(mech, (0, 0.4), q, v, method="pherk6", step=2e-5, project=True)
    assert abs(np.ptp(exact.q[-1] * SIGNS)) > 0.1  # it has left the motion of the parallelogram
    for method in ("pherk5", "pherk6"):
        sol = mbdae.solve(mech, (0, 0.4), q, v, method=method, rtol=1e-7)
        assert sol.success, sol.message
        assert not sol.singular
        np.testing.assert_allclose(sol.q[-1], exact.q[-1], atol=1e-5)


def test_an_interrupt_during_a_crossing_is_passed_on():
    """The force is called in the backward steps of a crossing, too."""
    times = []

    def watched(t, q, v):
        if times and t < times[-1] - 0.02:
            raise KeyboardInterrupt
        times.append(max([t, *times[-1:]]))
        return np.zeros(3)

    sol = mbdae.solve(bars(gravity=9.81, forces=[watched]), (0, 2), 1.2 * SIGNS, -8 * SIGNS, rtol=1e-7)
    assert sol.status == "interrupted"
    assert 0 < sol.t[-1] < 0.3
