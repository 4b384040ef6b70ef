"""The index of a problem is checked at the start: rank of g_y f_z, with the names of what is not determined."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

import mbdae
from mbdae import Hessenberg
from mbdae.errors import InputError
from mbdae.textbook.problems import TEXTBOOK


def linear(B, G, scale=1.0):
    """The problem y' = B z, 0 = G y, with z in other units."""
    B, G = np.array(B, float) * scale, np.array(G, float)
    return Hessenberg(
        f=lambda t, y, z: B @ z, g=lambda t, y: G @ y, y0=np.zeros(len(B)), z0=np.zeros(B.shape[1]), title="linear"
    )


@pytest.mark.parametrize("name", TEXTBOOK)
def test_textbook_problems_have_index_2(name):
    assert TEXTBOOK[name]().system().counts.f == 0, "the check is not counted"


@pytest.mark.parametrize(
    ("B", "G", "said"),
    [
        ([[1, 0], [0, 0], [0, 0]], [[1, 0, 0], [0, 1, 0]], "rank 1 of 2, column z.2 and row g.2 depend"),
        ([[1, 2], [2, 4], [0, 0]], [[1, 0, 0], [0, 1, 0]], "rank 1 of 2, column z.[12] and row g.[12] depend"),
        ([[1, 0], [0, 1], [1, 1]], [[1, 1, 0], [2, 2, 0]], "rank 1 of 2, column z.[12] and row g.[12] depend"),
        ([[0], [1]], [[1, 0]], "rank 0 of 1, column z.1 and row g.1 depend on the others or are zero"),
    ],
)
def test_a_singular_problem_is_rejected_by_name(B, G, said):
    with pytest.raises(InputError, match=rf"'linear' does not have index 2 at the start: g_y f_z has {said}"):
        mbdae.solve(linear(B, G), (0, 1), method="herk3", step=0.1)


def test_the_pendulum_with_positions_alone_has_index_3():
    problem = Hessenberg(
        f=lambda t, y, z: np.array([y[2], y[3], -z[0] * y[0], -z[0] * y[1] - 9.81]),
        g=lambda t, y: np.array([y[0] ** 2 + y[1] ** 2 - 1]),
        y0=(1.0, 0.0, 0.0, 0.0),
        z0=(0.0,),
    )
    with pytest.raises(InputError, match=r"column z\.1"):
        mbdae.solve(problem, (0, 1))


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_the_check_does_not_depend_on_units(scale):
    regular = linear([[1, 1], [0, 1], [0, 0]], [[1, 0, 0], [0, 1, 0]], scale)
    assert mbdae.solve(regular, (0, 1), method="herk3", step=0.1).ended
    of_y = np.array([1.0, scale, 1.0])[:, None]
    regular = linear(of_y * [[1, 1], [0.5, 1], [0, 1]], [[1, 1, 0], [1, 0, 1]] / of_y.T)
    assert mbdae.solve(regular, (0, 1), method="herk3", step=0.1).ended


@pytest.mark.slow
def test_the_index_is_that_at_the_start_of_the_run():
    """y1' = t z, y2' = -1/t, y1 + y2 = 1 from t = 1: z = 1/t^2; at t = 0 there is no f, and index 2 is lost."""
    late = Hessenberg(
        f=lambda t, y, z: np.array([t * z[0], -1.0 / t]),
        g=lambda t, y: np.array([y[0] + y[1] - 1]),
        y0=(1.0, 0.0),
        z0=(1.0,),
        exact=lambda t: (np.array([1 + np.log(t), -np.log(t)]), np.array([t**-2.0])),
        title="late",
    )
    np.testing.assert_allclose(mbdae.solve(late, (1, 2), rtol=1e-10).y[-1], late.exact(2)[0], rtol=1e-9)
    assert mbdae.compare(late, (1, 2), methods=["herk3"], rtol=[1e-6]).points[0].errors["y"] < 1e-4
    with pytest.raises(InputError, match="'late' does not have index 2 at the start"):
        mbdae.solve(replace(late, f=lambda t, y, z: np.array([t * z[0], -1.0])), (0, 1))


