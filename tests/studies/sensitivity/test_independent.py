"""A second implementation: the planar four-bar linkage by hand, with complex steps through the half-explicit stages."""

import numpy as np
import pytest

import mbdae
from mbdae.methods import METHODS

STEP = 1e-30
LINKS = ("crank", "coupler", "rocker")


def numbers():
    """Masses, centres and moments of the links, their lengths, and the rocker's pivot, from the model's files."""
    model = mbdae.load("four_bar").model
    at = [model.getJointId(name) for name in LINKS]
    inertias = [model.inertias[j] for j in at]
    tips = [model.frames[model.getFrameId(f"{name}_tip")].placement.translation[0] for name in ("coupler", "rocker")]
    return {
        "mass": [i.mass for i in inertias],
        "com": [i.lever[0] for i in inertias],
        "moment": [i.inertia[1, 1] for i in inertias],
        "length": [model.jointPlacements[at[1]].translation[0], *tips],
        "ground": model.jointPlacements[at[2]].translation[0],
        "gravity": 9.81,
    }


def linkage(x):
    """M, f and G of the linkage; a link at angle a points along (cos a, sin a) in (x, z)."""
    turns = np.array([[1, 0, 0], [1, 1, 0], [0, 0, 1]])  # absolute angles of the links from q

    def point(parts, angles, v):
        """Jacobian and bias of a point that is a sum of lengths along links."""
        J, bias = np.zeros((2, 3), complex), np.zeros(2, complex)
        for size, link in parts:
            a, w = angles[link], turns[link] @ v
            J += size * np.outer([-np.sin(a), np.cos(a)], turns[link])
            bias += size * np.array([-np.cos(a), -np.sin(a)]) * w * w
        return J, bias

    def terms(q, v):
        a, M, f = turns @ q, np.zeros((3, 3), complex), np.zeros(3, complex)
        for i, before in enumerate(([], [(x["length"][0], 0)], [])):
            J, bias = point([*before, (x["com"][i], i)], a, v)
            M += x["mass"][i] * J.T @ J + x["moment"][i] * np.outer(turns[i], turns[i])
            f -= x["mass"][i] * J.T @ (bias + [0.0, x["gravity"]])
        return M, f

    def closure(q):
        """G of the gap between the tips in the axes of the coupler, which rotate: off the manifold that matters."""
        a, sizes = turns @ q, (x["length"][0], x["length"][1], -x["length"][2])
        along, across = (np.array([np.cos(a[1]), np.sin(a[1])]), np.array([-np.sin(a[1]), np.cos(a[1])]))
        gap = sum(size * np.array([np.cos(b), np.sin(b)]) for size, b in zip(sizes, a, strict=True))
        gap = gap - [x["ground"], 0.0]
        J, _ = point(list(zip(sizes, range(3), strict=True)), a, np.zeros(3))
        return np.array([along @ J + (across @ gap) * turns[1], across @ J - (along @ gap) * turns[1]])

    return terms, closure


def solve(A, b):
    return np.linalg.solve(A, b)


def run(x, method, q, v, h, n):
    """n steps of a half-explicit method; q and v at the end."""
    terms, closure = linkage(x)
    a, first = METHODS[method].arrays, METHODS[method].explicit_first

    def saddle(q, v, Ghat, rate):
        M, f = terms(q, v)
        G = closure(q)
        r = len(Ghat)
        whole = np.block([[M, -G.T], [Ghat, np.zeros((r, r))]])
        return solve(whole, np.concatenate([f, rate]))[:3]

    carry = saddle(q, v, closure(q), np.zeros(2))  # at rest gamma vanishes
    for _ in range(n):
        V, W = np.zeros((2, len(a.c), 3), complex)
        for i in range(len(a.c)):
            if first and i == 0:
                V[0], W[0] = v, carry
                continue
            V[i] = v + h * a.A[i] @ W
            qhat, vhat, factor = q + h * a.Ahat[i] @ V, v + h * a.Ahat[i, :i] @ W[:i], h * a.Ahat[i, i]
            Ghat = closure(qhat)
            W[i] = saddle(q + h * a.A[i] @ V, V[i], Ghat, -Ghat @ vhat / factor)
        q, v, carry = q + h * a.b @ V, v + h * a.b @ W, W[-1]
    return q, v


def varied(x, key, i):
    value = x[key]
    return {**x, key: [y + (1j * STEP if k == i else 0) for k, y in enumerate(value)]}


@pytest.mark.parametrize("method", ["herk4", "herk5", "pherk5", "pherk6", "arnold4"])
def test_complex_steps(method):
    x, mech, h, n = numbers(), mbdae.load("four_bar"), 0.04, 20
    q, v = mech.start
    sol = mbdae.solve(mech, (0.0, n * h), q, v, step=h, method=method)
    found = mbdae.sensitivity(
        sol, [f"joint.{LINKS[i]}.{key}" for i in range(3) for key in ("mass", "com.0", "inertia.1")]
    )
    known = run(x, method, q.astype(complex), v.astype(complex), h, n)
    np.testing.assert_allclose(sol.q[-1], known[0].real, rtol=0, atol=1e-12)
    column = 0
    for i in range(3):
        for key in ("mass", "com", "moment"):
            dq, dv = (a.imag / STEP for a in run(varied(x, key, i), method, q + 0j, v + 0j, h, n))
            size = max(np.abs(dq).max(), np.abs(dv).max(), 1.0)
            expected = np.concatenate([dq, dv])
            assert np.abs(expected).max() > 1e-2
            assert np.abs(found.dy[-1, :6, column] - expected).max() < 1e-12 * size, (key, i)
            column += 1
