"""Fekete points: particles on a sphere that repel each other, from the test set for initial value problem solvers."""

import numpy as np

from ...system import Array
from ..hessenberg import Hessenberg

__all__ = ["fekete"]

N = 20
CIRCLES = ((1, 3, 1 / 13, 3 / 8), (1, 7, 1 / 29, 1 / 8), (1, 6, 1 / 7, -2 / 15), (0, 4, 1 / 17, -3 / 10))
EXCLUDE_SELF = np.diag(np.full(N, np.inf))
COMPONENT, PARTICLE = np.arange(3 * N), np.repeat(np.arange(N), 3)


def start() -> Array:
    """Return positions (20, 3) on circles of latitude, each given by first index, count, angle and latitude over pi."""
    angles = [(2 * i / n + offset, b) for first, n, offset, b in CIRCLES for i in range(first, first + n)]
    a, b = np.pi * np.array(angles).T
    return np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)], axis=1)


def differences(p: Array) -> tuple[Array, Array]:
    """Return d_ij = p_i - p_j (20, 20, 3) and 1/|d_ij|^2 (20, 20), zero where i = j."""
    d = p[:, None] - p
    return d, 1 / (np.einsum("ijk,ijk->ij", d, d) + EXCLUDE_SELF)


def repulsion(p: Array) -> Array:
    """Return sum_j d_ij/|d_ij|^2, (20, 3)."""
    d, weights = differences(p)
    return np.einsum("ijk,ij->ik", d, weights)


def split(y: Array) -> tuple[Array, Array]:
    """Return positions p and velocities q, (20, 3) each."""
    return y[: 3 * N].reshape(N, 3), y[3 * N :].reshape(N, 3)


def f(t: float, y: Array, z: Array) -> Array:
    """Return p' and q', (120,)."""
    (p, q), lam, mu = split(y), z[:N, None], z[N:, None]
    return np.concatenate([(q + 2 * mu * p).ravel(), (repulsion(p) - 0.5 * q + 2 * lam * p).ravel()])


def f_y(t: float, y: Array, z: Array) -> Array:
    """Return the partial derivatives of f, (120, 120)."""
    d, weights = differences(y[: 3 * N].reshape(N, 3))
    partials = 2 * np.einsum("ijk,ijl,ij->ikjl", d, d, weights**2) - np.einsum("ij,kl->ikjl", weights, np.eye(3))
    partials[np.arange(N), :, np.arange(N)] = -partials.sum(axis=2)
    out = np.kron([[0.0, 1.0], [0.0, -0.5]], np.eye(3 * N))
    out[COMPONENT, COMPONENT] = 2 * z[N + PARTICLE]
    out[3 * N :, : 3 * N] = partials.reshape(3 * N, 3 * N) + np.diag(2 * z[PARTICLE])
    return out


def g(t: float, y: Array) -> Array:
    """Return |p_i|^2 - 1 and 2 p_i . q_i, (40,)."""
    p, q = split(y)
    return np.concatenate([(p * p).sum(axis=1) - 1, 2 * (p * q).sum(axis=1)])


def g_y(t: float, y: Array) -> Array:
    """Return the partial derivatives of g, (40, 120)."""
    p, q = split(y)
    out = np.zeros((2 * N, 6 * N))
    out[PARTICLE, COMPONENT] = out[N + PARTICLE, 3 * N + COMPONENT] = 2 * p.ravel()
    out[N + PARTICLE, COMPONENT] = 2 * q.ravel()
    return out


def f_z(t: float, y: Array, z: Array) -> Array:
    """Return the partial derivatives of f with respect to z, (120, 40)."""
    out = np.zeros((6 * N, 2 * N))
    out[COMPONENT, N + PARTICLE] = out[3 * N + COMPONENT, PARTICLE] = 2 * y[: 3 * N]
    return out


def fekete() -> Hessenberg:
    """Twenty particles on the unit sphere, with friction: positions, velocities, (120,), and lam, mu, (40,).

        p_i' = q_i + 2 mu_i p_i,   q_i' = -q_i/2 + 2 lam_i p_i + sum_j (p_i - p_j)/|p_i - p_j|^2,
        0 = |p_i|^2 - 1,   0 = 2 p_i . q_i

    At rest all lam_i are -(20 - 1)/4, and the positions maximize the product of all distances (Fekete).

    Source: F. Mazzia, C. Magherini, Test Set for Initial Value Problem Solvers, release 2.4 (2008), II-17; P. M.
    Pardalos, An open global optimization problem on the unit sphere, J. Global Optim. 6 (1995).
    """
    p = start()
    lam = -(p * repulsion(p)).sum(axis=1) / 2
    return Hessenberg(
        f=f,
        g=g,
        y0=(*p.ravel().tolist(), *(0.0,) * (3 * N)),
        z0=(*lam.tolist(), *(0.0,) * N),
        g_y=g_y,
        f_z=f_z,
        g_t=lambda t, y: np.zeros(2 * N),
        f_y=f_y,
        name="fekete",
        title="Fekete points",
    )
