"""A second implementation of Andrews' mechanism, from the published equations: complex steps through the stages."""

import mpmath
import numpy as np
import pytest
from test_examples import example

from mbdae.methods import METHODS

andrews = example("andrews_gradients")
NUMBERS = list(andrews.NUMBERS)


def met(machine, q):
    """G of the closures in the axes of their bodies, which rotate: off the manifold that matters."""
    g, G, _ = machine.closures(q, 0 * q)
    out = G.copy()
    for k, (_, _, turned) in enumerate(andrews.OTHERS):
        a = sum(q[i] for i in turned)
        c, s = machine.cos(a), machine.sin(a)
        (x, y), (Gx, Gy) = g[2 * k : 2 * k + 2], G[2 * k : 2 * k + 2]
        out[2 * k], out[2 * k + 1] = c * Gx + s * Gy, c * Gy - s * Gx
        for i in turned:
            out[2 * k, i] = out[2 * k, i] - s * x + c * y
            out[2 * k + 1, i] = out[2 * k + 1, i] - c * x - s * y
    return out


def run(machine, method, h, n):
    """n steps of a half-explicit method; q and v at the end, (7, m) each."""
    a, first = METHODS[method].arrays, METHODS[method].explicit_first
    q = machine.start()
    v, carry = 0 * q, machine.acceleration(q, 0 * q)
    A, Ahat, b = ([[h * float(x) for x in row] for row in table] for table in (a.A, a.Ahat, a.b[None]))

    def along(row, X):
        return sum((w * x for w, x in zip(row, X, strict=False) if w), 0 * q)

    for _ in range(n):
        V, W = [], []
        for i in range(len(a.c)):
            if first and i == 0:
                V, W = [v], [carry]
                continue
            at, rate = q + along(A[i], V), v + along(A[i], W)
            V.append(rate)
            Ghat = met(machine, q + along(Ahat[i], V))
            known = v + along(Ahat[i][:i], W)
            rhs = -(Ghat * known).sum(1) / Ahat[i][i]
            W.append(andrews.saddle(machine.mass(at), met(machine, at), Ghat, machine.force(at, rate), rhs))
        q, v, carry = q + along(b[0], V), v + along(b[0], W), W[-1]
    return q, v


def moved(names, number, step):
    """The published parameters as columns, each named one with an imaginary step."""
    p = {name: np.array([number(x)] * len(names)) for name, x in andrews.NUMBERS.items()}
    for k, name in enumerate(names):
        p[name][k] += step * number(1j)
    return p


FEW = ("ra", "e", "fa", "m5", "l0", "i7")


@pytest.mark.parametrize(
    ("method", "names"),
    [("pherk5", NUMBERS), ("herk4", FEW), ("herk5", FEW), ("pherk6", FEW), ("arnold4", FEW), ("hedop5", FEW)],
)
def test_the_same_steps(method, names):
    """All 42 derivatives, closures and start included."""
    h, n = 5e-4, 20
    q, v = run(andrews.Squeezer(moved(names, np.clongdouble, np.longdouble(andrews.STEP))), method, h, n)
    y, derivatives = andrews.computed(names, end=h * n, method=method, step=h)
    np.testing.assert_allclose(y, np.concatenate([q, v]).real[:, 0].astype(float), rtol=0, atol=1e-10)
    expected = (np.concatenate([q, v]).imag / andrews.STEP).astype(float)
    for part in (slice(0, 7), slice(7, 14)):
        size = np.abs(expected[part]).max(axis=0)
        assert (size > 0).all()
        assert (np.abs(derivatives[part] - expected[part]).max(axis=0) < 1e-12 * size).all()


@pytest.mark.slow
def test_thirty_digits():
    """The same code with 40 digits: the results of extended precision are right to rounding."""
    names = ["ss", "m5", "c0"]
    with mpmath.workdps(40):
        p = moved(names, mpmath.mpc, mpmath.mpf("1e-60"))
        sin, cos = np.frompyfunc(mpmath.sin, 1, 1), np.frompyfunc(mpmath.cos, 1, 1)
        found = np.concatenate(run(andrews.Squeezer(p, sin, cos), "herk4", 1e-4, 4))
        derivatives = np.array([[float(x.imag * mpmath.mpf("1e60")) for x in row] for row in found])
    q, v = run(andrews.Squeezer(moved(names, np.clongdouble, np.longdouble(andrews.STEP))), "herk4", 1e-4, 4)
    expected = (np.concatenate([q, v]).imag / andrews.STEP).astype(float)
    assert (np.abs(derivatives - expected) <= 1e-15 * np.abs(expected).max(axis=0)).all()


def test_the_printed_table():
    """Some of its columns, by another method than those that confirmed it."""
    rows = [line.split("|")[1:-1] for line in andrews.PAGE.read_text().splitlines() if line.startswith("|")]
    table = np.full((14, len(NUMBERS)), np.nan)
    for i, name in enumerate(NUMBERS):
        q, v = ([float(x) for x in row[1:]] for row in rows if row[0].strip() == name)
        table[:, i] = q + v
    assert np.isfinite(table).all()
    names = ["sd", "m7", "mom"]
    _, derivatives = andrews.computed(names, method="radau9", rtol=1e-9)
    known = table[:, [NUMBERS.index(name) for name in names]]
    np.testing.assert_allclose(derivatives, known, rtol=5e-8, atol=0)
