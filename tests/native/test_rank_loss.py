"""Rank loss of many rows: sparse in the core, dense in Python, and runs that pass singular configurations."""

import numpy as np
import pytest
from scipy.integrate import quad

import mbdae
from mbdae import backend
from mbdae.mechanism import singularity
from mbdae.mechanism.formulations import rank_loss
from mbdae.mechanism.formulations.steps import projection

pytestmark = pytest.mark.native
N, GRAVITY = 20, 9.81


def row(redundant):
    """A row of parallelograms; with redundant rows, two equal closures for each loop."""
    mech = mbdae.load("n_four_bar", N=N)
    twice = [c.model_copy(update={"name": f"{c.name}_twice"}) for c in mech.closures]
    return mbdae.Mechanism(mech.model, [*mech.closures, *twice]) if redundant else mech


def workspaces(mech):
    out = mech.system(native=backend.load()), mech.system()
    y = np.concatenate([*upright(mech), [0.0]])
    for system in out:
        system.derivative(0.0, y)
    return out


def upright(mech, angle=np.pi / 2):
    """Cranks at an angle to the ground, couplers parallel to it."""
    sign = np.array([-1.0 if "coupler" in name else 1.0 for name in list(mech.model.names)[1:]])
    return angle * sign, -sign


@pytest.mark.parametrize("redundant", [False, True])
def test_combinations_of_rows_that_vanish_are_those_of_the_dense_decomposition(redundant):
    core, python = workspaces(mech := row(redundant))
    flat, regular = upright(mech, 1e-9)[0], upright(mech, 0.5)[0]
    vectors = np.random.default_rng(1).standard_normal((mech.ng, 3))
    for q, rank in ((flat, N), (regular, 2 * N)):
        a, b = (s.vanishing_combinations(0.0, q, 2 * N, 1e-5, vectors) for s in (core, python))
        assert a[0] == b[0] == rank
        np.testing.assert_allclose(a[1], b[1], atol=1e-7)
    assert core.in_use == workspaces(mech)[0].in_use, "the rows in use remain"


@pytest.mark.parametrize("redundant", [False, True])
def test_all_closures_of_a_flat_row_are_named(redundant):
    core, python = workspaces(mech := row(redundant))
    (flat, v), before = upright(mech, 1e-9), upright(mech, 0.05)[0]
    points = [np.concatenate([q, v, [0.0]]) for q in (flat, before)]
    a, b = (singularity.singular(s, 0.0, points[0], (-0.05, points[1]), 1e-5) for s in (core, python))
    assert a == b
    assert a.closures == tuple(c.name for c in mech.closures)
    assert singularity.singular(core, 0.0, points[1], (-0.05, points[1]), 1e-5) is None


def test_tangent_spaces_are_those_of_the_dense_decomposition():
    core, python = workspaces(mech := row(False))
    points = [(0.0, np.concatenate([*upright(mech, angle), [0.0]])) for angle in (0.7, 0.72)]
    for _, y in points:
        (a,), (b,) = (s.null_spaces([s.split(y)[0]]) for s in (core, python))
        assert abs(a[:, 0] @ b[:, 0]) == pytest.approx(1)
        assert abs(a[:, 0] @ upright(mech)[1]) == pytest.approx(mech.nv**0.5), "all bars turn at the same speed"
    assert singularity.tangent_space_angle(core, *points) < 1e-7
    free = core.core.admissible_velocities(points[0][1][: mech.nq], np.eye(mech.nv)[:3])
    assert np.abs(python.jacobian(points[0][1][: mech.nq]) @ free.T).max() < 1e-12


def test_loops_with_a_gap_pass_singular_configurations_at_a_distance():
    core, python = workspaces(mech := row(False))
    q = upright(mech, 1e-6)[0]
    gap = 1e-3
    longer = mech.model.copy()
    longer.jointPlacements[longer.getJointId(f"crank_{N}")].translation[0] += gap
    open_core = workspaces(mbdae.Mechanism(longer, mech.closures))[0]
    assert core.residual_of_dependent_rows(0.0, q, 1e-4, 2) < 1e-9
    assert python.residual_of_dependent_rows(0.0, q, 1e-4, 2) < 1e-9
    assert open_core.residual_of_dependent_rows(0.0, q, 1e-4, 2) > 0.1 * gap


@pytest.mark.parametrize("away", [1e-2, 1e-3])
def test_states_next_to_a_flat_row_are_projected_to_rounding(away):
    core, python = workspaces(mech := row(False))
    y = np.concatenate([*upright(mech, away), [0.0]])
    off = python.add(y, 1e-9 * np.random.default_rng(0).standard_normal(python.ny))
    found, expected = core.core.project_state(0.0, off, True), python.project_state(0.0, off, True)
    g, rate = mech.residual(*python.split(found))
    assert max(np.abs(g).max(), np.abs(rate).max()) < 1e-13
    assert np.abs(python.difference(expected, found)).max() < 1e-11 / away


def test_a_row_crosses_flat_configurations_in_linear_time(monkeypatch):
    """Bars of 1 m and 1 kg with equal angles: a pendulum, whose first flat configuration is an integral."""

    def dense(*_):
        raise AssertionError("a dense decomposition of all rows")

    mech = row(False)
    for module, name in ((rank_loss, "mass_scaled_jacobian"), (projection, "_minimum_norm_solution")):
        monkeypatch.setattr(module, name, dense)
    sol = mbdae.solve(mech, (0, 1.0), rtol=1e-8, backend="native")
    assert sol.success, sol.message
    inertia, lever = (N + 1) / 3 + N, (N + 1) / 2 + N

    def pace(angle):
        return (1 + 2 * GRAVITY * lever * (1 - np.sin(angle)) / inertia) ** -0.5

    assert [x.t for x in sol.singular] == pytest.approx([quad(pace, 0, np.pi / 2)[0]], abs=1e-6)
    assert sol.singular[0].rank_there == N


def test_closures_of_a_single_lost_rank_are_those_of_the_projection(monkeypatch):
    """A driven row of unequal loops at a dead point: random vectors span what the unit vectors span."""
    equal = row(False)
    model, drivers = equal.model.copy(), [mbdae.Driver.polynomial("crank_0", (np.pi / 2, -1.0))]
    for i in range(N + 1):
        model.jointPlacements[model.getJointId(f"crank_{i}")].translation[0] += 0.09 * (-1) ** i
    mech = mbdae.Mechanism(model, equal.closures, drivers=drivers)
    guess = {name: sign * np.pi / 2 for name, sign in zip(mech.joint_names, upright(mech, 1.0)[0], strict=True)}
    sol = mbdae.solve(mech, (0, 3.0), *mech.assemble(guess=guess), backend="native")
    assert sol.status == "driver" or sol.singular
    k, found = len(sol.t) - 4, []
    points = [(sol.t[i], np.concatenate([sol.q[i], sol.v[i], [0.0]])) for i in (k, -1)]
    for many in (singularity.MANY_ROWS, mech.ng):
        monkeypatch.setattr(singularity, "MANY_ROWS", many)
        system = mech.system(native=backend.load())
        system.derivative(0.0, np.concatenate([sol.q[0], sol.v[0], [0.0]]))
        limit = 2 * system.pivot_ratio(*points[1])
        found.append(singularity.singular(system, *points[1], points[0], limit))
    assert found[0].rank - found[0].rank_there == 1
    assert found[0] == found[1]
    assert 1 < len(found[0].closures) < N
