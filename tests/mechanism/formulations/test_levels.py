"""Constraints preserved by the GGL form and projection, and their order."""

import numpy as np
import pinocchio as pin
import pytest
from chains import random_q, rod, tree
from mechanism.formulations.test_descriptor import bricard
from motions import ALL, distance, levels, model, run, slopes, start_of
from shared import shared_model

import mbdae
from mbdae import METHODS, Closure, Mechanism

# -- the stabilized form ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [name for name, m in METHODS.items() if m.error_power and "ggl" not in m.excludes])
def test_ggl_keeps_both_levels_over_a_hundred_seconds(name):
    rtol = 1e-4 if METHODS[name].order > 3 and not name.startswith("radau") else 1e-3
    sol = run(shared_model("four_bar"), 100.0, method=name, formulation="ggl", rtol=rtol)
    g, Gv = levels(sol)
    assert g <= 1e-11
    assert Gv <= 1e-11 * (1 + np.abs(sol.v).max())  # implicit stages are solved to this accuracy, or to rounding


CASES = [
    ("pendulum", 2.0, (40, 80, 160, 320, 640)),
    ("four_bar", 1.0, (50, 100, 200, 400, 800)),
    ("free_loop", 0.5, (10, 20, 40)),
]


@pytest.mark.parametrize(("name", "T", "steps"), CASES)
@pytest.mark.parametrize("method", ["herk3", "pherk4", "pherk5", "herk5", "radau3", "radau5"])
def test_ggl_keeps_the_order(name, T, steps, method):
    observed = slopes(model(name), T, steps, method=method, formulation="ggl")
    assert min(observed) >= METHODS[method].order_linear - 0.2, observed


@pytest.mark.parametrize("method", ["herk3", "pherk4", "pherk5", "radau5"])
def test_ggl_multipliers_come_first_and_keep_their_order(method):
    mech, errors, steps = shared_model("pendulum"), [], (40, 80, 160, 320)
    for n in steps:
        sol = run(mech, 2.0, method=method, formulation="ggl", step=2.0 / n)
        assert sol.z_own.shape == (n + 1, 2 * mech.ng)
        assert sol.lam.shape == sol.lam_own.shape == (n + 1, mech.ng)
        mu = sol.z_own[:, mech.ng :]  # zero on the exact solution
        errors.append((np.abs(sol.lam_own - sol.lam).max(), np.abs(mu).max()))
    observed = -np.polyfit(np.log2(steps), np.log2(errors), 1)[0]
    assert observed.min() >= METHODS[method].order_own - 0.2, observed


def test_mu_is_carried_from_step_to_step():
    mech = shared_model("pendulum")
    system, method, h = mech.system("ggl"), METHODS["pherk5"], 0.1
    F, z = system.derivative(0.0, mech.point())
    carry = system.carry(F, z)
    assert not carry[: mech.nv].any()
    step = method.step(system, 0.0, h, mbdae.system.State(mech.point(), carry))
    mu = step.z[mech.ng :]
    G = mech.system().closures(step.state.y[: mech.nq])[1]
    assert mu[0] != 0
    np.testing.assert_allclose(step.state.carry[: mech.nv], G.T @ mu, atol=1e-15)  # a unit mass: M = 1


@pytest.mark.parametrize(
    "options", [{"formulation": "ggl"}, {"formulation": "ggl", "method": "radau5"}, {"project": True}]
)
def test_dependent_rows_are_all_kept(options, back_end):
    T = 5.0 if back_end == "native" and "method" not in options else 1.0
    mech = bricard(3, [0.0, 0.0, -9.81])
    sol = mbdae.solve(mech, (0.0, T), np.zeros(5), np.zeros(5), rtol=1e-9, **options)
    assert sol.success, sol.message
    assert max(levels(sol)) < 1e-12
    other = mbdae.solve(mech, (0.0, T), np.zeros(5), np.zeros(5), rtol=1e-9)
    assert np.abs(sol.q[-1] - other.q[-1]).max() < 1e-6


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("kinds", [["free", "spherical"], ["revolute", "rx"]])
def test_trees_have_the_same_motion_in_every_formulation(kinds):
    mech = Mechanism(tree(kinds, [0, 1]))
    start = random_q(mech.model, np.random.default_rng(0)), np.ones(mech.nv)
    reference = mbdae.solve(mech, (0.0, 0.5), *start, rtol=1e-9)
    for options in ALL[1:]:
        sol = mbdae.solve(mech, (0.0, 0.5), *start, rtol=1e-9, **options)
        assert sol.z_own.shape == (len(sol.t), 0)
        assert max(distance(mech, reference, sol)) < 1e-7


