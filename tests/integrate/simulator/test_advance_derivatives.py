"""Tangent and adjoint of the last advance of a simulator, against sixth-order quotients of advances."""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from chains import rod
from frozen import repeated_run
from shared import shared_model

import mbdae
from mbdae import Input, JointTorque, Mechanism
from mbdae.finite_differences import numerical_derivative
from mbdae.mechanism.formats.mechanism_file.loaded_model import parameter_value
from mbdae.mechanism.formats.mechanism_file.template import Template
from mbdae.mechanism.tree.frames import find_joint

U, SET, DT, STEPS = 0.7, 1.3, 8e-3, 4
STATE = ("q", "v", "s")


@cache  # a simulator copies it
def with_input(name, hold="zero", value=U):
    """A model with an input torque on its first joint of one velocity."""
    m = shared_model(name)
    single = [j for j in m.joint_names if find_joint(m.model, j).nv == 1]
    forces = [JointTorque(joint=single[0], torque=Input(name="motor", hold=hold, value=value))] if single else []
    return Mechanism(m.model, m.closures, [*m.forces, *forces], drivers=m.drivers, start=m.start_values)


def end(simulator):
    return np.concatenate([getattr(simulator, x) for x in STATE])


def stacked(parts):
    return np.concatenate([np.ravel(parts.q), np.ravel(parts.v), np.ravel(parts.s)])


def moved(m, y0, y1):
    """Difference of states (q, v, s) in the tangent."""
    return np.concatenate([m.manifold.difference(y0[: m.nq], y1[: m.nq]), y1[m.nq :] - y0[m.nq :]])


def difference(m, state, h):
    """The derivative of a state (q, v, s) by one number, in the tangent."""
    base = state(0.0)
    return numerical_derivative(lambda x: moved(m, base, state(x)), h)


@cache
def family(name):
    """Consistent states of a model over one number, along local coordinates with states of forces; and its tangent."""
    m = with_input(name)
    ode = m.ode()
    direction = np.random.default_rng(3).normal(size=ode.n)
    states = cache(lambda x: ode.state(0.0, ode.x0 + x * direction))
    tangent = difference(m, lambda x: np.concatenate(states(x)), 1e-3)
    return states, np.split(tangent, np.cumsum([m.nv, m.nv]))


def advance(m, start, dt=DT, value=SET, restart=True, **options):
    if "rtol" not in options:
        options["step"] = dt / STEPS
    simulator = mbdae.Simulator(m, 0.0, *start, restart=restart, **options)
    if value is not None and simulator.inputs.user_inputs:
        simulator["motor"] = value
    simulator.advance(dt)
    return simulator


OPTIONS = [{}, {"project": True}, {"method": "radau5"}, {"method": "herk5"}, {"formulation": "ggl"}]


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("options", OPTIONS, ids=str)
@pytest.mark.parametrize("name", ["four_bar", "bricard", "heavy_top", "dual_arm"])
def test_tangents_are_quotients_of_advances(name, options, hold):
    m = with_input(name, hold)
    states, along = family(name)
    simulator = advance(m, states(0.0), **options)
    checks = {"state": (simulator.tangent(*along), lambda x: end(advance(m, states(x), **options)), 1e-3)}
    if simulator.inputs.user_inputs:
        checks["input"] = (
            simulator.tangent(inputs={"motor": 1.0}),
            lambda x: end(advance(m, states(0.0), value=SET + x, **options)), 1e-1,
        )  # fmt: skip
    if simulator.inputs.user_inputs and name != "dual_arm":  # whose reference depends on time
        checks["dt"] = simulator.tangent(dt=1.0), lambda x: end(advance(m, states(0.0), DT + x, **options)), 1e-2 * DT
    if simulator.inputs.user_inputs and hold == "first":
        checks["before"] = (
            simulator.tangent(inputs_before={"motor": 1.0}),
            lambda x: end(advance(with_input(name, hold, U + x), states(0.0), **options)), 1e-1,
        )  # fmt: skip
    for what, (found, run, h) in checks.items():
        quotient = difference(m, run, h)
        assert stacked(found) == pytest.approx(quotient, abs=1e-9 * max(1.0, np.abs(quotient).max())), what


