"""The descriptor form: accelerations and multipliers, redundant rows, singular configurations, work and energy."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from chains import free_force, jacobian, rates, rod
from shared import shared_model

import mbdae
from mbdae import Closure, Mechanism, finite_differences
from mbdae.mechanism.closures import independent_rows as independent_rows
from mbdae.methods import METHODS
from mbdae.studies.drift.drift import drift
from mbdae.system import State


def moving(name):
    """A mechanism in motion on its closures."""
    mech = shared_model(name)
    q = mech.start[0]
    return mech, *mech.assemble(q, np.random.default_rng(1).uniform(-1, 1, mech.nv))


def dense_solution(mech, q, v, tau=0.0):
    """v' and lam of smallest norm from one least-squares solve of [M -G^T; G 0], gamma by differences."""
    M, f = free_force(mech.model, q, v)
    G = jacobian(mech, q)
    gamma = finite_differences.numerical_derivative(
        lambda h: mech.residual(mech.manifold.integrate(q, h * v), v)[1], 1e-3
    )
    matrix = np.block([[M, -G.T], [G, np.zeros((mech.ng, mech.ng))]])
    x = np.linalg.lstsq(matrix, np.concatenate([f + tau, -gamma]), rcond=1e-10)[0]
    return x[: mech.nv], x[mech.nv :]


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("name", ["pendulum", "slider_crank", "four_bar"])
def test_accelerations_and_multipliers_against_a_dense_solve(name):
    mech, q, v = moving(name)
    vdot, lam, _ = rates(mech, q, v)
    expected_vdot, expected_lam = dense_solution(mech, q, v)
    np.testing.assert_allclose(vdot, expected_vdot, rtol=0, atol=1e-8 * (1 + np.abs(vdot).max()))
    np.testing.assert_allclose(lam, expected_lam, rtol=0, atol=1e-8 * (1 + np.abs(lam).max()))


@pytest.mark.usefixtures("back_end")
def test_panda_handle_against_a_dense_solve():
    mech, q, v = moving("panda_handle")
    damping = np.ones(8)
    damping[mech.model.joints[mech.model.getJointId("handle")].idx_v] = 0.05
    vdot, lam, power = rates(mech, q, v)
    expected_vdot, expected_lam = dense_solution(mech, q, v, -damping * v)
    np.testing.assert_allclose(vdot, expected_vdot, rtol=0, atol=1e-8 * (1 + np.abs(vdot).max()))
    np.testing.assert_allclose(lam, expected_lam, rtol=0, atol=1e-8 * (1 + np.abs(lam).max()))
    assert power == pytest.approx(-v @ (damping * v))


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize(
    ("name", "rank"),
    [("pendulum", 1), ("four_bar", 2), ("slider_crank", 2), ("andrews_squeezer", 6), ("panda_handle", 5)],
)
def test_rank_is_found(name, rank):
    mech = shared_model(name)
    system = mech.system()
    system.derivative(0.0, mech.point())
    assert system.rank == rank
    assert rank <= mech.ng
    assert np.linalg.matrix_rank(jacobian(mech, mech.start[0]), tol=1e-9) == rank


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "andrews_squeezer"])
def test_multipliers_of_dependent_rows_have_the_smallest_norm(name):
    sol = mbdae.solve(shared_model(name), (0, 1e-3), step=1e-4)
    mech = sol.mechanism
    for values in (sol.lam, sol.lam_own):
        for q, lam in zip(sol.q[1:], values[1:], strict=True):
            G = jacobian(mech, q)
            outside = lam - G @ np.linalg.lstsq(G, lam, rcond=1e-9)[0]  # the component that G^T maps to 0
            assert np.abs(outside).max() < 1e-4 * np.abs(lam).max()  # of a perturbed configuration
    G = jacobian(mech, sol.q[-1])
    outside = sol.lam[-1] - G @ np.linalg.lstsq(G, sol.lam[-1], rcond=1e-9)[0]
    assert np.abs(outside).max() < 1e-11 * np.abs(sol.lam[-1]).max()


CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 1], [0, 1, 1], [0, 0, 1]], float)
AXES = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 0]], float)


def bricard(cut, gravity):
    """Bricard's mechanism: five rods and the ground along six edges of a cube, the hinge at corner ``cut`` being cut.

    Six hinges leave it one degree of freedom where the count gives none (IFToMM benchmark A04).
    """
    model = pin.Model()
    model.gravity.linear = np.array(gravity, float)

    def arm(corners, frame):
        joint, offset = 0, CORNERS[corners[0]]
        for i, k in pairwise(corners):
            along = CORNERS[k] - CORNERS[i]
            hinge = pin.JointModelRevoluteUnaligned(AXES[i])
            joint = model.addJoint(joint, hinge, pin.SE3(np.eye(3), offset), f"rod {min(i, k)}")
            moments = np.where(np.abs(along) > 0.5, 0.01 / 6, 1 / 12 + 0.01 / 12)
            inertia = pin.Inertia(1.0, along / 2, np.diag(moments))
            model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
            offset = along
        model.addFrame(pin.Frame(frame, joint, pin.SE3(np.eye(3), offset), pin.FrameType.OP_FRAME))

    arm(list(range(cut + 1)), "left")
    arm(list(range(5, cut - 1, -1)), "right")
    return Mechanism(model, [Closure.revolute("left", "right", axis=tuple(AXES[cut]))])


