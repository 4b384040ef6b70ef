"""Stokes flow in a square cavity with a moving lid, semi-discrete in space; pressures are the multipliers."""

import numpy as np

from ...system import Array
from ..hessenberg import Hessenberg

__all__ = ["stokes"]

N = 4  # cells in each direction
VISCOSITY, LID = 0.1, 1.0


def second_difference(n: int, ends: float) -> Array:
    """Return the matrix of second differences (n, n); ``ends`` is the first and last diagonal entry."""
    out = np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1) - 2 * np.eye(n)
    out[0, 0] = out[-1, -1] = ends
    return out


def operators() -> tuple[Array, Array, Array]:
    """Return viscosity times Laplacian (ny, ny), divergence in all cells but the last (nz, ny), lid shear (ny,)."""
    along, across = second_difference(N - 1, -2.0), second_difference(N, -3.0)  # across, walls are at half a cell
    u = np.kron(np.eye(N), along) + np.kron(across, np.eye(N - 1))  # u: rows of N - 1 inner faces
    v = np.kron(along, np.eye(N)) + np.kron(np.eye(N - 1), across)  # v: N - 1 rows of inner faces
    zero = np.zeros((len(u), len(v)))
    step = np.eye(N, N - 1) - np.eye(N, N - 1, -1)
    divergence = N * np.hstack([np.kron(np.eye(N), step), np.kron(step, np.eye(N))])
    lid = np.zeros(len(u) + len(v))
    lid[len(u) - (N - 1) : len(u)] = 2 * LID * N**2 * VISCOSITY
    return VISCOSITY * N**2 * np.block([[u, zero], [zero.T, v]]), divergence[:-1], lid


def stokes() -> Hessenberg:
    """Velocities y on the faces of a staggered grid of N x N cells, and pressures z in all cells but the last.

        y' = L y + D^T z + b,   0 = D y

    L is the viscosity times the Laplacian with walls at rest, b the shear by the lid, whose speed is 1, D the
    divergence, -D^T the gradient. The fluid is at rest at the start. The pressure of the last cell is 0, since only
    pressure differences matter.
    Source: F. H. Harlow, J. E. Welch, Phys. Fluids 8 (1965), for the grid.
    """
    L, D, b = operators()
    z0 = -np.linalg.solve(D @ D.T, D @ b)
    return Hessenberg(
        f=lambda t, y, z: L @ y + z @ D + b,
        g=lambda t, y: D @ y,
        g_y=lambda t, y: D,
        f_z=lambda t, y, z: D.T,
        g_t=lambda t, y: np.zeros(len(D)),
        f_y=lambda t, y, z: L,
        y0=tuple(np.zeros(len(L))),
        z0=tuple(z0),
        name="stokes",
        title="Stokes flow in a cavity",
        duration=1.0,
    )