@pytest.mark.parametrize("method", ["pherk6", "herk5", "radau5"])
@pytest.mark.parametrize("name", ["four_bar", "bricard"])
def test_controlled_steps_are_frozen(name, method):
    """Quotients of the steps that the advance took, with their sizes, from other states and with other inputs."""
    m = with_input(name)
    states, along = family(name)
    simulator = advance(m, states(0.0), 0.1, None, rtol=1e-7, method=method)
    trajectory = simulator.differentiated().trajectory
    assert len(trajectory.ts) > 3

    def again(x, du=0.0):
        point = np.append(np.concatenate(states(x)), 0.0)
        return repeated_run(trajectory, with_input(name, value=U + du), point)[-1][:-1]

    assert again(0.0) == pytest.approx(end(simulator), abs=1e-10)  # Newton's iteration ends at its tolerance
    found = simulator.tangent(*along)
    quotient = difference(m, again, 1e-3)
    assert stacked(found) == pytest.approx(quotient, abs=1e-9 * max(1.0, np.abs(quotient).max()))
    quotient = difference(m, lambda x: again(0.0, x), 0.1)
    assert stacked(simulator.tangent(inputs={"motor": 1.0})) == pytest.approx(quotient, abs=1e-9)


@pytest.mark.parametrize("options", [{}, {"rtol": 1e-7}, {"method": "radau5"}, {"formulation": "ggl"}], ids=str)
@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("name", ["four_bar", "dual_arm", "bricard"])
def test_adjoints_are_transposes(name, hold, options):
    m = with_input(name, hold)
    simulator = advance(m, (*m.start, None), **options)
    rng = np.random.default_rng(5)
    w, d = ([rng.normal(size=n) for n in (m.nv, m.nv, len(m.states))] for _ in range(2))
    du, du0, dt = rng.normal(size=3)
    autonomous = name != "dual_arm"
    before = {"motor": du0} if hold == "first" else {}
    tangent = simulator.tangent(*d, inputs={"motor": du}, inputs_before=before, dt=dt * autonomous)
    adjoint = simulator.adjoint(*w, dt=autonomous)
    forward = [float(a @ b) for a, b in zip(w, tangent, strict=True)]
    back = [float(a @ b) for a, b in zip(d, adjoint[:3], strict=True)]
    back += [du * adjoint.inputs["motor"], du0 * adjoint.inputs_before.get("motor", 0.0), dt * (adjoint.dt or 0.0)]
    assert abs(sum(forward) - sum(back)) <= 1e-13 * sum(map(abs, [*forward, *back]))


def test_advances_compose():
    """The product of the tangents of several advances is the quotient of all of them."""
    m, n = with_input("four_bar", "first"), 5
    values = [U, *np.sin(np.arange(n))]

    def run(k=0, x=0.0, differentiate=False):
        u = [value + x * (i == k) for i, value in enumerate(values)]
        simulator = mbdae.Simulator(with_input("four_bar", "first", u[0]), step=2e-3, restart=True)
        state, by_u = None, np.zeros((2 * m.nv, n + 1))
        for i in range(n):
            simulator["motor"] = u[i + 1]
            simulator.advance(DT)
            if differentiate:
                one = np.eye(n + 1)
                state = simulator.tangent(
                    by_u[: m.nv], by_u[m.nv :], inputs={"motor": one[i + 1]}, inputs_before={"motor": one[i]}
                )
                by_u = np.concatenate(state[:2])
        return by_u if differentiate else end(simulator)

    found = run(differentiate=True)
    for k in range(n + 1):
        assert found[:, k] == pytest.approx(difference(m, lambda x, k=k: run(k, x), 0.1), abs=1e-10)


@pytest.mark.parametrize(
    ("name", "parameter"), [("four_bar", "joint.coupler.mass"), ("slider_crank", "joint.slider.mass")]
)
def test_parameters(name, parameter):
    template = Template(name)
    q, v = shared_model(name).start
    value = parameter_value(template, parameter)
    simulator = advance(shared_model(name), (q, v))
    found = simulator.tangent(parameters={parameter: 1.0})
    m = simulator.mechanism
    quotient = difference(m, lambda x: end(advance(template.make({parameter: value + x}), (q, v))), 1e-2)
    assert np.abs(quotient).max() > 1e-6
    assert stacked(found) == pytest.approx(quotient, abs=1e-9)
    w = np.arange(1.0, m.nv + 1)
    assert simulator.adjoint(v=w, parameters=[parameter]).parameters[parameter] == pytest.approx(w @ found.v, rel=1e-12)


def test_runs_in_python_have_the_same_derivatives():
    m = with_input("four_bar")
    found = [advance(m, (*m.start, None), backend=b).tangent(inputs={"motor": 1.0}) for b in ("native", "python")]
    assert stacked(found[0]) == pytest.approx(stacked(found[1]), abs=1e-13)


