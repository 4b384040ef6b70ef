"""Problems of other fields against their reductions to ordinary differential equations, derived by hand."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm, null_space

import mbdae
from mbdae.textbook.problems import TEXTBOOK
from mbdae.textbook.problems.stokes import LID, VISCOSITY, N, operators

TIGHT = {"rtol": 1e-12, "atol": 1e-13, "method": "DOP853"}


def circuit(T):
    """Kirchhoff's current law at both nodes with e1 = sin 2t known: e2, i, and the source's current."""

    def rates(t, x):
        e2, i = x
        leak = 0.2 * e2 + 1e-3 * (np.exp(4 * e2) - 1) + i
        return [(0.5 * 2 * np.cos(2 * t) - leak) / 1.5, (e2 - 0.5 * i) / 2]

    x = solve_ivp(rates, (0, T), [0, 0], **TIGHT).y[:, -1]
    V1, e2_rate = 2 * np.cos(2 * T), rates(T, x)[0]
    return [np.sin(2 * T), *x], [1.0 * V1 + 0.5 * (V1 - e2_rate)]


def reactor(T):
    """The temperature is known; heat that must be removed gives the position of the valve."""

    def k(t):
        return 0.5 * np.exp(5 * (1 - 1 / (1.2 - 0.2 * np.cos(t))))

    c = solve_ivp(lambda t, c: 1 - c - k(t) * c, (0, T), [0.6], **TIGHT).y[0, -1]
    temperature = 1.2 - 0.2 * np.cos(T)
    share = (1.3 - temperature + 0.6 * k(T) * c - 0.2 * np.sin(T)) / (6 * (temperature - 0.8))
    return [c, temperature], [np.log(share)]


def cavity(T):
    """A basis of the flows without divergence: a linear equation with constant coefficients."""
    L, D, b = operators()
    B = null_space(D)
    A, steady = B.T @ L @ B, -np.linalg.solve(B.T @ L @ B, B.T @ b)
    y = B @ (steady - expm(A * T) @ steady)
    return y, -np.linalg.solve(D @ D.T, D @ (L @ y + b))


REFERENCES = {"driven_circuit": (circuit, 3.0), "controlled_reactor": (reactor, 3.0), "stokes": (cavity, 0.5)}


@pytest.mark.parametrize("method", ["pherk6", "radau5"])
@pytest.mark.parametrize("name", REFERENCES)
def test_end_of_a_run(name, method):
    reduced, T = REFERENCES[name]
    y, z = reduced(T)
    sol = mbdae.solve(TEXTBOOK[name](), (0, T), method=method, rtol=1e-9, atol=1e-10)
    assert sol.ended, sol.message
    np.testing.assert_allclose(sol.y[-1], y, rtol=0, atol=2e-8)
    np.testing.assert_allclose(sol.z[-1], z, rtol=0, atol=2e-6)


def test_the_grid_of_the_cavity():
    """Stencils at single faces and cells, written out."""
    L, D, b = operators()
    h, m = 1 / N, N * (N - 1)
    u = lambda i, j: j * (N - 1) + i - 1  # noqa: E731  (face between cells i - 1 and i of row j)
    v = lambda i, j: m + (j - 1) * N + i  # noqa: E731
    cell = D[1 * N + 2] * h
    assert {k: x for k, x in enumerate(cell) if x} == {u(3, 1): 1, u(2, 1): -1, v(2, 2): 1, v(2, 1): -1}
    inner = L[u(2, 1)] * h**2 / VISCOSITY
    assert {k: x for k, x in enumerate(inner) if x} == pytest.approx(
        {u(2, 1): -4, u(1, 1): 1, u(3, 1): 1, u(2, 0): 1, u(2, 2): 1}
    )
    assert L[u(2, N - 1), u(2, N - 1)] * h**2 / VISCOSITY == pytest.approx(-5)  # the lid is half a cell away
    assert b[u(2, N - 1)] * h**2 / VISCOSITY == pytest.approx(2 * LID)
    assert np.count_nonzero(b) == N - 1
    np.testing.assert_array_equal(L, L.T)
    assert np.linalg.eigvalsh(L).max() < 0
