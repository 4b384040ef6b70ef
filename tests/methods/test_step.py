"""The step is the tableau: coefficients recovered by running it, orders on a textbook problem, purity."""

import numpy as np
import pinocchio as pin
import pytest
from shared import shared_model

import mbdae
from mbdae.errors import StepError
from mbdae.methods import METHODS
from mbdae.methods.exact_numbers import exact
from mbdae.methods.half_explicit_step import step_doubling
from mbdae.methods.tableau import Tableau
from mbdae.system import Counts, State, Step, System
from mbdae.textbook.problems import hessenberg_a

TABLEAUS = {name: m for name, m in METHODS.items() if isinstance(m, Tableau)}
every = pytest.mark.parametrize("tableau", TABLEAUS.values(), ids=TABLEAUS.keys())


class Probe(System):
    """A problem whose i-th stage has the derivative e_i, so that every point shows its coefficients."""

    def __init__(self, n):
        self.ny, self.nz, self.counts, self.error_components = n, 1, Counts(), slice(None)
        self.stages, self.done = [], 0

    def chart(self, t, y):
        self.y = y
        return self

    def first(self, carry):
        self.stages.append(None)
        return carry, np.array([-1.0])

    def stage(self, t, x, t_hat, xhat, factor):
        self.stages.append((t, x.copy(), t_hat, xhat.copy(), factor))
        return np.eye(self.ny)[len(self.stages) - 1], np.array([float(len(self.stages))])

    def point(self, x):
        return self.y + x

    def all_multipliers(self, z):
        return z

    def carry(self, F, z):
        return F

    def project(self, e):
        return 2 * e

    def rounding_loss(self, y0, x, y1):
        return None


@every
def test_the_step_recovers_its_tableau(tableau):
    n, t, h = len(tableau.A), 0.7, 0.25
    probe = Probe(n)
    step = tableau.step(probe, t, h, State(np.zeros(n), np.eye(n)[0]))
    A, Ahat, b = (np.array(x, float) for x in (tableau.exact_A, tableau.exact_Ahat, tableau.exact_b))
    assert len(probe.stages) == n
    assert probe.stages.count(None) == int(tableau.explicit_first)
    for i, stage in enumerate(probe.stages):
        if stage is None:
            assert i == 0
            assert not A[0].any()
            assert not Ahat[0].any()
            continue
        t_i, x, that_i, xhat, factor = stage
        np.testing.assert_allclose(x / h, A[i], atol=2e-16, rtol=4e-16)
        pivot = factor / h * np.eye(n)[i]
        np.testing.assert_allclose(xhat / h + pivot, Ahat[i], atol=2e-16, rtol=4e-16)
        assert xhat[i] == 0
        assert (t_i - t) / h == pytest.approx(A[i].sum(), abs=1e-14)
        assert (that_i - t) / h == pytest.approx(Ahat[i].sum(), abs=1e-14)
    np.testing.assert_allclose(step.state.y / h, b, atol=2e-16, rtol=4e-16)
    np.testing.assert_array_equal(step.z, [n])
    if tableau.explicit_first:  # the last stage's derivative is the next first one
        np.testing.assert_array_equal(step.state.carry, np.eye(n)[-1])
        np.testing.assert_allclose(A[-1], b, atol=1e-16)
    formulas = [w for w in (tableau.b_embedded, tableau.b_companion) if w]
    assert len(step.errors) == len(formulas)
    scale = 2 if tableau.project_embedded else 1
    for error, weights in zip(step.errors, formulas, strict=True):
        padded = np.zeros(n)
        padded[: len(weights)] = [float(exact(w)) for w in weights]
        np.testing.assert_allclose(error / h / scale, padded - b, atol=4e-16)


@every
def test_cost_is_what_the_tableau_says(tableau):
    probe = Probe(len(tableau.A))
    tableau.step(probe, 0.0, 1.0, State(np.zeros(probe.ny), np.eye(probe.ny)[0]))
    assert sum(s is not None for s in probe.stages) == tableau.solves


def observed(method, steps):
    """Errors of y and z of the method at t = 1 on problem (a), whose solution is known."""
    out = []
    for n in steps:
        sol = mbdae.solve(hessenberg_a(), (0, 1), method=method, step=1 / n)
        y, z = hessenberg_a().exact(1.0)
        out.append([np.abs(sol.y[-1] - y).max(), np.abs(sol.z_own[-1] - z).max()])
    return np.array(out).T


