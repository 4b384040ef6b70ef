"""`Mechanism.ode` with scipy's solvers, against the methods of mbdae and finite differences."""

import numpy as np
import pytest
from driven import crane, platform
from scipy.integrate import solve_ivp
from shared import shared_model

import mbdae
from mbdae.finite_differences import numerical_derivative, numerical_jacobian

SPANS = {
    "slider_crank": 0.4,
    "four_bar": 0.4,
    "bricard": 1.0,  # dependent rows
    "n_four_bar": 0.3,
    "panda_handle": 0.2,
    "stewart_platform": 0.02,
    "heavy_top": 0.05,  # a free body, several charts
    "rolling_disc": 1.0,  # rolling, several charts
    "differential_drive": 0.5,
    "dual_arm": 0.02,  # states of controllers, dependent rows
}
SMOOTH = ("four_bar", "bricard", "heavy_top", "panda_handle", "rolling_disc", "dual_arm")
DRIVEN = {"crane": crane, "platform": platform}


def run(mech, T, solver, **options):
    """Integrate over charts: end state, number of charts, and the largest |g| and |G v| at the solver's points."""
    ode, t, charts, worst = mech.ode(), 0.0, 1, 0.0
    x = ode.x0
    while True:

        def margin(t, x, ode=ode):
            return ode.margin(t, x)

        margin.terminal, margin.direction = True, -1
        found = solve_ivp(ode, (t, T), x, method=solver, events=margin, **options)
        assert found.success
        for at, y in zip(found.t[::5], found.y.T[::5], strict=True):
            q, v, _ = ode.state(at, y)
            worst = max([worst, *(np.abs(r).max(initial=0.0) for r in mech.residual(q, v, at))])
        t, x = found.t[-1], found.y[:, -1]
        if found.status == 0:
            return ode.state(t, x), charts, worst
        ode = ode.restart(t, x)
        x, charts = ode.x0, charts + 1


TOLERANCES = {"DOP853": (1e-11, 1e-9), "LSODA": (1e-9, 1e-6)}  # rtol, and bound of errors of (q, v)


@pytest.mark.parametrize("solver", TOLERANCES)
@pytest.mark.parametrize("name", SPANS)
def test_solvers_of_odes_reach_the_end_without_drift(name, solver):
    mech, T = shared_model(name), SPANS[name]
    rtol, bound = TOLERANCES[solver]
    expected = mbdae.solve(mech, (0.0, T), method="pherk6", rtol=1e-12, atol=1e-13)
    (q, v, s), charts, worst = run(mech, T, solver, rtol=rtol, atol=0.01 * rtol)
    speed = 1 + np.abs(v).max()
    assert worst <= 1e-14 * max(speed, 1.0)
    assert np.abs(mech.manifold.difference(expected.q[-1], q)).max() <= bound
    assert np.abs(expected.v[-1] - v).max() <= bound * speed
    assert len(s) == len(mech.states)
    assert (charts > 1) == (name in ("heavy_top", "rolling_disc"))


def displaced(mech, backend="auto"):
    """An ODE at t = 0, and a point away from the origin of its coordinates."""
    ode = mech.ode(backend=backend)
    return ode, ode.x0 + 0.1 * np.random.default_rng(4).normal(size=ode.n)


@pytest.mark.parametrize("backend", ["native", "python"])
@pytest.mark.parametrize("name", [*SMOOTH, *DRIVEN])
def test_jacobians_are_derivatives(name, backend):
    mech = DRIVEN[name]() if name in DRIVEN else shared_model(name)
    ode, x = displaced(mech, backend)
    T = 0.02 if name in DRIVEN else 0.1
    J, by_t, _ = ode.jacobian(T, x)
    quotient = numerical_jacobian(lambda dx: ode(T, x + dx), ode.n, 2e-3)
    size = 1 + np.abs(quotient).max(initial=0.0)
    assert pytest.approx(quotient, abs=1e-10 * size) == J
    assert by_t == pytest.approx(numerical_derivative(lambda h: ode(T + h, x), 1e-3), abs=1e-10 * size)


def test_other_coordinates_are_the_same_state():
    mech = shared_model("panda_handle")
    ode, x = displaced(mech)
    other = ode.restart(0.0, x)
    for a, b in zip(ode.state(0.0, x), other.state(0.0, other.x0), strict=True):
        assert a == pytest.approx(b, abs=1e-13)
    assert other.margin(0.0, other.x0) == pytest.approx(1.0)
    assert 0 < ode.margin(0.0, x) < 1


def test_a_point_far_away_is_reached_on_the_branch_of_the_origin():
    mech = shared_model("slider_crank")
    ode, sol = mech.ode(), mbdae.solve(mech, (0.0, 1.0), rtol=1e-9)
    x = np.append(ode._N.T @ ((sol.q[-1] - sol.q[0]) / mech.coordinate_scales), ode.x0[1:])
    assert ode.state(0.0, x)[0] == pytest.approx(sol.q[-1], abs=1e-7)


