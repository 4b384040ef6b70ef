"""Straight beams of Euler and Bernoulli: Hermite elements, consistent mass at Gauss points, modes of the free pencil.

    EI w'''' + rho A w_tt = 0 in both planes, EA u'' = rho A u_tt, GJ phi'' = rho Ip phi_tt

along x of the body's frame, from its origin to (length, 0, 0). Rotary inertia of cross-sections counts about x alone.
"""

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from scipy.linalg import eigh

from ...errors import InputError, UnknownNameError
from ...system import Array
from .modal_body import ModalBody, Node

GAUSS_POINTS = 4  # an element: products of cubic polynomials have degree 6
ENDS = {  # displacements u, v, w and rotations about y, z that vanish at the left and at the right end
    "clamped": ("uvwyzx", ""),
    "pinned": ("uvwx", "vw"),
    "clamped-clamped": ("uvwyzx", "uvwyzx"),
    "clamped-pinned": ("uvwyzx", "vw"),
}
BENDING = {
    "y": ("v", "z", 1.0),
    "z": ("w", "y", -1.0),
}  # displacement, rotation, and its sign where that rises
Plane = Literal["y", "z", "space"]
EndCondition = Literal["clamped", "pinned", "clamped-clamped", "clamped-pinned"]


def beam(  # noqa: PLR0913 - the numbers of a beam
    length: float,
    young: float,
    density: float,
    area: float,
    second_moment: float | tuple[float, float],
    *,
    modes: int = 4,
    elements: int = 8,
    ends: EndCondition = "clamped",
    plane: Plane = "y",
    axial: bool = False,
    damping: float | Sequence[float] = 0.0,
    polar_moment: float = 0.0,
    stiffening: bool = True,
    nodes: Mapping[str, float] | None = None,
) -> ModalBody:
    """Return a straight beam as a modal body with its lowest modes, mass-normalised, which rise next to the left end.

    Args:
        length: m, along x from the origin of the frame.
        young: modulus in N/m^2.
        density: kg/m^3.
        area: of the cross-section, in m^2.
        second_moment: of area for bending along y, and along z if it differs, in m^4.
        modes: their number.
        elements: number of elements of equal length.
        ends: displacements that the frame prevents at the left and at the right end: ``"clamped"`` (a cantilever),
            ``"pinned"`` (the frame is the chord between both), ``"clamped-clamped"`` or ``"clamped-pinned"``.
        plane: bending along ``"y"``, along ``"z"``, or both, ``"space"``.
        axial: whether the beam also stretches.
        damping: ratio of each mode, or one for all.
        polar_moment: second moment of area about x in m^4; without it a beam has no inertia about its axis.
        stiffening: whether bending shortens the beam along x, by the integral of w'^2 / 2: tension then stiffens it,
            and compression makes it buckle.
        nodes: names of nodes and their positions along x in m, at ends of elements; A and B at both
            ends if omitted.

    Raises:
        InputError: for values that are not positive, more modes than the elements have, or a node between them.
        UnknownNameError: for other ends or another plane.
    """
    numbers = {"length": length, "young": young, "density": density, "area": area, "modes": modes, "elements": elements}
    pair = second_moment if isinstance(second_moment, tuple | list) else (second_moment, second_moment)
    for name, value in (*numbers.items(), ("second_moment", min(pair))):
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"beam: {name} needs a positive number, got {value}")
    for name, given, known in (("ends", ends, ENDS), ("plane", plane, (*BENDING, "space"))):
        if given not in known:
            raise UnknownNameError(name, given, known)
    planes = tuple(BENDING) if plane == "space" else (plane,)
    moments = {axis: value for axis, value in zip(BENDING, pair, strict=True) if axis in planes}
    grid = _Grid(length, elements, moments, axial)
    left, right = ENDS[ends]
    free = grid.free(left, right)
    if modes > len(free):
        raise InputError(f"beam: {elements} elements have {len(free)} modes with these ends, got modes = {modes}")
    K, M = grid.stiffness(young, area), grid.mass(density * area)
    last = len(free) - modes, len(free) - 1  # the largest eigenvalues of the inverse pencil are the most accurate
    inverse, shapes = eigh(M[np.ix_(free, free)], K[np.ix_(free, free)], subset_by_index=last)
    squares = 1 / inverse[::-1]
    U = np.zeros((len(K), modes))
    U[free] = shapes[:, ::-1] * np.sqrt(squares)
    U *= np.where(grid.first_rise(U) < 0, -1.0, 1.0)
    found = {name: grid.node(x, U, name, stiffening) for name, x in (nodes or {"A": 0.0, "B": length}).items()}
    r, masses, Phi = grid.points(U, density * area)
    Phi2 = np.array([grid.shortening(e, s, U) for e, s, _ in grid.gauss()]) if stiffening else None
    body = ModalBody.of_points(r, masses, Phi, squares, damping, found, Phi2)
    body.I0[0, 0] += density * polar_moment * length
    return body


