"""`Mechanism.at` against Pinocchio's own algorithms, dense linear algebra, and finite differences."""

import numpy as np
import pinocchio as pin
import pytest
import scipy.linalg
from bouncing import add_body, empty
from shared import shared_model

import mbdae
from mbdae.errors import NotCompiled
from mbdae.finite_differences import numerical_derivative, numerical_jacobian
from mbdae.mechanism.formulations.compiled_systems import CompiledSystem

# loops, dependent rows, a free body, rolling rows, states of controllers, a driver, joint friction
MODELS = ["four_bar", "bricard", "heavy_top", "differential_drive", "stewart_platform", "flyball_governor", "dual_arm"]
BACKENDS = ["native", "python"]


@pytest.fixture(scope="module", params=MODELS)
def mech(request):
    return mbdae.load(request.param)


@pytest.fixture(scope="module")
def state(mech):
    """A consistent state that moves in all directions that the closures leave."""
    q, v = mech.start
    rng = np.random.default_rng(3)
    q, v = mech.assemble(q, v + rng.normal(size=mech.nv))
    s = np.array(list(mech.states.values())) + 0.1 * rng.normal(size=len(mech.states))
    return 0.0, q, v, s


def moved(mech, state, x):
    """The state displaced by x = (dq, dv, ds, dt)."""
    t, q, v, s = state
    nv = mech.nv
    return t + x[-1], pin.integrate(mech.model, q, x[:nv]), v + x[nv : 2 * nv], s + x[2 * nv : -1]


def test_terms_are_those_of_pinocchio(mech, state):
    point, model, data = mech.at(*state), mech.model, mech.model.createData()
    M = pin.crba(model, data, point.q)
    M = np.triu(M) + np.triu(M, 1).T
    assert pytest.approx(M, rel=1e-13, abs=1e-13 * np.abs(M).max()) == point.M
    kinetic = 0.5 * point.v @ M @ point.v
    assert point.energies[0] == pytest.approx(kinetic, rel=1e-12)
    if not mech.forces:
        nle = pin.nonLinearEffects(model, data, point.q, point.v)
        assert point.f == pytest.approx(-nle, abs=1e-13 * np.abs(nle).max())


def test_constraints_are_derivatives_of_g(mech, state):
    point, n = mech.at(*state), 2 * mech.nv + len(mech.states) + 1

    def along(h):  # the motion itself: q' = v, t' = 1
        x = np.concatenate([h * point.v, np.zeros(n - mech.nv)])
        x[-1] = h
        return mech.at(*moved(mech, state, x))

    kept = np.asarray(mech.positional, bool)
    assert point.Gv[kept] == pytest.approx(numerical_derivative(lambda h: along(h).g, 1e-3)[kept], abs=1e-9)
    scale = 1 + np.abs(point.gamma).max(initial=0.0)
    assert point.gamma == pytest.approx(numerical_derivative(lambda h: along(h).Gv, 1e-3), abs=1e-8 * scale)


@pytest.mark.parametrize("backend", BACKENDS)
def test_accelerations_solve_the_saddle_point_system(mech, state, backend):
    point = mech.at(*state, backend=backend)
    left = point.M @ point.vdot - point.f - point.G.T @ point.lam
    size = np.abs(point.f).max() + np.abs(point.G.T @ point.lam).max(initial=0.0)
    assert np.abs(left).max() <= 1e-11 * size
    assert np.abs(point.G @ point.vdot + point.gamma).max(initial=0.0) <= 1e-10 * (1 + np.abs(point.vdot).max())
    norm = np.linalg.lstsq(point.G.T, point.G.T @ point.lam, rcond=1e-10)[0]
    assert point.lam == pytest.approx(norm, rel=1e-8, abs=1e-8 * (1 + np.abs(norm).max(initial=0.0)))


