"""Events at which the state jumps: in runs, in their tangents, in files."""

import numpy as np
import pinocchio as pin
import pytest
from shared import shared_model

import mbdae
from mbdae import Reset
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.formats.mechanism_file.template import Template

PENDULUM = """
title = "A pendulum that is thrown back"
gravity = [0.0, 0.0, -9.81]
duration = 3.0
[[body]]
name = "rod"
parent = "world"
axis = [0.0, 1.0, 0.0]
mass = 1.0
com = [0.0, 0.0, -1.0]
[[event]]
name = "back"
signal = "q.rod > 0.4"
when = "v.rod > 0.1"
state = { "v.rod" = "-0.8*v.rod" }
[start]
q = { rod = -1.0 }
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "thrown.toml"
    path.write_text(PENDULUM)
    return path


def test_energy_between_the_jumps_gives_the_angles(file):
    """Energy is conserved between jumps; at each, the kinetic energy becomes 0.64 of what it was."""
    mech = mbdae.load(file)
    sol = mbdae.solve(mech, (0, 6), rtol=1e-10)
    assert sol.status == "finished"
    nodes = [i for i, name in sol.resets if name == "back"]
    assert len(nodes) >= 2
    assert sol.stats["resets"] == len(sol.resets)
    kinetic = 9.81 * (np.cos(0.4) - np.cos(1.0))
    for i in nodes:
        np.testing.assert_allclose(sol.q[[i - 1, i], 0], 0.4, atol=1e-12)
        assert sol.t[i] == sol.t[i - 1]
        assert 0.5 * sol.v[i - 1][0] ** 2 == pytest.approx(kinetic, rel=1e-8)
        kinetic *= 0.64
        assert 0.5 * sol.v[i][0] ** 2 == pytest.approx(kinetic, rel=1e-8)
    assert mbdae.drift(sol).energy_error < 1e-7  # J; energy that is lost counts as work


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("ending", ["q.rod = 0.4", "q.rod > 0.4"])
def test_a_simulator_goes_on_after_a_terminal_event_at_a_jump(file, ending):
    event = mbdae.Event(ending, terminal=True)
    simulator, expected = mbdae.Simulator(file, rtol=1e-9, events=event), mbdae.solve(file, (0, 3), rtol=1e-9)
    while simulator.t < 3:
        simulator.advance(3 - simulator.t)
    assert len(simulator.solution().resets) == len(expected.resets)
    np.testing.assert_allclose(simulator.q, expected.q[-1], atol=1e-12)
    sol = mbdae.solve(file, (0, 3), rtol=1e-9, events=event)
    assert sol.message.endswith("; before event 'back', which a run that continues does not repeat")


@pytest.mark.parametrize("backend", ["native", "python"])
def test_both_back_ends(file, backend):
    sol = mbdae.solve(file, (0, 3), rtol=1e-9, backend=backend)
    expected = mbdae.solve(file, (0, 3), rtol=1e-12)
    np.testing.assert_allclose([sol.q[-1], sol.v[-1]], [expected.q[-1], expected.v[-1]], atol=1e-6)


def difference(values, h):
    """Sixth order."""
    f = {k: np.asarray(values(k * h)) for k in (-3, -2, -1, 1, 2, 3)}
    return (45 * (f[1] - f[-1]) - 9 * (f[2] - f[-2]) + (f[3] - f[-3])) / (60 * h)


PARAMETERS = {"gravity.2": 1e-2, "body.rod.com.2": 1e-3}


def ends(mech, q=0.0, v=0.0):
    sol = mbdae.solve(mech, (0, 2.5), np.array([-1.0 + q]), np.array([0.1 + v]), rtol=1e-12)
    assert len(sol.resets) == 2
    return np.array([*sol.q[-1], *sol.v[-1]])


@pytest.mark.slow
def test_tangents_are_quotients_of_runs(file):
    mech = mbdae.load(file)
    sol = mbdae.solve(mech, (0, 2.5), np.array([-1.0]), np.array([0.1]), rtol=1e-12)
    found = mbdae.sensitivity(sol, list(PARAMETERS), start=True).dy[-1, :2]
    make = Template(file).make
    columns = [difference(lambda x, n=n: ends(make({n: x + (-9.81 if n[0] == "g" else -1.0)})), h)
               for n, h in PARAMETERS.items()]  # fmt: skip
    columns += [difference(lambda x, n=n: ends(mech, **{n: x}), 1e-2) for n in "qv"]
    expected = np.column_stack(columns)
    np.testing.assert_allclose(found, expected, rtol=2e-8, atol=1e-8 * np.abs(expected).max())


def test_the_gradient_is_the_transposed_tangent(file):
    sol = mbdae.solve(file, (0, 2.5), rtol=1e-10)
    names = list(PARAMETERS)
    tangent = mbdae.sensitivity(sol, names).signal("q.rod")

    def cost(signals):
        weights = np.cos(np.arange(len(signals["q.rod"])))
        return float(weights @ signals["q.rod"]), {"q.rod": weights}

    found = mbdae.gradient(sol, cost, names)
    weights = np.cos(np.arange(len(tangent)))
    np.testing.assert_allclose(list(found.gradient.values()), weights @ tangent, rtol=1e-11)


def test_a_python_function_is_the_table(file):
    plain = mbdae.load(file)
    made = Reset.of_function(lambda t, q, v: (q, -0.8 * v), "q.rod > 0.4", "v.rod > 0.1", name="back")
    mech = mbdae.Mechanism(plain.model, resets=[made], start=plain.start_values)
    runs = [mbdae.solve(m, (0, 2.5), *plain.start, rtol=1e-11) for m in (plain, mech)]
    np.testing.assert_array_equal(runs[0].q[-1], runs[1].q[-1])
    tangents = [mbdae.sensitivity(sol, start=True).dy[-1] for sol in runs]
    np.testing.assert_allclose(*tangents, rtol=1e-10, atol=1e-10)


def test_a_python_function_of_time_is_the_table(tmp_path):
    path = tmp_path / "later.toml"
    path.write_text(PENDULUM.replace('"-0.8*v.rod"', '"-(0.8 + 0.3*t)*v.rod"'))
    mech = mbdae.load(path)
    by_v = [lambda t, q, v: np.diag([1.0, -0.8 - 0.3 * t]), None]
    resets = [Reset.of_function(lambda t, q, v: (q, -(0.8 + 0.3 * t) * v), "q.rod > 0.4", "v.rod > 0.1", partials=p)
              for p in by_v]  # fmt: skip
    mechs = [mech, *(mbdae.Mechanism(mech.model, resets=[r], start=mech.start_values) for r in resets)]
    table, *functions = (mbdae.sensitivity(mbdae.solve(m, (0, 2.5), rtol=1e-11), start=True).dy[-1] for m in mechs)
    np.testing.assert_allclose(functions, [table] * 2, rtol=1e-9, atol=1e-9)


def test_differences_of_functions_do_not_depend_on_the_size():
    """A falling block, all lengths in radii of gyration r: a jump, a controller and the end depend on q/r."""

    def derivatives(r):
        model = pin.Model()
        model.gravity.linear[:] = [0, 0, -9.81 * r]
        joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "z")
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), r**2 * np.eye(3)), pin.SE3.Identity())
        back = Reset.of_function(lambda t, q, v: (q, -v * np.cos(q / r)), "t > 0.35")
        hold = mbdae.Sampled(lambda t, q, v, x: (r * x, np.sin(q / r)), 10, joints="z", memory={"x": 0.0}, name="hold")
        mech = mbdae.Mechanism(model, forces=[hold], resets=[back])
        end = mbdae.Event(lambda t, q, v: np.sin(q[0] / r) + 0.1 * v[0] / r - 0.8, terminal=True, direction=1)
        sol = mbdae.solve(mech, (0, 2), [r], [0.0], rtol=1e-11, atol=1e-13 * r, events=end)
        assert (sol.status, len(sol.resets)) == ("event", 1)
        found = mbdae.sensitivity(sol, start=True, event=end)
        return np.vstack([found.dy[-1][:2, :2], found.dt[-1, :2] * r])

    np.testing.assert_allclose(derivatives(1e-5), derivatives(1.0), rtol=1e-7)


def test_a_saved_run_keeps_its_events(file, tmp_path):
    plain = mbdae.load(file)
    sol = mbdae.solve(plain, (0, 2.5))
    sol.save(tmp_path / "run.npz")
    again = mbdae.Solution.load(tmp_path / "run.npz")
    assert again.resets == sol.resets
    assert again.mechanism.resets == plain.resets
    np.testing.assert_array_equal(mbdae.solve(again.mechanism, (0, 2.5)).q[-1], sol.q[-1])
    made = Reset.of_function(lambda t, q, v: (q, -v), "q.rod > 0.4", name="back")
    mech = mbdae.Mechanism(plain.model, resets=[made], start=plain.start_values)
    mbdae.solve(mech, (0, 1), *plain.start).save(tmp_path / "python.npz")
    with pytest.raises(InputError, match=r"event 'back': .* Python function and not in the file"):
        mbdae.solve(mbdae.Solution.load(tmp_path / "python.npz").mechanism, (0, 1))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"v.rod" = "-0.8*v.rod"', '"v.bar" = 1.0', r"coordinate of event 'back' 'v\.bar'"),
        ('"v.rod" = "-0.8*v.rod"', '"v.rod" = "v.bar"', r"unknown coordinate 'v\.bar'"),
        ('"v.rod" = "-0.8*v.rod"', "", "needs a table state"),
        (
            '"q.rod > 0.4"',
            '"q.bar > 0.4"',
            r"unknown signal in signal of event 'back' 'q\.bar' \(did you mean",
        ),
        ('"q.rod > 0.4"', '"q.rod"', "signal of event 'back': expected a signal, one of > < =, and a number"),
        ('"v.rod > 0.1"', '"v.rod = 0.1"', "when of event 'back': expected a signal, one of > <, and a number"),
        ('"v.rod > 0.1"', '"foo"', "when of event 'back': expected a signal, one of > <, and a number, got 'foo'"),
        ('"v.rod > 0.1"', '"foo > 1"', "unknown signal in when of event 'back' 'foo'"),
        ('"v.rod > 0.1"', '"v.rod > x"', "when of event 'back': an event is a signal, or"),
        ('name = "back"', 'title = "back"', "unknown key"),
    ],
)
def test_wrong_input_is_one_line(tmp_path, old, new, message):
    path = tmp_path / "wrong.toml"
    path.write_text(PENDULUM.replace(old, new))
    with pytest.raises((InputError, UnknownNameError), match=message) as e:
        mbdae.load(path)
    assert "\n" not in str(e.value)


def test_what_does_not_know_events_says_so(file):
    with pytest.raises(InputError, match=r"event 'back'.*backward"):
        mbdae.solve(file, (0, -1))
    with pytest.raises(InputError, match=r"event 'back'.*'index1'"):
        mbdae.solve(file, (0, 1), formulation="index1", method="dop853")
    with pytest.raises(InputError, match="'back'"):
        mbdae.solve(file, (0, 1), method="rattle2", step=0.1)


def test_impacts_of_closures_conserve_angular_momentum_about_the_new_foot():
    """At the strike of the compass walker only the new foot gives an impulse; point masses, by hand."""
    mech = shared_model("compass_gait")
    sol = mbdae.solve(mech, (0, 1), rtol=1e-10)
    i, _ = sol.resets[0]

    def momentum(q, v, shift):
        x, z, *angles = q
        points = [(10.0, np.array([x, z]), v[:2])]
        for angle, rate in zip(angles, v[2:], strict=True):
            arm = 0.5 * np.array([np.sin(angle), -np.cos(angle)])
            points.append((5.0, np.array([x, z]) + arm, v[:2] + 0.5 * rate * np.array([np.cos(angle), np.sin(angle)])))
        return sum(m * ((p[0] - shift) * w[1] - p[1] * w[0]) for m, p, w in points)

    foot = 2 * np.sin(sol.q[i][2])  # the new foot is at the origin after the strike, ahead of the other one before it
    before = momentum(sol.q[i - 1], sol.v[i - 1], foot)
    assert before == pytest.approx(momentum(sol.q[i], sol.v[i], 0.0), rel=1e-9)


def test_a_jump_across_its_own_level_is_one_event():
    """x' = 1 from 0; at 1 the state jumps to -1 in the first file, beyond another level in the second."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    model.gravity.linear[:] = 0.0
    back = Reset(name="back", signal="q.x = 1", state={"q.x": "q.x - 2"})
    sol = mbdae.solve(mbdae.Mechanism(model, resets=[back]), (0, 6), np.zeros(1), np.ones(1))
    np.testing.assert_allclose([sol.t[i] for i, _ in sol.resets], [1, 3, 5], atol=1e-12)
    faster = Reset(name="faster", signal="q.x > 5", state={"v.x": 2.0})
    ahead = Reset(name="ahead", signal="q.x > 1", state={"q.x": 7.0})
    sol = mbdae.solve(mbdae.Mechanism(model, resets=[ahead, faster]), (0, 2), np.zeros(1), np.ones(1))
    assert [name for _, name in sol.resets] == ["ahead", "faster"]
    assert sol.q[-1][0] == pytest.approx(9.0, abs=1e-12)