@pytest.mark.parametrize(
    ("method", "order", "own", "steps"),
    [
        ("herk1", 1, 1, [40, 80, 160]),
        ("herk2", 2, 1, [80, 160, 320]),
        ("herk3", 3, 2, [320, 640, 1280]),
        ("pherk3", 3, 3, [40, 80, 160]),
        ("pherk4", 4, 4, [20, 40, 80]),
    ],
)
def test_orders_on_a_problem_with_a_known_solution(method, order, own, steps):
    for errors, claim in zip(observed(method, steps), (order, own), strict=True):
        assert (np.log2(errors[:-1] / errors[1:]) >= claim - 0.2).all(), errors


@pytest.mark.parametrize(("method", "plain"), [("kutta3", 3), ("rk4", 4), ("rule38", 4)])
def test_classical_methods_lose_their_order(method, plain):
    errors, _ = observed(method, [160, 320])
    found = np.log2(errors[0] / errors[1])
    assert 1.8 < found < 2.4 < plain


def mechanism_step(system, method, t, h, y):
    tableau = METHODS[method]
    carry = system.carry(*system.derivative(t, y)) if tableau.explicit_first else None
    return tableau.step(system, t, h, State(y, carry))


@pytest.mark.usefixtures("back_end")
@every
def test_a_step_is_a_function_of_its_arguments(tableau):
    mech = shared_model("slider_crank")
    y = mech.point()
    system = mech.system()
    first = mechanism_step(system, tableau.name, 0.0, 1e-2, y)
    before = y.copy()
    for h in (0.1, -0.3):  # steps that a controller would reject
        try:
            mechanism_step(system, tableau.name, 0.0, h, y)
        except StepError:
            continue
    np.testing.assert_array_equal(y, before)
    again = mechanism_step(system, tableau.name, 0.0, 1e-2, y)
    fresh = mechanism_step(mech.system(), tableau.name, 0.0, 1e-2, y)
    for other in (again, fresh):
        np.testing.assert_allclose(other.state.y, first.state.y, rtol=0, atol=1e-14)
        np.testing.assert_allclose(other.z, first.z, rtol=0, atol=1e-9)
        np.testing.assert_allclose(other.errors, first.errors, rtol=0, atol=1e-13)


@pytest.mark.parametrize("method", ["herk3", "pherk5"])
def test_a_textbook_step_is_a_function_of_its_arguments(method):
    problem = hessenberg_a()
    system, y = problem.system(), problem.point()
    first = mechanism_step(system, method, 0.0, 1e-2, y)
    mechanism_step(system, method, 0.0, 0.3, y)
    again = mechanism_step(system, method, 0.0, 1e-2, y)
    np.testing.assert_allclose(again.state.y, first.state.y, rtol=1e-13)
    np.testing.assert_allclose(again.z, first.z, rtol=1e-11)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("name", [n for n, m in TABLEAUS.items() if m.b_embedded])
def test_the_error_estimate_has_the_order_it_is_used_with(name):
    tableau, mech = TABLEAUS[name], shared_model("four_bar")
    y = mech.point(*mech.assemble({"crank": 0.9}, {"crank": 2.0}))
    sizes = []
    for h in (0.01, 0.005):
        step = mechanism_step(mech.system(), name, 0.0, h, y)
        sizes.append(np.linalg.norm(step.errors[:, : 2 * mech.nv], axis=1))
    slopes = np.log2(sizes[0] / sizes[1])
    claims = tableau.order_embedded + 1 - np.arange(len(slopes))
    assert (np.abs(slopes - claims) < 0.3).all(), slopes
    if tableau.project_embedded:
        velocity = step.errors[0, mech.nv : 2 * mech.nv]
        assert np.abs(mech.residual(step.state.y[:3], velocity)[1]).max() < 1e-3 * np.abs(velocity).max()


class Sum(Probe):
    """q' = 1 in one stage or more: the rounding error of a step is known."""

    def stage(self, t, x, t_hat, xhat, factor):
        return np.ones(self.ny), np.zeros(1)

    def rounding_loss(self, y0, x, y1):
        return x - (y1 - y0)

    def difference(self, y0, y1):
        return y1 - y0


@every
def test_a_step_adds_the_previous_rounding_error_and_returns_its_own(tableau):
    """Kahan's sum: x = h sum b_i F_i + c, y_1 = y (+) x in floating point, c_1 = x - (y_1 - y)."""
    y, lost, eps = np.ones(2), np.array([0.4, -0.3]), np.finfo(float).eps
    step = tableau.step(Sum(2), 0.0, 0.3 * eps, State(y, np.ones(2), eps * lost))
    np.testing.assert_array_equal(step.state.y, [1 + eps, 1])  # 1 + 0.7 eps, 1 + 0
    np.testing.assert_allclose(step.state.compensation, [-0.3 * eps, 0], atol=1e-15 * eps)
    first = tableau.step(Sum(2), 0.0, 0.3 * eps, State(y, np.ones(2)))
    np.testing.assert_allclose(first.state.compensation, 0.3 * eps, rtol=1e-14)