@pytest.mark.parametrize("backend", BACKENDS)
def test_jvp_is_the_derivative_and_vjp_its_transpose(mech, state, backend):
    point, nv, ns = mech.at(*state, backend=backend), mech.nv, len(mech.states)
    rng = np.random.default_rng(5)
    direction = rng.normal(size=2 * nv + ns + 1)
    dependent = np.linalg.matrix_rank(point.G, 1e-8) < mech.ng
    if dependent:  # only on the manifold, where the rank is constant
        free = scipy.linalg.null_space(point.G, rcond=1e-8)
        direction[:nv] = free @ rng.normal(size=free.shape[1])
        bend = np.linalg.lstsq(point.G, point.partials().Gv_q @ direction[:nv], rcond=1e-8)[0]
        direction[nv : 2 * nv] = free @ rng.normal(size=free.shape[1]) - bend
    dq, dv, ds, dt = direction[:nv], direction[nv : 2 * nv], direction[2 * nv : -1], direction[-1]

    def values(h):
        t, q, v, s = moved(mech, state, h * direction)
        p = mech.at(t, *(mech.assemble(q, v) if dependent else (q, v)), s, backend=backend)
        return np.concatenate([p.vdot, p.lam, p.sdot])

    found = np.concatenate(point.jvp(dq, dv, ds, dt))
    quotient = numerical_derivative(values, 2e-4)
    size = np.abs(quotient).max() + np.abs(values(0.0)).max()
    assert found == pytest.approx(quotient, abs=2e-8 * size)
    bar = rng.normal(size=len(found))
    q, v, s, t = point.vjp(bar[:nv], bar[nv : nv + mech.ng], bar[nv + mech.ng :])
    assert q @ dq + v @ dv + s @ ds + t * dt == pytest.approx(bar @ found, rel=1e-11, abs=1e-12 * size)


def test_partials_are_derivatives_at_constant_accelerations_and_multipliers(mech, state):
    nv, ns, n = mech.nv, len(mech.states), 2 * mech.nv + len(mech.states) + 1
    rng = np.random.default_rng(8)
    a, lam = rng.normal(size=nv), rng.normal(size=mech.ng)
    found = mech.at(*state).partials(a, lam)

    def values(x):
        p = mech.at(*moved(mech, state, x))
        return np.concatenate([p.f + p.G.T @ lam - p.M @ a, p.sdot, p.Gv, p.gamma])

    jacobian, zero = numerical_jacobian(values, n, 1e-3), np.zeros((mech.ng, ns))
    expected = np.block(
        [
            [found.r_q, found.r_v, found.r_s, found.r_t[:, None]],
            [found.h_q, found.h_v, found.h_s, found.h_t[:, None]],
            [found.Gv_q, mech.at(*state).G, zero, found.Gv_t[:, None]],
            [found.gamma_q, found.gamma_v, zero, found.gamma_t[:, None]],
        ]
    )
    assert jacobian == pytest.approx(expected, abs=1e-7 * (1 + np.abs(expected).max()))


def test_a_point_is_independent_of_later_points(mech, state):
    first = mech.at(*state)
    kept = first.G.copy(), first.f.copy()
    mech.at(0.0, mech.start[0]).G[:] += 1.0
    assert (kept[0] == first.G).all()
    assert (first.f == kept[1]).all()
    assert (kept[0] == mech.at(*state).G).all()


def test_wrong_input_is_named():
    mech = shared_model("four_bar")
    q, _ = mech.start
    for wrong in [(0.0, q[:2]), (np.nan, q), ("a", q), ([0.0], q), (0.0, q, np.full(3, np.nan)), (0.0, q, None, [1.0])]:
        with pytest.raises(mbdae.MbdaeError, match=r"^[^\n]+$"):
            mech.at(*wrong)
    with pytest.raises(mbdae.MbdaeError, match="mode"):
        mech.at(mode=(1,))
    for mode in (1, None, (1.0,), "1"):
        with pytest.raises(mbdae.MbdaeError, match="a mode is the state of each switch"):
            shared_model("pendulum_on_stop").at(mode=mode)
    with pytest.raises(mbdae.MbdaeError, match="dq"):
        mech.at().jvp([1.0], np.zeros(3))
    with pytest.raises(mbdae.MbdaeError, match="dt is a finite number, got nan"):
        mech.at().jvp(np.zeros(3), np.zeros(3), dt=np.nan)