def test_beyond_the_coordinates_is_said():
    mech = shared_model("panda_handle")  # an arm that holds a handle turns only so far
    ode = mech.ode()
    x = ode.x0.copy()
    x[0] += 20.0
    with pytest.raises(mbdae.MbdaeError, match="restart"):
        ode.state(0.0, x)
    assert ode.state(0.0, ode.x0)[0] == pytest.approx(mech.start[0], abs=1e-12)


def test_wrong_points_are_one_line():
    ode = shared_model("four_bar").ode()
    for t, x in [(np.nan, ode.x0), (0.0, ode.x0[:1]), (0.0, [*ode.x0, 1.0]), (0.0, np.nan * ode.x0)]:
        for call in (ode, ode.state, ode.margin, ode.jacobian, ode.restart):
            with pytest.raises(mbdae.MbdaeError, match=r"^[^\n]*(four-bar|t is a finite|x is not finite)[^\n]*$"):
                call(t, x)


def with_inputs(name):
    """Mechanisms with a torque at a joint as an input, and a setpoint of a servo."""
    mech = shared_model(name)
    joint = {"four_bar": "crank", "panda_handle": "panda_joint2", "bricard": "rod_2"}[name]
    servo = mbdae.JointPID(joint=joint, kp=30.0, ki=4.0, reference=mbdae.Input(name="goal", value=0.2, hold="first"))
    torque = mbdae.JointTorque(joint=joint, torque=mbdae.Input(name="motor", value=1.5))
    return mbdae.Mechanism(mech.model, mech.closures, [*mech.forces, torque, servo], start=mech.start_values)


@pytest.mark.parametrize("backend", ["native", "python"])
@pytest.mark.parametrize("name", ["four_bar", "panda_handle", "bricard"])
def test_inputs_of_odes(name, backend):
    """With constant inputs the ODE is that of a mechanism with these numbers; derivatives are quotients."""
    ode, x = displaced(with_inputs(name), backend)
    assert ode.input_names == ("motor", "goal")
    assert ode.u0.tolist() == [1.5, 0.2]
    u = np.array([-0.7, 0.4])
    J = ode.jacobian(0.1, x, u)
    size = 1 + np.abs(J.u).max()
    assert pytest.approx(numerical_jacobian(lambda du: ode(0.1, x, u + du), 2, 0.1), abs=1e-10 * size) == J.u
    size = 1 + np.abs(J.x).max()
    assert pytest.approx(numerical_jacobian(lambda dx: ode(0.1, x + dx, u), ode.n, 2e-3), abs=1e-10 * size) == J.x
    assert np.array_equal(ode(0.1, x), ode(0.1, x, ode.u0))
    assert np.abs(ode(0.1, x) - ode(0.1, x, u)).max() > 1e-3
    other = ode.restart(0.1, x)
    assert other(0.1, other.x0, u) == pytest.approx(ode.restart(0.1, x)(0.1, other.x0, u), abs=1e-12)


def test_a_solver_with_inputs_is_the_simulator():
    mech = with_inputs("four_bar")
    simulator, ode = mbdae.Simulator(mech, rtol=1e-11), mech.ode()
    x, t = ode.x0, 0.0
    for k in range(10):
        u = np.array([3.0 * np.sin(k), 0.2])
        simulator["motor"] = u[0]
        simulator.advance(0.02)
        x = solve_ivp(ode, (t, t + 0.02), x, args=(u,), method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
        t += 0.02
    q, v, _ = ode.state(t, x)
    assert simulator.q == pytest.approx(q, abs=1e-9)
    assert simulator.v == pytest.approx(v, abs=1e-8)


def test_wrong_inputs_are_one_line():
    ode = with_inputs("four_bar").ode()
    for u in ([1.0], [1.0, np.nan], "motor"):
        with pytest.raises(mbdae.MbdaeError, match=r"^[^\n]*u [^\n]*$"):
            ode(0.0, ode.x0, u)
    mech = shared_model("four_bar")
    drive = mbdae.Driver(joint="crank", speed=mbdae.Input(name="pace", hold="first"))
    with pytest.raises(mbdae.MbdaeError, match=r"^[^\n]*rate of input 'pace'[^\n]*$"):
        mbdae.Mechanism(mech.model, mech.closures, drivers=[drive], start=mech.start_values).ode()


def test_modes_are_rejected():
    with pytest.raises(mbdae.MbdaeError, match=r"^[^\n]*modes[^\n]*$"):
        shared_model("pendulum_on_stop").ode()
    mech = shared_model("four_bar")
    with pytest.raises(mbdae.MbdaeError, match="closure"):
        mech.ode(0.0, mech.start[0] + 0.1)
