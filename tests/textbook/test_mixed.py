"""Mixed index 1 and 2: orders on a known solution, u along a run, and the index check by name."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import mbdae
from mbdae import MixedHessenberg
from mbdae.errors import InputError, StepError
from mbdae.studies.order.measurement import Measurement
from mbdae.textbook.problems import mixed_index


@pytest.mark.parametrize(("method", "orders"), [("herk3", (3, 2)), ("pherk4", (4, 4)), ("radau3", (3, 2))])
def test_the_orders_are_those_of_index_2(method, orders, monkeypatch):
    monkeypatch.setattr(Measurement, "max_solves", 2000)
    (observed,) = mbdae.order(mixed_index(), [method], steps=20).orders.values()
    for o in observed:
        claim = orders[o.quantity == "own z"]
        assert o.claimed == claim
        assert o.observed == pytest.approx(claim, abs=0.25)


@pytest.mark.parametrize("options", [{}, {"method": "radau5"}, {"method": "pherk5", "step": 0.02}])
def test_u_is_known_along_a_run(options):
    problem = mixed_index()
    sol = mbdae.solve(problem, (0, 1), **({"rtol": 1e-9} | options if "step" not in options else options))
    u = problem.local(sol.t, sol.y, sol.z)
    assert u.shape == (len(sol.t), 1)
    np.testing.assert_allclose(u[:, 0], np.exp(sol.t), rtol=1e-6)
    np.testing.assert_allclose(sol.y, np.exp(np.outer(sol.t, [1, -2])), rtol=1e-6)


def test_finite_differences_replace_missing_partials():
    problem, at = mixed_index(), (0.3, np.array([1.1, 0.8]), np.array([1.3]))
    none = dict.fromkeys(["f_y", "f_z", "f_u", "k_y", "k_z", "k_u"])
    exact, found = problem.system(), replace(problem, **none).system()
    np.testing.assert_allclose(found.f_y(*at), exact.f_y(*at), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.f_z(*at), exact.f_z(*at), rtol=1e-9, atol=1e-9)


def test_it_is_pickled_by_name():
    assert pickle.loads(pickle.dumps(mixed_index())).title == mixed_index().title


def problem(k, u0=(0.0, 0.0), f=lambda t, y, z, u: z + u):
    return MixedHessenberg(f=f, g=lambda t, y: y, k=k, y0=(0.0, 0.0), z0=(0.0, 0.0), u0=u0, title="mixed")


@pytest.mark.parametrize(
    ("k", "said"),
    [
        (lambda t, y, z, u: np.array([u[0] - z[0], z[1] - 1e-6 * u[0]]), "rank 1 of 2, column u.2 and row k.[12]"),
        (lambda t, y, z, u: np.array([u[0] + u[1], 2 * u[0] + 2 * u[1]]), "rank 1 of 2, column u.[12] and row k.[12]"),
    ],
)
def test_a_singular_k_u_is_rejected_by_name(k, said):
    with pytest.raises(InputError, match=f"0 = k of 'mixed' does not determine u at the start: k_u has {said}"):
        mbdae.solve(problem(k), (0, 1))


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_the_check_does_not_depend_on_units(scale):
    regular = problem(lambda t, y, z, u: np.array([u[0] * scale - y[0], u[1] - u[0] * scale]))
    assert mbdae.solve(regular, (0, 1), method="herk3", step=0.5).ended


def test_u_may_cancel_a_multiplier():
    """f = z + u, 0 = u + z: the total derivative with respect to z is singular, though f_z is not."""
    with pytest.raises(InputError, match=r"'mixed' does not have index 2 .* rank 1 of 2, column z\.1 and row g\.1"):
        mbdae.solve(problem(lambda t, y, z, u: np.array([u[0] + z[0], u[1] - y[0]])), (0, 1))


def test_shapes_and_equations_without_a_solution_are_named():
    with pytest.raises(InputError, match=r"k of 'mixed' returns the shape \(1,\), expected \(2,\)"):
        problem(lambda t, y, z, u: u[:1]).point()
    none = problem(lambda t, y, z, u: np.array([u[0] ** 2 + 1, u[1]]), u0=(1.0, 0.0))
    with pytest.raises(StepError, match="Newton's method for u does not converge at t = 0 in 0 = k of 'mixed'"):
        none.point()
