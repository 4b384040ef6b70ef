"""The numbers of the rod as published, with their quirks, and rod.npz: python rod.py.

Modes: sin(k pi x) across, k = 1, 2; 4 x (1 - x) and x (2 x - 1) along, x in lengths of the rod. Quirks that are kept:
pi = 3.1415927, masses of the longitudinal modes rho b h L (8, 1; 1, 2) without 1/15, no factor of Poisson.
"""

from pathlib import Path

import numpy as np
from scipy.linalg import eigh

import mbdae
from mbdae.mechanism.flexible.modal_body import Node

PI, ROD = 3.1415927, 0.3
WIDTH, DENSITY, MODULUS = 0.008, 7870.0, 0.2e12


def node(x, T):
    """Return the node at x, in lengths of the rod: displacements along and across, and the rotation."""
    across = [np.sin(k * PI * x) if x < 1 else 0.0 for k in (1, 2)]
    turns = [k * PI / ROD * np.cos(k * PI * x) if x < 1 else 0.0 for k in (1, 2)]
    Phi = np.array([[0, 0, 4 * x * (1 - x), x * (2 * x - 1)], [*across, 0, 0], [0] * 4])
    return Node(np.array([x * ROD, 0, 0]), Phi @ T, np.array([[0] * 4, [0] * 4, [*turns, 0, 0]]) @ T)


def rod(damping):
    """The rod in its eigenmodes, and the matrix T of q = T eta: sines, and longitudinal 4 x (1 - x), x (2 x - 1)."""
    m, k = DENSITY * WIDTH**2 * ROD, MODULUS * WIDTH**2 / ROD
    bend = k * PI**4 / 24 * (WIDTH / ROD) ** 2
    M = m * np.array([[0.5, 0, 0, 0], [0, 0.5, 0, 0], [0, 0, 8, 1], [0, 0, 1, 2]])
    K = np.diag([bend, 16 * bend, 0, 0])
    K[2:, 2:] = k / 3 * np.array([[16, -8], [-8, 7]])
    C, H0, cross = np.zeros((3, 4)), np.zeros((3, 4)), np.zeros((4, 3, 4))
    C[0], C[1] = m * np.array([0, 0, 2 / 3, 1 / 6]), m * np.array([2 / PI, 0, 0, 0])
    H0[2] = m * ROD * np.array([1 / PI, -0.5 / PI, 0, 0])
    for (i, j), value in {(0, 2): -16 / PI**3, (0, 3): 8 / PI**3 - 1 / PI, (1, 3): 0.5 / PI}.items():
        cross[i, 2, j], cross[j, 2, i] = m * value, -m * value
    about_z = np.diag([0.0, 0.0, 1.0])
    I1 = np.multiply.outer(2 * m * ROD * np.array([0, 0, 1 / 3, 1 / 6]), about_z)
    I2 = np.multiply.outer(2 * M, about_z)
    squares, T = eigh(K, M)
    nodes = {name: node(x, T) for name, x in {"quarter": 0.25, "middle": 0.5, "pin": 1.0}.items()}
    mass, inertia = 0.151104, 0.0045339259
    body = mbdae.ModalBody(
        mass, mass * np.array([ROD / 2, 0, 0]), inertia * np.diag([0.0, 1, 1]), C @ T, H0 @ T, T.T @ M @ T,
        np.einsum("iaj,il,jm->lam", cross, T, T), np.einsum("iab,il->lab", I1, T),
        np.einsum("ijab,il,jm->lmab", I2, T, T), squares, 2 * np.array(damping) * np.sqrt(squares), nodes,
    )  # fmt: skip
    return body, T


if __name__ == "__main__":
    mbdae.save_modal_body(rod((0.0,) * 4)[0], Path(__file__).with_name("rod.npz"))