@pytest.mark.parametrize("method", ["pherk6", "radau5"])
def test_an_input_as_the_speed_of_a_driver(method):
    tree = pin.Model()
    rod(tree, 0, pin.SE3.Identity(), 1.0, "one")
    rod(tree, 1, pin.SE3(np.eye(3), np.array([0.0, 0.0, -1.0])), 0.7, "two")
    speed = Input(name="motor", hold="first", value=0.5)
    m = Mechanism(tree, drivers=[mbdae.Driver(joint="one", speed=speed)])
    start = np.array([0.3, 0.2]), np.array([0.5, -0.3])
    simulator = advance(m, start, method=method)
    quotient = difference(m, lambda x: end(advance(m, start, value=SET + x, method=method)), 0.1)
    assert stacked(simulator.tangent(inputs={"motor": 1.0})) == pytest.approx(quotient, abs=1e-11)
    rejected("depend on time", lambda: simulator.tangent(dt=1.0))


def rejected(match, call):
    with pytest.raises(mbdae.MbdaeError, match=rf"^[^\n]*{match}[^\n]*$"):
        call()


def test_what_has_no_derivative_is_named():
    m = with_input("four_bar")
    simulator = mbdae.Simulator(m, step=2e-3)
    rejected("has not advanced", simulator.tangent)
    simulator.advance(DT)
    simulator.tangent()  # the start restarts the method
    simulator.advance(DT)
    rejected("'pherk6'.*restart=True", simulator.tangent)
    simulator["motor"] = 2.0
    simulator.advance(DT)
    assert simulator.adjoint(v=[1.0, 0.0, 0.0]).inputs["motor"] != 0.0  # a jump restarts it, too
    rejected("engine.*motor", lambda: simulator.tangent(inputs={"engine": 1.0}))
    rejected("first order.*motor", lambda: simulator.tangent(inputs_before={"motor": 1.0}))
    rejected("dq must be 3", lambda: simulator.tangent([1.0, 2.0]))
    rejected("v must be 3 finite", lambda: simulator.adjoint(v=[np.nan, 0.0, 0.0]))
    rejected("columns, got 2, 4", lambda: simulator.tangent(np.ones((3, 4)), inputs={"motor": [1.0, 2.0]}))
    rejected("each input are given by name.*got \\['motor'\\]", lambda: simulator.tangent(inputs=["motor"]))
    rejected("each parameter are given by name.*got 'mass'", lambda: simulator.tangent(parameters="mass"))
    rejected("dotted names, got None", lambda: simulator.adjoint(parameters=None))
    rejected("read from a file", lambda: simulator.tangent(parameters={"body.crank.mass": 1.0}))
    simulator.restore(simulator.save())
    rejected("has not advanced", simulator.adjoint)


def test_an_advance_through_impacts():
    """The tangent of an advance is that of a run; its length has no derivative, and neither has rest by bounces."""
    sol = mbdae.solve("pendulum_on_stop", (0.0, 1.5), rtol=1e-9)
    simulator = mbdae.Simulator("pendulum_on_stop", rtol=1e-9, restart=True)
    simulator.advance(1.5)
    expected = mbdae.sensitivity(sol, start=True).dy[-1, :2, 0]
    assert stacked(simulator.tangent(dq=[1.0]))[:2] == pytest.approx(expected, rel=1e-9)
    assert simulator.adjoint(v=[1.0]).q == pytest.approx(expected[1:], rel=1e-9)
    rejected("sampling times or jumps .* do not scale with dt", lambda: simulator.tangent(dt=1.0))
    simulator.advance(6.0)
    rejected("'rod stop' comes to rest by an accumulation of bounces", simulator.tangent)


def test_terminal_events_are_rejected():
    simulator = mbdae.Simulator("four_bar", rtol=1e-8, events=mbdae.Event("q.crank = 1.0", terminal=True))
    assert simulator.advance(5.0) == "event"
    rejected("ended in an event", simulator.tangent)


def test_time_dependent_advances_have_no_derivative_by_their_length():
    m = with_input("four_bar")
    forces = [*m.forces, JointTorque(joint="rocker", torque=lambda t: np.sin(5 * t))]
    simulator = advance(Mechanism(m.model, m.closures, forces, start=m.start_values), (*m.start, None))
    assert np.abs(simulator.tangent(inputs={"motor": 1.0}).v).max() > 0
    rejected("depend on time", lambda: simulator.tangent(dt=1.0))
