"""Events named by signals: located in the core and in Python, with the order of the method, on known motions."""

import numpy as np
import pinocchio as pin
import pytest
from chains import tree
from scipy.special import ellipk
from shared import shared_model

import mbdae
from mbdae import Event, Mechanism, Sampled
from mbdae.errors import InputError
from mbdae.integrate.run.run_state import RunState
from mbdae.integrate.steppers import native as core_stepper
from mbdae.integrate.steppers.stepper import PythonStepper
from mbdae.mechanism.time_functions.time_functions import Steps
from mbdae.solution.signal_value import signal_values, value

QUARTER = float(ellipk(0.5)) / np.sqrt(9.81)  # of a pendulum's swing from horizontal rest


def slide(**options):
    """A unit mass on a slide in a field of -9.81 m/s^2."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    return Mechanism(model, **options)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("method", ["herk3", "pherk4", "herk5", "pherk5", "radau5"])
def test_the_time_has_the_order_of_the_method(method):
    """A pendulum from rest to its lowest point, by the elliptic integral; with a terminal event and without."""
    mech, ending, passing = shared_model("pendulum"), [], []
    for n in (20, 40, 80):
        for event, errors in ((Event("q.ball.x", terminal=True), ending), ("q.ball.x = 0", passing)):
            sol = mbdae.solve(mech, (0, 0.7), method=method, step=0.7 / n, events=event)
            errors.append(abs(sol.events[0][0][0] - QUARTER))
            assert abs(sol.events[0][1][0, 0]) < 1e-14
        assert passing[-1] == pytest.approx(ending[-1], abs=1e-15)
    slopes = -np.diff(np.log2(ending))
    assert (slopes > mbdae.METHODS[method].order_linear - 0.35).all(), (ending, slopes)


@pytest.mark.slow
@pytest.mark.native
def test_both_back_ends_find_every_signal():
    """All signals of a model are monitored at once, each at a level that it crosses."""
    spans = {"slider_crank": 0.05, "heavy_top": 0.05, "flyball_governor": 0.005}  # s
    spans |= dict.fromkeys(("stewart_platform", "dual_arm"), 0.02)
    for name, end in spans.items():
        mech = shared_model(name)
        span, options = (0, end), {"step": end / 8, "method": "herk3"}
        plain = mbdae.solve(mech, span, **options)
        system, points = mech.system(), list(zip(plain.t, plain.y, strict=True))
        texts = []
        compiled = {name: s for name, s in signal_values(mech).items() if s.compiled}
        for signal, known in compiled.items():
            low, high = (float(value(system, known, *points[i])) for i in (1, -2))
            if abs(high - low) > 1e-7 * (1 + abs(high)):
                texts.append(f"{signal} = {low / 3 + high / 1.5!r}")
        assert len(texts) > mech.nv
        native, python = (mbdae.solve(mech, span, events=texts, backend=b, **options) for b in ("native", "python"))
        np.testing.assert_array_equal(native.y, plain.y)  # event detection changes nothing
        assert (native.stats["events"], python.stats["events"]) == ("native", "python")
        assert native.stats["steps"] == python.stats["steps"]
        for text, (t, y), (u, z) in zip(texts, native.events, python.events, strict=True):
            assert len(t) == len(u) > 0, (name, text)
            np.testing.assert_allclose(t, u, rtol=0, atol=1e-9, err_msg=text)
            np.testing.assert_allclose(y, z, atol=1e-7 * (1 + np.abs(z).max()), err_msg=text)
            signal, level = text.split(" = ")
            found = value(system, compiled[signal], t[0], y[0])
            assert found == pytest.approx(float(level), rel=1e-9, abs=1e-9), (name, text)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("backwards", [False, True])
def test_a_signal_that_comes_back_within_a_step(backwards):
    """A throw of 1 m/s is above 50 mm between two instants of one step, and at its top at v/g."""
    mech, top, level = slide(), 1 / 9.81, 0.05
    times = top + np.array([-1, 1]) * np.sqrt(top**2 - 2 * level / 9.81)
    span, start = ((0.0, 0.3), ([0.0], [1.0]))
    if backwards:
        span, start = (0.3, 0.0), ([0.3 - 0.5 * 9.81 * 0.09], [1 - 9.81 * 0.3])
    events = [f"q.slide = {level}", f"q.slide > {level}", f"q.slide < {level}", "v.slide", "t = 0.07", "work"]
    sol = mbdae.solve(mech, span, *start, method="herk3", step=0.3, events=events)
    expected = [times, times[:1], times[1:], [top], [0.07], []]
    if backwards:
        expected = [times[::-1], times[1:], times[:1], [top], [0.07], []]
    for text, (t, _), exact in zip(events, sol.events, expected, strict=True):
        np.testing.assert_allclose(t, exact, atol=1e-14, err_msg=text)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{"rtol": 1e-6}, {"step": 0.05}], ids=str)
def test_angles_count_turns(options):
    """An unbounded wheel turns at a constant speed."""
    mech = Mechanism(tree(["continuous"], [0]))
    mech.model.gravity.setZero()
    q, v = mech.assemble({"continuous_0": 1.0}, {"continuous_0": 30.0})
    events = ["q.continuous_0 > 20", Event("q.continuous_0 = 50", terminal=True), "q.continuous_0 < 50"]
    sol = mbdae.solve(mech, (0, 2), q, v, events=events, **options)
    assert sol.status == "event"
    np.testing.assert_allclose(sol.events[0][0], [19 / 30], rtol=1e-12)
    np.testing.assert_allclose(sol.events[1][0], [49 / 30], rtol=1e-12)
    assert len(sol.events[2][0]) == 0


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{"rtol": 1e-5}, {"step": 0.01}, {"step": 0.01, "method": "herk4"}], ids=str)
@pytest.mark.parametrize("name", ["slider_crank", "stewart_platform", "four_bar"])
def test_a_terminal_event_ends_where_closures_hold(name, options):
    mech = shared_model(name)
    joint = next(n for n in signal_values(mech) if n.startswith("q."))
    plain = mbdae.solve(mech, (0, 0.2), **options)
    x = plain.signals(joint)[joint]
    level = float(x[0] + 2 * x[-1]) / 3
    sol = mbdae.solve(mech, (0, 0.2), events=Event(f"{joint} = {level!r}", terminal=True), **options)
    assert sol.status == "event", sol.message
    assert sol.events[0][0][-1] == sol.t[-1]
    np.testing.assert_array_equal(sol.events[0][1][-1], sol.y[-1])
    assert sol.signals(joint)[joint][-1] == pytest.approx(level, abs=1e-14)
    g, rate = mech.residual(sol.q[-1], sol.v[-1])
    assert np.abs(rate).max() < 1e-13 * (1 + np.abs(sol.v[-1]).max())
    if "rtol" in options:
        assert np.abs(g).max() < 1e-13
    again = mbdae.solve(mech, (sol.t[-1], 0.2), sol.q[-1], sol.v[-1], events=f"{joint} = {level!r}", **options)
    assert again.success


@pytest.mark.usefixtures("back_end")
def test_an_extremum_whose_square_underflows_is_none(tmp_path):
    """A body pushed up at speeds of 1e-170 m/s, v1 = -2 v0, as of a joint that rests up to rounding."""
    speed, path = 2.0**-565, tmp_path / "rest.toml"
    path.write_text(f'''gravity = [0, 0, {24 * speed!r}]
[[body]]
name = "block"
parent = "world"
joint = "prismatic"
mass = 1.0''')
    mech = mbdae.load(path)
    sol = mbdae.solve(mech, (0, 0.125), [2.0**-500], [-speed], step=0.125, method="herk1", events="q.block")
    assert sol.v[-1, 0] == 2 * speed
    assert not len(sol.events[0][0])


@pytest.mark.usefixtures("back_end")
def test_a_held_torque_passes_a_level_at_an_instant():
    """The torque of a sampled controller jumps: the event is at the first instant after the crossing.

    A run that it ends has the states before that instant, as any end of a run, and continues as if it had not ended.
    """
    brake = mbdae.JointPID(joint="arm", kp=-20.0, reference=0.0, rate=16.0, name="brake")
    mech = Mechanism(tree(["revolute"], [0]), forces=[brake.model_copy(update={"joint": "revolute_0"})])
    torque = next(n for n in signal_values(mech) if n.startswith("s."))
    q, v = mech.assemble({"revolute_0": 0.1}, {"revolute_0": 0.5})
    plain = mbdae.solve(mech, (0, 1), q, v, rtol=1e-8)
    held = plain.s[:, 0]
    half = float(held.max()) / 2
    i = int(np.flatnonzero(held > half)[0])
    assert plain.t[i] * 16 == pytest.approx(round(plain.t[i] * 16))
    level = f"{torque} > {half!r}"
    sol = mbdae.solve(mech, (0, 1), q, v, rtol=1e-8, events=level)
    np.testing.assert_array_equal(sol.y, plain.y)
    assert sol.events[0][0][0] == plain.t[i]
    np.testing.assert_array_equal(sol.events[0][1][0], plain.y[i])
    ended = mbdae.solve(mech, (0, 1), q, v, rtol=1e-8, events=Event(level, terminal=True))
    assert (ended.status, ended.t[-1]) == ("event", plain.t[i])
    np.testing.assert_array_equal(ended.events[0][1][0], plain.y[i])
    np.testing.assert_array_equal(ended.y[-1], plain.y[i - 1])
    again = mbdae.solve(mech, (ended.t[-1], 1), ended.q[-1], ended.v[-1], ended.s[-1], rtol=1e-8)
    np.testing.assert_allclose(again.y[-1][:-1], plain.y[-1][:-1], rtol=1e-7)  # without the work


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{"rtol": 1e-8}, {"step": 0.013, "project": True}], ids=str)
def test_signals_near_singular_configurations(options):
    """Where a parallelogram is in line, and a run crosses or steps over it: bars continue through half a turn."""
    mech = mbdae.load("n_four_bar", N=1)
    plain = mbdae.solve(mech, (0, 1.3), **options)
    joint = next(n for n in signal_values(mech) if n.startswith("q."))
    where = plain(plain.singular[0].t)
    level = float(where.q[0])
    sol = mbdae.solve(mech, (0, 1.3), events=f"{joint} = {level!r}", **options)
    assert len(sol.singular) == len(plain.singular) == 2
    assert np.abs(sol.events[0][0] - plain.singular[0].t).min() < 1e-6
    ended = mbdae.solve(mech, (0, 1.3), events=Event(f"{joint} = {level!r}", terminal=True), **options)
    assert ended.status == "event"
    assert ended.t[-1] == pytest.approx(sol.events[0][0][0], abs=1e-9)


def test_signals_and_functions_together_are_watched_in_python():
    def height(t, q, v):
        return q[2] + 0.5

    options = {"rtol": 1e-9, "events": ["q.ball.z = -0.5", height]}
    sol = mbdae.solve(shared_model("pendulum"), (0, 2), **options)
    np.testing.assert_allclose(sol.events[0][0], sol.events[1][0], atol=1e-7)
    assert sol.stats["events"] == "python: event 'height' is a function"


@pytest.mark.parametrize(
    ("event", "message"),
    [
        ("q.craank = 0.3", "unknown signal 'q.craank' (did you mean 'q.crank'?); valid: t, q.crank, "),
        ("speed", "unknown signal 'speed'"),
        ("q.crank = fast", "an event is a signal, or a signal, one of = > <, and a number, got 'q.crank = fast'"),
        ("q.crank > nan", "one of = > <, and a number, got 'q.crank > nan'"),
        ("q.crank >= 3", "one of = > <, and a number, got 'q.crank >= 3'"),
        ("1 < q.crank < 3", "one of = > <, and a number, got '1 < q.crank < 3'"),
        ("= 3", "one of = > <, and a number, got '= 3'"),
        ("", "unknown signal ''"),
        (Event("q.crank > 3", direction=-1), "event 'q.crank > 3' has another direction than direction = -1"),
        (3.0, "an event is a signal, a function or mbdae.Event, got float"),
    ],
    ids=str,
)
def test_wrong_events(event, message):
    with pytest.raises(InputError) as found:
        mbdae.solve(shared_model("four_bar"), (0, 1), events=event)
    assert message in str(found.value)
    assert "\n" not in str(found.value)


def test_a_textbook_problem_has_no_signals():
    circle = mbdae.Hessenberg(
        f=lambda t, y, z: np.array([-y[1] + z[0] * y[0], y[0] + z[0] * y[1]]),
        g=lambda t, y: np.array([y @ y - 1.0]),
        y0=(1.0, 0.0),
        z0=(0.0,),
    )
    with pytest.raises(InputError, match="events of a textbook problem are functions"):
        mbdae.solve(circle, (0, 1), events="y.0 = 1")


@pytest.mark.native
@pytest.mark.parametrize("options", [{"rtol": 1e-6}, {"step": 0.011}, {"rtol": 1e-6, "method": "radau5"}], ids=str)
def test_the_core_stays_at_work(options, monkeypatch):
    """Sampled controllers, stepping functions of time, and signals: Python is not called, and gives the same."""
    lag = {"kind": "harmonic", "amplitude": 0.3, "omega": 5.0}
    kicks = Steps(points=tuple((0.03 * k, 0.2 * (-1) ** k) for k in range(40)))
    forces = [
        mbdae.JointPID(joint="crank", kp=5.0, ki=3.0, kd=0.4, rate=40.0, reference=lag, name="position"),
        mbdae.JointPID(joint="rocker", kp=0.1, controls="velocity", rate=32.0, reference=1.0, name="speed"),
        Sampled(lambda t, q, v, x: (-0.1 * v[:1], x + 1), 25.0, "crank", {"n": 0.0}, 0.01, "own"),
        mbdae.JointTorque(joint="crank", torque=kicks),
    ]
    mech = mbdae.load("four_bar", forces=forces)
    options = {**options, "events": ["v.crank", "q.crank > 0.5"], "jumps": [0.123, 0.5]}
    expected = mbdae.solve(mech, (0, 0.6), backend="python", **options)
    monkeypatch.setattr(core_stepper, "CHECK_INTERVAL", 1e9)  # the clock may be read just before a jump
    monkeypatch.setattr(RunState, "restart_after_jump", None)
    monkeypatch.setattr(PythonStepper, "advance", None)
    sol = mbdae.solve(mech, (0, 0.6), backend="native", **options)
    assert sol.stats["steps"] == expected.stats["steps"]
    np.testing.assert_allclose(sol.t, expected.t, rtol=0, atol=1e-9)
    np.testing.assert_allclose(sol.y, expected.y, rtol=1e-7, atol=1e-7)
    assert np.array_equal(np.diff(sol.t) < 1e-12, np.diff(expected.t) < 1e-12)
    for (t, _), (u, _) in zip(sol.events, expected.events, strict=True):
        np.testing.assert_allclose(t, u, rtol=0, atol=1e-8)


@pytest.mark.native
def test_what_a_sampled_controller_does_wrong_is_said_as_in_python():
    late = Sampled(lambda t, q, v: -v if t < 0.5 else 1 / 0, rate=10.0, name="late")
    mech = mbdae.load("four_bar", forces=[late])
    native, python = (mbdae.solve(mech, (0, 1), backend=b) for b in ("native", "python"))
    assert (native.status, native.message) == (python.status, python.message)
    assert native.status == "force"
    assert native.t[-1] == pytest.approx(python.t[-1])


@pytest.mark.usefixtures("back_end")
def test_a_velocity_that_remains_at_its_level_to_rounding_does_not_cross_it():
    """The joints stick until 0.063 s, and the platform does not rotate: both with speeds of some 1e-16 1/s."""
    events = ["v.crank", "v.slider < 0", "v.slider > 0"]
    sol = mbdae.solve(shared_model("stick_slip_slider"), (0, 0.07), events=events)
    assert len(sol.modes) == 2
    assert [len(times) for times, _ in sol.events] == [0, 0, 0]
    sol = mbdae.solve(shared_model("delta_robot"), (0, 0.05), events=[f"v.platform.w{x}" for x in "xyz"])
    assert [len(times) for times, _ in sol.events] == [0, 0, 0]