def test_a_problem_without_constraints_is_rejected():
    ode = Hessenberg(f=lambda t, y, z: -y, g=lambda t, y: np.zeros(0), y0=(1.0,), z0=(), title="decay")
    with pytest.raises(InputError, match="'decay' has no z: a problem of index 2 has at least one constraint"):
        mbdae.solve(ode, (0, 1))


def test_values_that_are_not_finite_are_rejected():
    problem = Hessenberg(
        f=lambda t, y, z: z, g=lambda t, y: y, y0=(0.0,), z0=(0.0,), f_z=lambda t, y, z: np.array([[np.nan]])
    )
    with pytest.raises(InputError, match="not finite at the start"):
        problem.point()


def scalar(**changed):
    """The problem y' = z, 0 = y - t, with functions that may be wrong."""
    functions = {"f": lambda t, y, z: z, "g": lambda t, y: y - t, "y0": [0.0], "z0": [1.0], "title": "scalar"}
    return Hessenberg(**{**functions, **changed})


WRONG = {
    "f": (lambda t, y, z: z[0], r"f of 'scalar' returns the shape \(\), expected \(1,\)"),
    "g": (lambda t, y: 1 / 0, "g of 'scalar' failed at t = 0: ZeroDivisionError"),
    "g_y": (lambda t, y: np.ones(1), r"g_y of 'scalar' returns the shape \(1,\), expected \(1, 1\)"),
    "f_y": (lambda t, y, z: 0.0, r"f_y of 'scalar' returns the shape \(\), expected \(1, 1\)"),
    "f that writes": (lambda t, y, z: np.negative(y, out=y), "f of 'scalar' failed at t = 0: ValueError: .*read-only"),
    "y0": ("start", "y0 of 'scalar' is a list of finite numbers, got 'start'"),
    "z0": ([np.nan], "z0 of 'scalar' is a list of finite numbers"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_functions_are_named(name):
    value, text = WRONG[name]
    with pytest.raises(InputError, match=text):
        mbdae.solve(scalar(**{name.partition(" ")[0]: value}), (0, 1), method="radau3", step=0.5)


@pytest.mark.parametrize("method", ["herk3", "radau3"])
def test_functions_may_return_the_same_array_at_each_call(method):
    F, r = np.empty(1), np.empty(1)
    again = scalar(f=lambda t, y, z: np.multiply(z, z, out=F), g=lambda t, y: np.subtract(y, t, out=r))
    problems = again, scalar(f=lambda t, y, z: z * z)
    found, expected = (mbdae.solve(p, (0, 1), method=method, step=0.5) for p in problems)
    np.testing.assert_array_equal(found.y, expected.y)
    np.testing.assert_array_equal(found.z, expected.z)


@pytest.mark.parametrize(("name", "value"), [("g_y", [[2.0]]), ("g_t", [1.0])])
def test_wrong_derivatives_of_g_are_rejected(name, value):
    with pytest.raises(InputError, match=r"g_y or g_t of 'scalar' is not the derivative of g at the start: .* row 1"):
        scalar(**{name: lambda t, y: np.array(value)}).point()


def test_derivatives_at_a_kink_are_accepted():
    ramp = scalar(g=lambda t, y: y - max(t, 0.0), g_y=lambda t, y: np.eye(1), g_t=lambda t, y: -np.ones(1))
    assert mbdae.solve(ramp, (0, 1), method="herk3", step=0.5).z == pytest.approx(1)
    root = scalar(g=lambda t, y: y - math.sqrt(t) ** 3, g_t=lambda t, y: np.array([-1.5 * math.sqrt(t)]), z0=[0.0])
    assert root.point() == 0


def test_a_function_that_fails_later_leaves_the_run_before():
    sol = mbdae.solve(scalar(f=lambda t, y, z: z if t < 0.55 else 1 / 0), (0, 1), method="herk2", step=0.1)
    assert (sol.status, len(sol.t)) == ("force", 6)
    assert re.match(r"f of 'scalar' failed at t = 0\.55\d*: ZeroDivisionError: division by zero", sol.message)
