"""Events in runs with impacts, in closed form: a ball that rebounds with half its speed, two bodies at once."""

import numpy as np
import pytest

import mbdae

G = 9.81
FALL = np.sqrt(2 / G)  # then flights of FALL, FALL/2, ...
BALL = """
[[body]]
name = "ball"
parent = "world"
joint = "prismatic"
axis = [0, 0, 1]
mass = 0.5

[[stop]]
joint = "ball"
lower = 0.0
restitution = 0.5

[start]
q = { ball = 1.0 }
"""
TIMES = {
    "v.ball": [0, FALL, 1.5 * FALL, 2 * FALL, 2.25 * FALL],
    "v.ball < -1": [1 / G, 1.5 * FALL + 1 / G],
    "q.ball = 0.0": [FALL, 2 * FALL],
}


@pytest.mark.parametrize("control", [{"rtol": 1e-8}, {"step": 0.05}])
def test_both_sides_of_an_impact_are_seen(tmp_path, control):
    (tmp_path / "ball.toml").write_text(BALL)
    mech = mbdae.load(tmp_path / "ball.toml")
    functions = [lambda t, q, v: v[0], lambda t, q, v: q[0]]
    sol = mbdae.solve(mech, (0, 1.1), events=[*TIMES, *functions], **control)
    expected = [*TIMES.values(), TIMES["v.ball"], TIMES["q.ball = 0.0"]]
    for (times, _), exact in zip(sol.events, expected, strict=True):
        assert times == pytest.approx(exact, abs=1e-9)


LEVEL = 0.21
PAIR = """
gravity = [0.0, 0.0, -9.81]
[[body]]
name = "a"
parent = "world"
joint = "prismatic"
mass = 1.0
[[body]]
name = "b"
parent = "world"
joint = "prismatic"
mass = 1.0
[start]
v = { a = 3.7, b = 3.7 }
"""
STOP = f'[[stop]]\njoint = "{{0}}"\nupper = {LEVEL}\nrestitution = 1.0\n'
TURN = f"""
[[event]]
name = "turn {{0}}"
signal = "{{1}}.{{0}}{{2}} {LEVEL}"
state = {{{{ "v.{{0}}" = "-v.{{0}}" }}}}
"""


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """Load two equal bodies that are thrown up, with further tables."""
    path = tmp_path_factory.mktemp("pair") / "pair.toml"

    def load(tables):
        path.write_text(PAIR + tables)
        return mbdae.load(path)

    return load


@pytest.mark.parametrize("signal", [("q", " >"), ("q", " ="), ("position", ".z >")])
@pytest.mark.parametrize("first", [STOP, TURN], ids=["stop", "turn"])
def test_equal_bodies_turn_at_the_same_instant(pair, first, signal):
    """The jump of the first body leaves the second one at its level to rounding, from below."""
    for one, other in ("ab", "ba"):
        mech = pair(first.format(one, "q", " >") + TURN.format(other, *signal))
        sol = mbdae.solve(mech, (0, 0.5), rtol=1e-9)
        turned = np.sqrt(3.7**2 - 2 * G * LEVEL)
        assert sol.v[-1] == pytest.approx([3.7 - 2 * turned - 0.5 * G] * 2, abs=1e-9)


@pytest.mark.parametrize("event", [f"q.b > {LEVEL}", f"q.b = {LEVEL}", lambda t, q, v: q[1] - LEVEL])
@pytest.mark.parametrize("jump", [STOP, TURN], ids=["stop", "turn"])
def test_an_event_at_a_jump_of_another_body_is_found(pair, jump, event):
    """Its return, within the same long step, too."""
    rise = (3.7 - np.sqrt(3.7**2 - 2 * G * LEVEL)) / G
    direction = 0 if isinstance(event, str) else 1
    times = [rise] if direction or ">" in event else [rise, 2 * 3.7 / G - rise]
    mech = pair(jump.format("a", "q", " >"))
    sol = mbdae.solve(mech, (0, 0.72), rtol=1e-9, events=mbdae.Event(event, direction=direction))
    assert sol.events[0][0] == pytest.approx(times, abs=1e-9)


def test_events_after_a_jump_within_the_same_step_are_found_once(pair):
    """The step beyond ends at the jump: events after the jump are found on the next step only."""
    functions = ["v.b > 3.0", "v.b = 0.0", lambda t, q, v: v[1] - 1.0]
    sol = mbdae.solve(pair(TURN.format("a", "q", " >")), (0, 0.4), rtol=1e-4, events=functions)
    for (times, _), exact in zip(sol.events, ([], [3.7 / G], [2.7 / G]), strict=True):
        assert times == pytest.approx(exact, abs=1e-9)
