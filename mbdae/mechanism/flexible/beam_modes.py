"""Modes of a straight beam by direction: elements with shear, for EI = rho A = 1.

With phi = 12 EI/(k l^2), s = x/l in (0, 1) and (v_1, theta_1, v_2, theta_2) of an element of length l,

    (1 + phi) v     = (1 - 3 s^2 + 2 s^3 + phi (1 - s)) v_1 + (s - 2 s^2 + s^3 + phi (s - s^2)/2) l theta_1 + ..
    (1 + phi) theta = 6 (s^2 - s) v_1/l + (1 - 4 s + 3 s^2 + phi (1 - s)) theta_1 + ..

which is the exact deflection by forces at the ends; without shear, phi = 0, theta = v'.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...discovery import lazy_import
from ...errors import InputError
from ...system import Array
from ...tolerances import RANK

eigh = lazy_import("scipy.linalg", "eigh")

GAUSS_POINTS = 4  # per element: products of cubic polynomials have degree 6
DIRECTIONS = "xyz"
ENDS = {  # displacements u, v, w and rotations about y, z that vanish at the left and at the right end
    "clamped": ("uvwyz", ""),
    "pinned": ("uvw", "vw"),
    "clamped-clamped": ("uvwyz", "uvwyz"),
    "clamped-pinned": ("uvwyz", "vw"),
}
ROTATION_AXES = {"y": "z", "z": "y"}  # rotation axis of bending in each direction
COORDINATES = {"x": "u", "y": "vz", "z": "wy"}  # displacement and rotation of a node, by direction


class Elements:
    """Elements of equal length along a beam, and their Gauss points."""

    def __init__(self, length: float, elements: int) -> None:
        self.length, self.elements, self.size = length, elements, length / elements
        self.x = np.linspace(0, length, elements + 1)
        s, w = np.polynomial.legendre.leggauss(GAUSS_POINTS)
        self.s, self.w = (1 + s) / 2, w * self.size / 2

    def gauss(self) -> list[tuple[int, float, float]]:
        """Return element, position in it and weight in m of each Gauss point."""
        return [(e, s, w) for e in range(self.elements) for s, w in zip(self.s.tolist(), self.w.tolist(), strict=True)]

    def node(self, x: float, name: str) -> tuple[int, float]:
        """Return the element and the position in it of an end of an element.

        Raises:
            InputError: for a position inside an element.
        """
        i = int(np.abs(self.x - x).argmin())
        if not np.isclose(self.x[i], x, atol=0.0 if i else self.size * np.finfo(float).eps):
            ends = ", ".join(f"{a:.6g}" for a in self.x)
            raise InputError(f"beam: node {name!r} at {x} m is not at an end of an element: {ends}")
        return (i, 0.0) if i < self.elements else (i - 1, 1.0)


class Direction:
    """Deflection of a beam in one direction.

    Args:
        grid: the elements.
        axis: x (stretching), y or z (bending).
        ends: displacements that the frame prevents.
        scale: EI/(rho A), or E/rho of stretching, in m^4/s^2 or m^2/s^2.
        shear: EI/k in m^2, 0 without shear.
        gyration: I/A in m^2 of cross-sections with rotary inertia, 0 without it.
    """

    def __init__(
        self, grid: Elements, axis: str, ends: str, scale: float, shear: float = 0.0, gyration: float = 0.0
    ) -> None:
        self.grid, self.axis, self.scale, self.shear, self.gyration = grid, axis, scale, shear, gyration
        names = COORDINATES[axis]
        self.width = len(names)
        fixed = dict(zip((0, grid.elements), ENDS[ends], strict=True))
        n = np.arange(self.width * (grid.elements + 1))
        is_free = [names[i % self.width] not in fixed.get(i // self.width, "") for i in n.tolist()]
        self.free_coordinates, self.free = n[is_free], int(sum(is_free))

    def rows(self, e: int, s: float) -> Array:
        """Return v, theta, v', theta' (stretching: u, 0, u', 0) at s in (0, 1) of an element as rows, (4, n)."""
        out, h = np.zeros((4, self.width * (self.grid.elements + 1))), self.grid.size
        if self.axis == "x":
            out[[0, 2], e], out[[0, 2], e + 1] = (1 - s, -1 / h), (s, 1 / h)
            return out
        phi = 12 * self.shear / h**2
        values = [
            [1 - 3 * s**2 + 2 * s**3 + phi * (1 - s), h * (s - 2 * s**2 + s**3 + phi * (s - s**2) / 2)],
            [6 * (s**2 - s) / h, 1 - 4 * s + 3 * s**2 + phi * (1 - s)],
            [(6 * s**2 - 6 * s - phi) / h, 1 - 4 * s + 3 * s**2 + phi * (1 - 2 * s) / 2],
            [6 * (2 * s - 1) / h**2, (6 * s - 4 - phi) / h],
        ]
        right = [
            [3 * s**2 - 2 * s**3 + phi * s, h * (s**3 - s**2 - phi * (s - s**2) / 2)],
            [-values[1][0], 3 * s**2 - 2 * s + phi * s],
            [-values[2][0], 3 * s**2 - 2 * s - phi * (1 - 2 * s) / 2],
            [-values[3][0], (6 * s - 2 + phi) / h],
        ]
        out[:, 2 * e : 2 * e + 4] = np.hstack([values, right]) / (1 + phi)
        return out

    def _pencil(self) -> tuple[Array, Array]:
        """Return stiffness and mass matrices of the free coordinates."""
        n = self.width * (self.grid.elements + 1)
        K, M = np.zeros((2, n, n))
        for e, s, w in self.grid.gauss():
            v, theta, dv, dtheta = self.rows(e, s)
            strain = dv if self.axis == "x" else dtheta
            K += w * np.outer(strain, strain)
            if self.shear:
                K += w / self.shear * np.outer(dv - theta, dv - theta)
            M += w * (np.outer(v, v) + self.gyration * np.outer(theta, theta))
        at = np.ix_(self.free_coordinates, self.free_coordinates)
        return K[at], M[at]

    def weight(self) -> Array:
        """Return the load of the weight on all coordinates, (n,)."""
        return np.sum([w * self.rows(e, s)[0] for e, s, w in self.grid.gauss()], axis=0)

    def normal_modes(self, k: int) -> tuple[Array, Array]:
        """Return squares of natural frequencies (k,) in rad^2/s^2, ascending, and modes (n, k) of mean square 1."""
        K, M = self._pencil()
        last = len(K) - k, len(K) - 1  # the largest eigenvalues of the inverse problem are the most accurate
        inverse, shapes = eigh(M, K, subset_by_index=last)
        return self._scaled(inverse, shapes)

    def with_loads(self, squares: Array, U: Array, loads: Mapping[str, Array]) -> tuple[Array, Array]:
        """Return squares (k + l,) and modes (n, k + l) of the span of k modes and of deflections under l loads (n,).

        Raises:
            InputError: for a load whose deflection is in the span of modes and other loads, or zero.
        """
        K, M = self._pencil()
        basis = U[self.free_coordinates]
        for load, f in loads.items():
            static = np.linalg.solve(K, f[self.free_coordinates])
            size = np.sqrt(static @ M @ static)
            for _ in range(2):  # the second pass removes rounding errors
                static -= basis @ (basis.T @ (M @ static)) / self.grid.length
            remainder = np.sqrt(static @ M @ static)
            if not remainder > RANK * size:
                raise InputError(f"beam: the modes and other loads already represent {load!r}: leave it out")
            basis = np.column_stack([basis, static * np.sqrt(self.grid.length) / remainder])
        inverse, x = eigh(basis.T @ M @ basis, basis.T @ K @ basis)
        return self._scaled(inverse, basis @ x)

    def _scaled(self, inverse: Array, shapes: Array) -> tuple[Array, Array]:
        U = np.zeros((self.width * (self.grid.elements + 1), len(inverse)))
        U[self.free_coordinates] = shapes[:, ::-1] * np.sqrt(self.grid.length / inverse[::-1])
        rise = self.rows(0, self.grid.s[0])[0] @ U  # left of the first zero of each mode
        return self.scale / inverse[::-1], U * np.where(rise < 0, -1.0, 1.0)


@dataclass(frozen=True)
class Shapes:
    """Modes of all directions.

    Attributes:
        grid: the elements.
        squares: squares of the natural frequencies in rad^2/s^2, ascending, (k,).
        by_direction: directions and their modes (n, k), with zeros in the columns of modes of other directions.
    """

    grid: Elements
    squares: Array
    by_direction: tuple[tuple[Direction, Array], ...]

    @classmethod
    def of(cls, directions: Sequence[Direction], columns: Sequence[tuple[Array, Array]]) -> "Shapes":
        """Return the modes of directions by frequency, from squares and modes of each direction."""
        squares = np.concatenate([x for x, _ in columns])
        order, first, by_direction = np.argsort(squares, kind="stable"), 0, []
        for d, (x, U) in zip(directions, columns, strict=True):
            padded = np.zeros((len(U), len(squares)))
            padded[:, first : first + len(x)] = U
            by_direction.append((d, padded[:, order]))
            first += len(x)
        return cls(directions[0].grid, squares[order], tuple(by_direction))

    def at(self, e: int, s: float) -> tuple[Array, Array, Array]:
        """Return displacements and rotations of the cross-section, and u', theta' along y and z, (3, k) each."""
        displacements, rotations, strains = np.zeros((3, 3, len(self.squares)))
        for d, U in self.by_direction:
            v, theta, dv, dtheta = d.rows(e, s) @ U
            i = DIRECTIONS.index(d.axis)
            displacements[i], strains[i] = v, dv if d.axis == "x" else dtheta
            if d.axis != "x":
                rotations[3 - i] = theta if d.axis == "y" else -theta
        return displacements, rotations, strains

    def points(self, per_length: float, gyration: Mapping[str, float]) -> tuple[Array, Array, Array]:
        """Return points (n, 3), their masses (n,) and displacements (n, 3, k).

        The points are the Gauss points, or with rotary inertia pairs about them whose second moments are those of the
        section.
        """
        offsets = [sign * np.sqrt(x * len(gyration)) * np.eye(3)[DIRECTIONS.index(axis)]
                   for axis, x in gyration.items() for sign in (1, -1)] or [np.zeros(3)]  # fmt: skip
        r, m, Phi = [], [], []
        for e, s, w in self.grid.gauss():
            displacements, rotations, _ = self.at(e, s)
            for offset in offsets:
                r.append(np.array([self.grid.x[e] + s * self.grid.size, 0.0, 0.0]) + offset)
                m.append(w * per_length / len(offsets))
                Phi.append(displacements + np.cross(rotations.T, offset).T)
        return np.array(r), np.array(m), np.array(Phi)

    def shortening_at_points(self, n: int) -> Array:
        """Return the negative integrals of v_i' v_j' up to the Gauss points, along x, (n, 3, k, k)."""
        found = [self.shortening(e, s) for e, s, _ in self.grid.gauss()]
        return np.repeat(np.array(found), n // len(found), axis=0)

    def shortening(self, e: int, s: float) -> Array:
        """Return the negative integrals of v_i' v_j' from the left end to s in an element, along x, (3, k, k)."""
        out = np.zeros((3, *self._shortening_before[0].shape))
        out[0] = -self._shortening_before[e] - self._integral(e, s)
        return out

    @cached_property
    def _shortening_before(self) -> Array:
        """Integrals from the left end to each element, (elements + 1, k, k)."""
        per_element = np.array([self._integral(e, 1.0) for e in range(self.grid.elements)])
        return np.concatenate([np.zeros((1, *per_element.shape[1:])), np.cumsum(per_element, axis=0)])

    def _integral(self, e: int, end: float) -> Array:
        out = np.zeros((len(self.squares),) * 2)
        for a, b in zip(self.grid.s, self.grid.w, strict=True):
            for d, U in self.by_direction:
                if d.axis != "x":
                    gradient = d.rows(e, end * a)[2] @ U
                    out += b * end * np.outer(gradient, gradient)
        return out