class _Grid:
    """Nodes and elements of a beam; the coordinates of a node are those directions that its modes have."""

    def __init__(self, length: float, elements: int, moments: Mapping[str, float], axial: bool) -> None:
        self.x, self.size = np.linspace(0, length, elements + 1), length / elements
        self.moments, self.axial = moments, axial
        self.directions = "u" * axial + "".join(BENDING[axis][0] + BENDING[axis][1] for axis in moments)

    def index(self, node: int, direction: str) -> int:
        return node * len(self.directions) + self.directions.index(direction)

    def free(self, left: str, right: str) -> list[int]:
        """Return the coordinates that do not vanish at the ends."""
        fixed = {0: left, len(self.x) - 1: right}
        nodes = range(len(self.x))
        return [self.index(n, d) for n in nodes for d in self.directions if d not in fixed.get(n, "")]

    def shapes(self, e: int, s: float, order: int = 0) -> tuple[Array, Array]:
        """Return displacements, and their derivatives by x, at s in (0, 1) of an element, (3, n): rows of x, y and z.

        With ``order = 1``: first and second derivatives, for strains and curvatures.
        """
        size, out = self.size, np.zeros((2, 3, len(self.x) * len(self.directions)))
        hermite = np.polynomial.Polynomial
        cubic = [hermite(c) for c in ((1, 0, -3, 2), (0, 1, -2, 1), (0, 0, 3, -2), (0, 0, -1, 1))]
        for axis in self.moments:
            displacement, rotation, sign = BENDING[axis]
            at = [self.index(e + i, d) for i in (0, 1) for d in (displacement, rotation)]
            for i, (p, scale) in enumerate(zip(cubic, (1, sign * size, 1, sign * size), strict=True)):
                row = 1 + "yz".index(axis)
                for k in (0, 1):
                    d = p.deriv(k + order) if k + order else p
                    out[k, row, at[i]] = scale * d(s) / size ** (k + order)
        if self.axial:
            i, j = self.index(e, "u"), self.index(e + 1, "u")
            out[0, 0, [i, j]] = (1 - s, s) if order == 0 else (-1 / size, 1 / size) if order == 1 else (0, 0)
            out[1, 0, [i, j]] = (-1 / size, 1 / size) if order == 0 else (0, 0)
        return out[0], out[1]

    def gauss(self) -> list[tuple[int, float, float]]:
        """Return element, position in it and weight in m of each Gauss point."""
        s, w = np.polynomial.legendre.leggauss(GAUSS_POINTS)
        return [(e, (1 + a) / 2, b * self.size / 2) for e in range(len(self.x) - 1) for a, b in zip(s, w, strict=True)]

    def stiffness(self, young: float, area: float) -> Array:
        n = len(self.x) * len(self.directions)
        K = np.zeros((n, n))
        for e, s, w in self.gauss():
            strain, curvature = self.shapes(e, s, 1)
            for axis, moment in self.moments.items():
                row = curvature[1 + "yz".index(axis)]
                K += w * young * moment * np.outer(row, row)
            K += w * young * area * np.outer(strain[0], strain[0]) * self.axial
        return K

    def mass(self, per_length: float) -> Array:
        return sum(w * per_length * N.T @ N for e, s, w in self.gauss() for N in self.shapes(e, s)[:1])

    def points(self, U: Array, per_length: float) -> tuple[Array, Array, Array]:
        """Return Gauss points (n, 3), their masses (n,) and displacements (n, 3, k)."""
        found = self.gauss()
        r = np.array([[self.x[e] + s * self.size, 0, 0] for e, s, _ in found])
        return (
            r,
            np.array([w * per_length for *_, w in found]),
            np.array([self.shapes(e, s)[0] @ U for e, s, _ in found]),
        )

    def shortening(self, e: int, s: float, U: Array) -> Array:
        """Return minus the integrals of w_i' w_j' from the left end to s in an element, along x, (3, k, k)."""
        out, (at, weights) = np.zeros((3, U.shape[1], U.shape[1])), np.polynomial.legendre.leggauss(GAUSS_POINTS)
        for element, end in [*((i, 1.0) for i in range(e)), (e, s)]:
            for a, b in zip(at, weights, strict=True):
                gradients = self.shapes(element, end * (1 + a) / 2)[1][1:] @ U
                out[0] -= b * end * self.size / 2 * gradients.T @ gradients
        return out

    def node(self, x: float, U: Array, name: str, stiffening: bool) -> Node:
        """Return the node at x, the end of an element.

        Raises:
            InputError: for a position between the ends of elements.
        """
        i = int(np.abs(self.x - x).argmin())
        if not np.isclose(self.x[i], x, atol=0.0 if i else self.size * np.finfo(float).eps):
            ends = ", ".join(f"{a:.6g}" for a in self.x)
            raise InputError(f"beam: node {name!r} at {x} m is no end of an element: {ends}")
        e, s = (i, 0.0) if i < len(self.x) - 1 else (i - 1, 1.0)
        Phi, gradients = (N @ U for N in self.shapes(e, s))
        Psi = np.array([np.zeros(U.shape[1]), -gradients[2], gradients[1]])
        return Node(np.array([self.x[i], 0, 0]), Phi, Psi, self.shortening(e, s, U) if stiffening else None)

    def first_rise(self, U: Array) -> Array:
        """Return the largest displacement at the first Gauss point, with its sign, (k,)."""
        displacement = self.shapes(*self.gauss()[0][:2])[0] @ U
        return displacement[np.abs(displacement).argmax(axis=0), np.arange(U.shape[1])]