def rod_directions(mech, q):
    data = mech.model.createData()
    pin.forwardKinematics(mech.model, data, q)
    return np.array([data.oMi[mech.model.getJointId(f"rod {i}")].rotation for i in range(5)])


def fall(cut, gravity, backend, **options):
    mech, times = bricard(cut, gravity), np.linspace(0, 10, 21)
    return mbdae.solve(mech, (0, 10), np.zeros(5), np.zeros(5), rtol=1e-10, t_eval=times, backend=backend, **options)


@pytest.fixture(scope="module")
def other_cut():
    """The same motion with the loop cut elsewhere, which requires other rows."""
    return fall(5, [9.81, 0, 0], "auto")


@pytest.mark.slow
def test_rows_are_reselected_during_a_run(monkeypatch):
    chosen = set()
    select = independent_rows.select_rows

    def record(B, *given):
        out = select(B, *given)
        chosen.add((B.shape[1], tuple(int(i) for i in out)))
        return out

    monkeypatch.setattr(independent_rows, "select_rows", record)
    for cut, gravity in ((5, [9.81, 0, 0]), (3, [0, 0, -9.81])):
        chosen.clear()
        sol = fall(cut, gravity, "python")
        assert {m for m, _ in chosen} == {5}
        assert len({rows for _, rows in chosen}) > 1
        assert all(len(rows) == 4 for _, rows in chosen)
        d = drift(sol)
        assert d.g_max < 1e-9
        assert d.energy_relative < 1e-8


@pytest.mark.parametrize("backend", ["native", "python"])
def test_loops_cut_elsewhere_have_the_same_motion(other_cut, backend):
    first = fall(3, [9.81, 0, 0], backend)
    for a, b in zip(first.q, other_cut.q, strict=True):
        directions = rod_directions(first.mechanism, a), rod_directions(other_cut.mechanism, b)
        np.testing.assert_allclose(*directions, atol=2e-8)


@pytest.mark.usefixtures("back_end")
def test_redundant_rows_with_minimum_norm(other_cut):
    # in the plane the dependent rows are zero; here five rows of rank four all have a nonzero multiplier
    for sol in (other_cut, mbdae.solve(bricard(3, [9.81, 0, 0]), (0, 0.5), np.zeros(5), np.zeros(5), step=1e-3)):
        mech, i = sol.mechanism, 1 if sol is other_cut else -1
        q, v, lam = sol.q[i], sol.v[i], sol.lam[i]
        expected_vdot, expected_lam = dense_solution(mech, q, v)
        vdot, again, _ = rates(mech, q, v)
        np.testing.assert_allclose(again, lam, rtol=1e-8)  # rows in use may differ
        np.testing.assert_allclose(vdot, expected_vdot, rtol=0, atol=1e-6 * (1 + np.abs(vdot).max()))
        np.testing.assert_allclose(lam, expected_lam, rtol=0, atol=1e-6 * (1 + np.abs(lam).max()))
        G = jacobian(mech, q)
        outside = lam - G @ np.linalg.lstsq(G, lam, rcond=1e-6)[0]
        assert np.abs(outside).max() < 1e-7 * np.abs(lam).max()
        assert np.count_nonzero(np.abs(np.linalg.svd(G)[0][:, -1]) > 0.1) > 1  # several rows are dependent


def test_rows_fixed_at_the_start_fail(other_cut, monkeypatch):
    # shows that the tests above can fail: without reselection a row that is not in use opens
    select = independent_rows.select_rows
    once = lambda B, rows, *more: select(B, None, *more) if rows is None else rows  # noqa: E731
    monkeypatch.setattr(independent_rows, "select_rows", once)
    sol = fall(5, [9.81, 0, 0], "python", project=False)
    assert not sol.success or drift(sol).g_max > 1e-3 or np.abs(sol.q - other_cut.q).max() > 1e-3


def test_matrices_of_a_perturbed_point_are_not_reused_in_a_step():
    mech = shared_model("four_bar")
    system, given = mech.system(), []
    F, z = system.derivative(0.0, mech.point())
    end = METHODS["pherk4"].step(system, 0.0, 1e-2, State(mech.point(), system.carry(F, z))).state.y
    choose = system.select_independent_rows
    system.select_independent_rows = lambda t, U, G: (given.append((U.copy(), G.copy())), choose(t, U, G))[1]
    for away in (0.0, 1e-12, 1e-4):
        q = end[: mech.nq] + away
        system.chart(0.0, np.concatenate([q, end[mech.nq :]]))
        U, G = given.pop()
        np.testing.assert_allclose(G, jacobian(mech, q), rtol=0, atol=1e-14)
        np.testing.assert_allclose(U.T @ U, free_force(mech.model, q, np.zeros(mech.nv))[0], rtol=0, atol=1e-13)