# -- singular positions ----------------------------------------------------------------------------------------------


def two_four_bars():
    """Two parallelograms side by side: singular when the cranks are flat."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    for k in range(3):
        joint, tip = rod(model, 0, pin.SE3(np.eye(3), np.array([float(k), 0, 0])), 1.0, f"crank{k}", width=0.0)
        if k < 2:
            rod(model, joint, tip, 1.0, f"bar{k}", width=0.0)
    return Mechanism(model, closures=[Closure.point(f"bar{k}_tip", f"crank{k + 1}_tip") for k in range(2)])


@pytest.mark.parametrize("options", [{}, {"project": False}, {"project": True}, {"formulation": "ggl"}])
def test_branch_at_a_singular_position(options, back_end):
    """The cranks are flat at 0.71, 1.23, 2.65, ... s."""
    mech, T = two_four_bars(), 5.0 if back_end == "native" else 2.0
    cranks = [i for i, n in enumerate(mech.joint_names) if n.startswith("crank")]
    sign = np.where(np.isin(np.arange(mech.nq), cranks), 1.0, -1.0)
    sol = mbdae.solve(mech, (0.0, T), *mech.assemble(sign * np.pi / 2, sign), rtol=1e-9, **options)
    spread = np.ptp(sol.q[:, cranks], axis=1).max()
    assert sol.success, sol.message
    assert spread < 1e-7


# -- projection ------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{"rtol": 1e-6}, {"step": 0.01}])
@pytest.mark.parametrize("method", ["pherk5", "herk3", "radau5"])
def test_projection_stops_the_drift(method, options):
    mech = shared_model("four_bar")
    plain, projected = (run(mech, 1.0, method=method, project=p, **options) for p in (False, True))
    assert levels(plain)[0] > 1e-9
    assert max(levels(projected)) <= 1e-12
    assert plain.stats["state_projections"] == 0
    assert projected.stats["state_projections"] == projected.stats["steps"]
    assert distance(mech, plain, projected)[0] < 0.1  # the same motion


@pytest.mark.usefixtures("back_end")
def test_projection_keeps_the_order_without_new_solves():
    mech, steps = shared_model("pendulum"), (20, 40, 80, 160)
    assert min(slopes(mech, 2.0, steps, method="pherk5", project=True)) >= 4.8
    solves = [run(mech, 2.0, method="pherk5", rtol=1e-8, project=p).stats["solves"] for p in (False, True)]
    assert abs(solves[0] - solves[1]) <= 20  # the carry is kept


@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "free_loop"])
def test_projection_is_least_in_the_mass_metric(name):
    mech = model(name)
    system, rng = mech.system(), np.random.default_rng(1)
    y = np.concatenate([*start_of(mech), [0.0]])
    off = system.add(y, 1e-4 * rng.standard_normal(system.ny))
    back = system.project_state(0.0, off)
    assert max(np.abs(r).max() for r in mech.residual(*system.split(back))) < 1e-13
    M = pin.crba(mech.model, mech.model.createData(), off[: mech.nq])
    M = np.triu(M) + np.triu(M, 1).T
    G = system.closures(back[: mech.nq])[1]
    move = system.difference(off, back)
    for part, tolerance in ((move[: mech.nv], 1e-6), (move[mech.nv : 2 * mech.nv], 1e-6)):
        force = M @ part  # normal: a combination of the rows of G, to first order of the correction
        rest = force - G.T @ np.linalg.lstsq(G.T, force, rcond=1e-8)[0]
        assert np.abs(rest).max() < tolerance


@pytest.mark.parametrize("away", [1e-10, 1e-6, 1e-2])
def test_projection_iterates_until_positions_converge(away):
    """From any distance, as Newton's method does: the error of a correction is the square of its size."""
    mech = shared_model("four_bar")
    system = mech.system()
    off = mech.point()
    off[: mech.nq] += away * np.array([1.0, -0.5, 0.3])
    back = system.project_state(0.0, off)
    assert np.abs(mech.residual(off[: mech.nq], np.zeros(mech.nv))[0]).max() > 0.1 * away
    assert max(np.abs(r).max() for r in mech.residual(*system.split(back))) < 1e-13
