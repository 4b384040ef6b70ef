"""Residuals and linear systems of implicit stages, against difference quotients."""

import os
import subprocess
import sys

import numpy as np
import pytest
from chains import random_q, tree

import mbdae
from mbdae import (
    Actuator,
    Closure,
    Driver,
    Hessenberg,
    JointDamping,
    JointSpring,
    Mechanism,
    SpringDamper,
    finite_differences,
)
from mbdae.errors import StepError
from mbdae.linear_solve import factorized


def swirl(t, q, v):
    return np.sin(np.arange(1.0, len(v) + 1) + t) * (1 + v**2) - 0.3 * np.roll(v, 1)


def motor():
    def torque(t, q, v, s):
        return np.r_[s[0] * np.cos(s[1]) - v[1], np.zeros(len(v) - 1)]

    def rate(t, q, v, s):
        return np.array([-5 * s[0] + s[1] * v[0], np.sin(s[0]) - 2 * s[1] + v[2]])

    return Actuator(torque, rate, start={"a": 0.4, "b": -0.2}, name="motor")


def curved():
    """Closed by free, spherical, planar and flat joints, with various forces."""
    kinds = ["free", "spherical", "revolute", "planar", "continuous", "prismatic"]
    model = tree(kinds, [0, 1, 2, 1, 4, 5], seed=5)
    forces = [
        JointDamping(joint="revolute_2", damping=3.0),
        JointSpring(joint="prismatic_5", stiffness=50.0, rest=0.1),
        SpringDamper(frames=("ground", "tip_3"), stiffness=40.0, damping=6.0, length=0.3),
        swirl,
        motor(),
    ]
    return Mechanism(model, [Closure.point("tip_2", "tip_5"), Closure.distance("ground", "tip_0", 1.0)], forces)


def moving_axes():
    """Joints whose axes move within the joint, which are expanded to be differentiated; a driver."""
    model = tree(["universal", "composite", "euler", "revolute"], [0, 1, 2, 3], seed=2)
    driver = Driver(joint="revolute_3", motion={"kind": "harmonic", "amplitude": 0.5, "omega": 3.0})
    return Mechanism(model, [Closure.point("ground", "tip_2")], [swirl], drivers=[driver])


def flat():
    return Mechanism(tree(["revolute", "prismatic", "revolute"], [0, 1, 1]), [], [swirl])


MECHANISMS = {"curved": curved, "moving_axes": moving_axes, "flat": flat}


