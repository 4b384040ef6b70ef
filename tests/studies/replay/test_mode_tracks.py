"""The marks of a replay with modes show where and when joints stick, contacts are closed and impacts occur."""

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae.studies.replay.mode_tracks import mark_drawables, mode_legend, mode_tracks_of


def marked(model, end):
    sol = mbdae.solve(mbdae.load(model), (0, end), rtol=1e-6)  # rounding of points grows with shorter steps
    times = np.linspace(0, end, 501)
    q, v = (np.array(x) for x in zip(*(sol(t) for t in times), strict=True))
    return sol, times, q, v, mode_tracks_of(sol, q)


def during(times, track):
    spans = np.reshape(track.active, (-1, 2))
    return ((times[:, None] > spans[:, 0]) & (times[:, None] <= spans[:, 1])).any(axis=1)


@pytest.mark.parametrize(
    ("model", "end", "name", "stop", "e"),
    [("pendulum_on_stop", 6.0, "rod", 0.3, 0.7), ("slider_crank_with_stop", 1.0, "slider", 0.43, 0.6)],
)
def test_stops_are_marked_while_closed_and_at_impacts(model, end, name, stop, e):
    sol, times, q, v, (track,) = marked(model, end)
    at = sol.mechanism.joint_names.index(name)
    closed = during(times, track)
    assert (track.name, track.word) == (f"{name} stop", "closed")
    assert closed.any()
    assert np.abs(q[closed, at] - stop).max() < 1e-9
    assert np.abs(v[closed]).max() < 1e-9
    assert np.abs(v[~closed & (times > 0)]).max(axis=1).min() > 1e-9
    for t in track.impacts[:3]:
        before, after = (sol(t + dt)[1][at] for dt in (-1e-9, 1e-9))
        assert after == pytest.approx(-e * before, abs=1e-6)
    assert track.strength[0] == 1, "later ones are weaker"
    assert (np.diff(track.strength) < 0).all()
    places = {"rod": 0 * q[:, :1] + [0, 0, 0], "slider": q[:, [at]] * [1, 0, 0]}
    np.testing.assert_allclose(track.positions, [places[name]], atol=1e-7)


def test_joints_are_marked_while_they_stick():
    sol, times, q, v, tracks = marked("stick_slip_slider", 2.0)
    assert [(x.name, x.word, x.impacts) for x in tracks] == [
        ("crank friction", "sticking", []),
        ("slider friction", "sticking", []),
    ]
    for track, joint in zip(tracks, ("crank", "slider"), strict=True):
        stuck, rate = during(times, track), np.abs(v[:, sol.mechanism.joint_names.index(joint)])
        assert 0 < stuck.sum() < len(times)
        assert rate[stuck].max() < 1e-12
        assert rate[~stuck & (times > 0)].min() > 1e-9
    slider = q[:, [sol.mechanism.joint_names.index("slider")]]
    np.testing.assert_allclose(tracks[1].positions, [slider * [1, 0, 0]], atol=1e-7)


def test_backlash_is_marked_at_both_joints():
    model = pin.Model()
    for x, name in enumerate("ab"):
        place = pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))
        joint = model.addJoint(0, pin.JointModelRY(), place, name)
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    play = mbdae.Stop(joints=("a", "b"), coefficients=(0.0, 2.0), lower=-0.1, upper=0.1)
    sol = mbdae.solve(mbdae.Mechanism(model, stops=[play]), (0, 1), [0.0, 0.0], [1.0, 0.0])
    (track,) = mode_tracks_of(sol, sol.q)
    assert track.impacts == pytest.approx([0.1])
    np.testing.assert_allclose(track.positions, np.array([[[0, 0, 0]], [[1, 0, 0]]]) + 0 * sol.q[:, :1], atol=1e-12)


def test_nothing_is_marked_where_nothing_switches():
    sol = mbdae.solve(mbdae.load("pendulum"), (0, 0.1))
    assert mode_tracks_of(sol, sol.q) == []


def sizes(model, span, times):
    """Scales of the marks of a run at the times of their keys, by name."""
    sol = mbdae.solve(mbdae.load(model), span, t_eval=times)
    moving = mark_drawables(mode_tracks_of(sol, sol(times)[0]), times, 1.0, 0.01)
    return {p.name: m["scale"] for p, m in zip(moving.drawables, moving.motions, strict=True)}


def test_marks_of_a_replay_that_begins_within_a_run():
    """The rod rests on the stop from 4.283 s on, after impacts up to then, and still does in the last frame."""
    found = sizes("pendulum_on_stop", (0, 8), np.linspace(5, 8, 31))
    assert list(found) == ["rod stop active"], "impacts are over"
    assert found["rod stop active"].values.min() == 1
    active = sizes("pendulum_on_stop", (0, 8), np.linspace(4.2, 8, 31))["rod stop active"]
    assert active.times == pytest.approx([0, 0.08294], abs=1e-5)
    assert active.values[:, 0] == pytest.approx([0, 1], abs=1e-5), "and nothing after it"


def test_the_mark_of_an_impact_decays_up_to_the_last_frame():
    """The first impact is 0.1 s before the end; the marks of impacts decay within 0.25 s."""
    (first, *_) = mbdae.solve(mbdae.load("pendulum_on_stop"), (0, 1)).impacts
    mark = sizes("pendulum_on_stop", (0, 1), np.linspace(0, first.t + 0.1, 31))["rod stop impact"]
    assert mark.values[-1, 0] == pytest.approx(0.6 * mark.values.max(), rel=1e-5)


def test_contacts_that_stick_and_slide_are_named_so():
    sol = mbdae.solve(mbdae.load("woodpecker"), (0, 1))
    assert [x["text"] for x in mode_legend(mode_tracks_of(sol, sol.q))] == ["lower edge: sticking or sliding", "impact"]