def parallelogram():
    """Two cranks of 1 m on a ground of 2 m, without gravity: rotated at a constant rate, flat at every half turn."""
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    crank, tip = rod(model, 0, pin.SE3.Identity(), 1.0, "crank")
    rod(model, crank, tip, 2.0, "coupler", mass=2.0)
    rod(model, 0, pin.SE3(np.eye(3), np.array([2.0, 0, 0])), 1.0, "rocker")
    return Mechanism(model, [Closure.point("coupler_tip", "rocker_tip", name="pin")])


def turned(angle, rate=2.0):
    sign = np.array([1.0, -1.0, 1.0])
    return angle * sign, rate * sign


@pytest.mark.usefixtures("back_end")
def test_a_step_that_would_end_in_a_singular_configuration_crosses_it():
    mech, angle = parallelogram(), np.pi / 4
    flat = (np.pi - angle) / 2.0
    sol = mbdae.solve(mech, (0, 3), *turned(angle), method="pherk4", step=flat / 100)  # /50: rounding may open the loop
    assert sol.success
    assert np.abs(sol.t - flat).min() > 1e-3
    np.testing.assert_allclose([x.t for x in sol.singular], [flat, flat + np.pi / 2], atol=1e-6)
    np.testing.assert_allclose(sol.q, [turned(angle + 2 * t)[0] for t in sol.t], atol=1e-10)
    np.testing.assert_allclose(sol.v, [turned(0.0)[1]] * len(sol.t), atol=1e-8)


@pytest.mark.usefixtures("back_end")
def test_a_run_that_ends_in_a_singular_position_stops_before():
    mech, angle = parallelogram(), np.pi / 4
    flat = (np.pi - angle) / 2.0
    sol = mbdae.solve(mech, (0, flat), *turned(angle), method="pherk4", step=flat / 50)
    assert sol.status == "rank"
    assert "singular configuration" in sol.message
    np.testing.assert_allclose(sol.q, [turned(angle + 2 * t)[0] for t in sol.t], atol=1e-10)
    np.testing.assert_allclose(sol.v, [turned(0.0)[1]] * len(sol.t), atol=1e-8)


@pytest.mark.usefixtures("back_end")
def test_steps_over_a_singular_position_stay_on_their_branch():
    sol = mbdae.solve(parallelogram(), (0, 3), *turned(np.pi / 4), rtol=1e-8)
    assert sol.success
    np.testing.assert_allclose(sol.q[-1], turned(np.pi / 4 + 6.0)[0], atol=1e-9)


@pytest.mark.usefixtures("back_end")
def test_a_start_in_a_singular_configuration_is_detected():
    sol = mbdae.solve(parallelogram(), (0, 1), *turned(0.0), rtol=1e-8)
    assert sol.status == "rank"
    assert "began in a singular configuration" in sol.message
    assert drift(sol).g_max < 1e-5


@pytest.mark.usefixtures("back_end")
def test_a_body_without_inertia_is_named():
    model = parallelogram().model
    joint, _ = rod(model, 3, pin.SE3.Identity(), 1.0, "ghost", mass=0.0)
    assert joint == 4
    q, v = turned(0.4)
    sol = mbdae.solve(Mechanism(model), (0, 1), np.append(q, 0.0), np.append(v, 0.0))
    assert sol.status == "singular"
    assert "'ghost'" in sol.message


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize(("method", "order"), [("herk3", 3), ("pherk4", 4), ("pherk5", 5)])
def test_work_has_the_order_of_the_method(method, order):
    def drive(t, q, v):
        return np.array([30.0 * np.sin(3 * t), -2.0 * v[1], 0.0])

    mech = mbdae.load("four_bar", forces=[drive])
    exact = mbdae.solve(mech, (0, 0.5), method="pherk6", step=1 / 800)
    balance = np.array([sum(mech.energy(q, v)) for q, v in zip(exact.q, exact.v, strict=True)])
    np.testing.assert_allclose(balance - balance[0] - exact.work, 0, atol=1e-9)
    assert abs(exact.work[-1]) > 1
    errors = []
    for n in (40, 80, 160):
        sol = mbdae.solve(mech, (0, 0.5), method=method, step=0.5 / n)
        errors.append(np.abs(sol.work[:: n // 10] - exact.work[::40]).max())
    assert (np.log2(np.array(errors[:-1]) / errors[1:]) > order - 0.2).all(), errors


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("name", ["pendulum", "slider_crank", "four_bar"])
def test_energy_is_kept(name):
    sol = mbdae.solve(shared_model(name), (0, 2), rtol=1e-10)
    assert drift(sol).energy_relative < 1e-8
    assert drift(sol).Gv_max < 1e-11