def stage(name, formulation):
    """A chart and a stage (t, x, x', z) away from the start of the step."""
    mech, rng = MECHANISMS[name](), np.random.default_rng(3)
    system = mech.system(formulation)
    q, v = random_q(mech.model, rng), rng.standard_normal(mech.nv)
    y = np.concatenate([q, v, [x for x in mech.states.values()], [0.0]])
    chart = system.chart(0.7, y)
    m = len(chart.start()[1])
    x, dx = 0.2 * rng.standard_normal((2, system.ny))
    z = 10 * rng.standard_normal(m)
    if formulation == "ggl":
        z[m // 2 :] = 0.0  # partials are taken where mu = 0
    return chart, 0.7, x, 20 * dx, z


@pytest.mark.parametrize("mu", [0.05, 0.03 + 0.04j])
@pytest.mark.parametrize("formulation", ["index2", "ggl"])
@pytest.mark.parametrize("name", MECHANISMS)
def test_solver_inverts_the_partials_of_the_residual(name, formulation, mu):
    chart, t, x, dx, z = stage(name, formulation)
    n, m = len(x), len(z)

    def residual(by_x, by_dx, by_z):
        return np.concatenate(chart.residual(t, x + by_x, dx + by_dx, z + by_z))

    by_x = finite_differences.numerical_jacobian(lambda e: residual(e, 0, 0), n, 1e-3)
    by_dx = finite_differences.numerical_jacobian(lambda e: residual(0, e, 0), n, 1e-3)
    by_z = finite_differences.numerical_jacobian(lambda e: residual(0, 0, e), m, 1e-3) if m else np.empty((n, 0))
    matrix = -np.hstack([by_dx + mu * by_x, by_z])
    rhs = np.random.default_rng(1).standard_normal(n + m)
    linearized = chart.linearize(x, dx, z)
    dk, dz = linearized.factorize(mu)(rhs[:n], rhs[n:])
    found = matrix @ np.concatenate([dk, dz])
    np.testing.assert_allclose(found, rhs, rtol=0, atol=3e-6 * np.abs(matrix).max() * np.abs(np.append(dk, dz)).max())
    e = rhs[:n]
    np.testing.assert_allclose(linearized.apply_E(e), -by_dx[:n] @ e, rtol=0, atol=1e-9 * np.abs(by_dx).max())


def test_residual_of_the_derivative_is_zero():
    for name in MECHANISMS:
        mech, rng = MECHANISMS[name](), np.random.default_rng(4)
        system = mech.system()
        q, v = mech.assemble(random_q(mech.model, rng, 0.4), 0.1 * rng.standard_normal(mech.nv))
        y = np.concatenate([q, v, [x for x in mech.states.values()], [0.0]])
        chart = system.chart(0.0, y)
        dx, z = chart.start()
        r, c = chart.residual(0.0, np.zeros(system.ny), dx, z)
        assert np.abs(r).max() < 1e-9 * (1 + np.abs(dx).max())
        assert np.abs(c).max(initial=0.0) < 1e-12


def test_textbook_partials():
    """f_y by the user and by difference quotients, which call f, give the same steps: the partials of the residual."""
    calls = []

    def f(t, y, z):
        calls.append(t)
        return np.array([y[1] * y[2] + t, np.sin(y[0]) + 0.1 * z[0] ** 2, z[0] - y[2] ** 2])

    def f_y(t, y, z):
        return np.array([[0, y[2], y[1]], [np.cos(y[0]), 0, 0], [0, 0, -2 * y[2]]])

    args = {"f": f, "g": lambda t, y: np.array([y[2] - np.cos(t) * y[1]]), "y0": (0.2, 1.0, 1.0), "z0": (1.0,)}
    plain, given = Hessenberg(**args), Hessenberg(**args, f_y=f_y)
    a = mbdae.solve(plain, (0, 1), method="radau5", step=0.05)
    quotients = len(calls)
    b = mbdae.solve(given, (0, 1), method="radau5", step=0.05)
    assert a.success
    np.testing.assert_allclose(a.y, b.y, rtol=0, atol=1e-13)
    assert len(calls) - quotients < 0.9 * quotients
    assert b.stats["newton"] < 1.1 * a.stats["newton"]
    np.testing.assert_allclose(a.y[:, 2] - np.cos(a.t) * a.y[:, 1], 0, atol=1e-14)


def test_singular_systems_are_named():
    overflows = np.array([[1e-300, 1e300], [-1e-300, 1e300]]) * 1e8
    for matrix, status, said in (
        (np.zeros((2, 2)), "singular", "it is singular"),
        (np.full((2, 2), np.nan + 0j), "nonfinite", "it has entries that are not finite"),
        (overflows, "nonfinite", "it has entries that are not finite"),
    ):
        with pytest.raises(StepError, match=said) as raised:
            factorized(matrix, "it")
        assert raised.value.status == status
    back = factorized(np.array([[0, 2j], [1, 0]]), "")
    np.testing.assert_allclose(back(np.array([2.0, 3.0])), [3, -1j])


@pytest.mark.slow
def test_thread_counts_do_not_change_a_run():
    """Of LAPACK: threads split sums, if used, and a sum in two parts is rounded differently."""
    code = "import mbdae; s = mbdae.solve(mbdae.load('n_four_bar'), (0, 0.5), method='radau5'); print(s.y.tobytes())"
    runs = [
        subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "OPENBLAS_NUM_THREADS": threads},
            capture_output=True,
            check=True,
            timeout=100,
        )
        for threads in ("1", "2")
    ]
    assert runs[0].stdout == runs[1].stdout