def test_step_doubling_keeps_the_rounding_error():
    eps = np.finfo(float).eps
    state = State(np.ones(1), np.ones(1), np.array([0.1 * eps]))
    step = step_doubling(METHODS["herk1"].step, 1, Sum(1), 0.0, 0.8 * eps, state)
    np.testing.assert_array_equal(step.state.y, [1 + eps])  # 1 + 0.5 eps is 1, and 1 + 0.9 eps then is not
    np.testing.assert_allclose(step.state.compensation, -0.1 * eps, rtol=1e-14)


def test_step_doubling_estimates_2_to_the_p_minus_1_errors():
    """q' = 2 t by a step with the error h^3, p = 2: both halves have 2 (h/2)^3."""

    def step(system, t, h, state):
        return Step(State(state.y + (t + h) ** 2 - t**2 + h**3), np.full(1, t), np.zeros((1, 1)))

    doubled = step_doubling(step, 2, Sum(1), 3.0, 0.5, State(np.full(1, 9.0)))
    np.testing.assert_allclose(doubled.state.y, 3.5**2 + 2 * 0.25**3, rtol=1e-15)
    np.testing.assert_allclose(np.abs(doubled.errors), [[2 * 0.25**3]], rtol=1e-13)
    np.testing.assert_array_equal(doubled.z, [3.25])


def one_body(joint):
    """A mechanism of one body without forces."""
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    joint = model.addJoint(0, joint, pin.SE3.Identity(), "joint")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    return mbdae.Mechanism(model)


def test_the_rounding_error_of_a_sum_is_computed_exactly():
    """All of 0.3 eps where 1 + 0.3 eps = 1; of coordinates only where the tangent is a vector space."""
    x = 0.3 * np.finfo(float).eps
    for system in (hessenberg_a().system(), one_body(pin.JointModelPX()).system()):
        y = np.ones(system.ny)
        np.testing.assert_array_equal(system.rounding_loss(y, np.full(system.ny, x), y), x)
    turned = one_body(pin.JointModelSpherical()).system()
    y = np.ones(turned.nq + turned.ny - turned.nv)
    loss = turned.rounding_loss(y, np.full(turned.ny, x), y)
    np.testing.assert_array_equal(loss, np.repeat([0, x], [3, turned.ny - 3]))
    angle = one_body(pin.JointModelRUBZ()).system()  # two coordinates, and one in the tangent
    y = np.ones(angle.nq + angle.ny - angle.nv)
    np.testing.assert_array_equal(angle.rounding_loss(y, np.full(angle.ny, x), y), np.repeat([0, x], [1, angle.ny - 1]))


@pytest.mark.usefixtures("back_end")
def test_rounding_errors_are_added_to_the_next_step():
    """Without forces q grows by the same small amount in every step, with the same rounding error."""
    mech = one_body(pin.JointModelPX())
    sol = mbdae.solve(mech, (0, 1), np.full(1, 1e6), np.full(1, 0.1), step=1e-3, method="herk1")
    assert sol.q[-1, 0] == pytest.approx(1e6 + 0.1, abs=2e-10)


@pytest.mark.usefixtures("back_end")
def test_rejected_steps_leave_no_trace():
    # a run that starts with a hopeless first step is, from its first accepted step on, the run with that step given
    mech = shared_model("four_bar")
    forced = mbdae.solve(mech, (0, 1), rtol=1e-7, first_step=1.0)
    assert forced.stats["rejected"] > 0
    smooth = mbdae.solve(mech, (0, 1), rtol=1e-7, first_step=float(forced.t[1]))
    np.testing.assert_allclose(smooth.q[1], forced.q[1], rtol=0, atol=1e-14)
    np.testing.assert_allclose(smooth.v[1], forced.v[1], rtol=0, atol=1e-13)


@pytest.mark.usefixtures("back_end")
def test_multipliers_of_the_method_have_their_order():
    mech, end = shared_model("pendulum"), 0.5
    exact_end = mbdae.solve(mech, (0, end), method="pherk6", step=end / 400)
    for method, claim in (("herk3", 2), ("pherk4", 4), ("pherk5", 4)):
        errors = []
        for n in (20, 40, 80):
            sol = mbdae.solve(mech, (0, end), method=method, step=end / n)
            errors.append(np.abs(sol.lam_own[-1] - exact_end.lam[-1]).max())
        assert np.log2(errors[-2] / errors[-1]) > claim - 0.3, (method, errors)