def test_a_direction_that_leaves_dependent_constraints_is_named():
    mech = shared_model("bricard")
    point, v = mech.at(), np.zeros(mech.nv)
    with pytest.warns(UserWarning, match="become independent along"):
        point.jvp(np.eye(mech.nv)[0], v)
    point.jvp(scipy.linalg.null_space(point.G, rcond=1e-8)[:, 0], v)


def test_rows_of_a_stop_act_in_their_mode():
    mech = shared_model("pendulum_on_stop")
    q, v = mech.start
    free, kept = mech.at(0.0, q, v), mech.at(0.0, q, v, mode=(1,) * len(mech.switches))
    assert not free.G.any()
    assert free.lam == pytest.approx(0.0)
    assert kept.G.any()
    assert kept.G @ kept.vdot + kept.gamma == pytest.approx(0.0, abs=1e-12)


SLIDING_BOX = """
[[body]]
name = "x"
joint = "prismatic"
axis = [1, 0, 0]
parent = "world"
[[body]]
name = "z"
joint = "prismatic"
parent = "x"
[[body]]
name = "box"
parent = "z"
axis = [0, 1, 0]
mass = 1.0
com = [0.01, 0, 0.02]
inertia = [0.01, 0.02, 0.01, 0, 0, 0]
[[frame]]
name = "edge"
parent = "box"
xyz = [-0.2, 0, -0.1]
[[closure]]
name = "floor"
kind = "rolling"
frames = ["world", "edge"]
radius = 0.01
grip = "longitudinal"
unilateral = true
[[force]]
kind = "coulomb_friction"
closure = "floor"
coefficient = 0.2
exact = true
"""


@pytest.mark.parametrize("speed", [-1.0, 1.0])
def test_friction_of_a_sliding_contact_has_derivatives_along_its_slip(tmp_path, speed):
    (tmp_path / "box.toml").write_text(SLIDING_BOX)
    mech, dq = mbdae.load(tmp_path / "box.toml", assemble=False), np.array([0.3, -0.2, 1.0])
    q, v, sliding = np.array([0.0, 0.07, 0.2]), np.array([speed, 0.1, 0.5]), (2,)

    def values(h):
        point = mech.at(0.0, q + h * dq, v + h * dq, mode=sliding)
        return np.concatenate([point.vdot, point.lam])

    found = mech.at(0.0, q, v, mode=sliding).jvp(dq, dq)
    assert np.concatenate(found) == pytest.approx(numerical_derivative(values, 1e-3), abs=1e-7)


def test_a_slip_in_two_directions_has_no_derivative():
    model = empty()
    add_body(model, 0, pin.JointModelFreeFlyer(), "ball", 1.5, inertia=(0.006, 0.006, 0.006))
    ball = mbdae.Mechanism(
        model, [mbdae.Closure.rolling("world", "ball", radius=0.1, name="floor")],
        [mbdae.CoulombFriction(closure="floor", coefficient=0.3, exact=True)],
    )  # fmt: skip
    with pytest.raises(mbdae.MbdaeError, match="'floor' slides in two directions: no derivative of v' and lam"):
        ball.at(0.0, np.array([0, 0, 0.1, 0, 0, 0, 1.0]), np.ones(6), mode=(2,)).jvp(np.ones(6), np.ones(6))


def test_python_computes_what_the_core_does_not_support(monkeypatch):
    def refuse(*_, **__):
        raise NotCompiled("a force of another package")

    monkeypatch.setattr(CompiledSystem, "__init__", refuse)
    mech = mbdae.load("four_bar")
    assert np.isfinite(mech.at().vdot).all()
    assert np.isfinite(mech.ode().jacobian(0.0, mech.ode().x0)[0]).all()
    with pytest.raises(NotCompiled, match="force"):
        _ = mech.at(backend="native").vdot
