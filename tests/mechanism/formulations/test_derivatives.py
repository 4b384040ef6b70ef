"""Exact first derivatives against differences of order six: inertia and closures on every kind of joint, equilibria."""

from itertools import cycle

import closure_kinds
import numpy as np
import pinocchio as pin
import pytest
from chains import JOINTS, close, random_q, tree

from mbdae import Bushing, Closure, Driver, Mechanism, SpringDamper, backend, finite_differences
from mbdae.mechanism.closures import kinds_in_files
from mbdae.mechanism.closures.constraints import Constraints
from mbdae.mechanism.closures.rows import FrameRows
from mbdae.mechanism.formulations.equation_partials import equation_partials, gamma_partials
from mbdae.mechanism.tree.frames import wrench_matrix

PAIRS = [("tip_3", "tip_5"), ("tip_5", "tip_3"), ("tip_2", "tip_5"), ("ground", "tip_5"), ("tip_0", "tip_3")]
KINDS_ALONE = {name: kind.closure for name, kind in closure_kinds.KINDS.items()}
EVERY = {**closure_kinds.ROLLING, **KINDS_ALONE, **closure_kinds.HIGHER}
CLOSURES = [
    closure.model_copy(
        update={
            "name": name,
            **({"frames": pair} if closure.frames else {"joints": ("rx_4", "py_2", "rx_4")[: len(closure.joints)]}),
        }
    )
    for (name, closure), pair in zip(
        EVERY.items(),
        cycle([*PAIRS, ("tip_3", "world")]),
        strict=False,
    )
]
DRIVERS = [
    Driver.harmonic("rx_4", 0.7, 3.0, name="driver"),
    Driver.harmonic(("tip_1", "tip_5"), 0.3, 1.0, offset=1.2, name="driven distance"),
]


def test_every_kind_of_closure_is_tried():
    assert {c.kind for c in CLOSURES} == set(kinds_in_files())
    assert all(c.partials is not FrameRows.partials for c in primitives())


def primitives(base=FrameRows):
    """The kinds of rows between frames that are used."""
    found = [c for c in base.__subclasses__() if c.__module__.startswith("mbdae")]
    return {kind for c in found for kind in primitives(c) or {c}}


def closed(kind):
    model = tree([kind, kind, "py", kind, "rx", kind], [0, 1, 2, 3, 2, 5], seed=3)
    return Mechanism(model, CLOSURES, drivers=DRIVERS)


@pytest.mark.parametrize("kind", JOINTS)
def test_closures_on_every_kind_of_joint(kind):
    """G^T lam and G v by q, gamma by q and v, off the manifold, row by row; both frames on branches or one fixed."""
    mech, rng = closed(kind), np.random.default_rng(5)
    model, s, nv = mech.model, mech.system(), mech.nv
    q, v = random_q(model, rng), rng.standard_normal(nv)

    def at(x):
        return pin.integrate(model, q, x)

    def rows(q, v):
        """G and gamma; twenty times faster by the core."""
        found = fast.rows_of_all_modes(0.3, q, v)
        return found[1::2] if found else (s.jacobian(q), s.gamma(q, v, 0.3))

    fast = mech.system(native=backend.load())
    for found, own in zip(rows(q, v), (s.jacobian(q), s.gamma(q, v, 0.3)), strict=True):
        close(found, own, 1e-14)
    turned, bias_q = (
        finite_differences.numerical_jacobian(lambda x, i=i: rows(at(x), v)[i], nv, 4e-4) for i in (0, 1)
    )  # (ng, nv, nv): G_ik by q_m in [i, k, m]
    bias_v = [(rows(q, v + e)[1] - rows(q, v - e)[1]) / 2 for e in np.eye(nv)]  # gamma is quadratic in v
    Gdot = finite_differences.numerical_derivative(lambda e: rows(at(e * v), v)[0], 4e-4)
    gamma_q, gamma_v = gamma_partials(s, q, v)
    lam, whole = rng.standard_normal(mech.ng), np.zeros((nv, nv))
    K, B = s.constraints.partials(v, lam)
    for spec in mech.constraints:
        alone = Constraints(model, s.workspace, [spec])
        alone.jacobian()
        for one, i in zip(np.eye(spec.m), mech.rows_of(spec.name), strict=True):
            own = alone.partials(v, one)[0]
            whole += lam[i] * own
            close(own, turned[i], size=1)
            close(B[i], v @ turned[i], size=1)
            close(gamma_q[i], bias_q[i], size=v @ v)
            close(gamma_v[i], np.array(bias_v)[:, i], size=1)
            close(gamma_v[i], B[i] + Gdot[i], size=1)
    close(K, whole, 1e-13)


def test_wrenches_turn_with_both_frames():
    """(Da + Db) d = d x* w: a row is invariant when both frames are moved together."""
    mech, rng, met = closed("free"), np.random.default_rng(1), set()
    s = mech.system()
    for _ in range(5):
        s.jacobian(random_q(mech.model, rng))
        for pair, rows in s.constraints.frame_rows.values():
            for _, r, w in rows:
                Da, Db = r.partials(pair)
                met.add(type(r))
                for one, both in zip(w.T, Da + Db, strict=True):
                    close(both, wrench_matrix(one), 1e-14, size=np.abs(Da).max())
    assert met == primitives()


def test_stiffness_is_symmetric_at_an_equilibrium():
    """Newton's method with K finds it, and converges quadratically: quaternions, springs, a bushing and a loop."""
    model = tree(["free", "spherical", "revolute", "universal"], [0, 1, 2, 1], seed=4)
    forces = [SpringDamper(frames=("ground", f"tip_{i}"), stiffness=200.0 + 30 * i, length=0.2) for i in range(4)]
    forces += [Bushing(frames=("world", "tip_0"), stiffness=(300.0, 200, 100, 40, 50, 60), damping=(1.0,) * 6)]
    mech = Mechanism(model, [Closure.distance("tip_2", "tip_3", 0.8)], forces)
    s, nv, q, lam = mech.system(), mech.nv, pin.neutral(model), np.zeros(1)
    u, sizes = np.zeros(nv + 1), []
    for _ in range(60):
        J = equation_partials(s, 0.0, q, u, np.zeros(nv), lam, np.array([0]))
        f, (g, G) = s.force(0.0, q, u[:nv], np.empty(0))[0], s.closures(None, 0.0)
        residual = np.concatenate([f + lam @ G, g])
        sizes.append(np.abs(residual).max())
        if sizes[-1] < 1e-12:
            break
        x = np.linalg.solve(np.block([[J.K[:nv], G.T], [G, np.zeros((1, 1))]]), -residual)
        x *= min(1.0, 0.3 / np.abs(x[:nv]).max())
        q, lam = pin.integrate(model, q, x[:nv]), lam + x[nv:]
    assert sizes[-1] < 1e-12
    assert sizes[-2] < 1e-4
    close(J.K[:nv], J.K[:nv].T, 1e-14)
