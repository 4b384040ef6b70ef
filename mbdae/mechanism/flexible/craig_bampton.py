"""Modal bodies from finite elements: Craig and Bampton's reduction, orthogonalized.

    u = [1 0; -Kii^-1 Kib, Phi] [u_b; eta],   Kii Phi = Mii Phi w^2

with interface displacements u_b and normal modes Phi of the body with fixed interfaces; the modes of the body are the
eigenvectors of the reduced pencil, with the mass of the body as modal mass: a coordinate is the root-mean-square
deflection of its mode in m.
Deflections under loads at interfaces are exact for any number of normal modes, and with Kii^-1 f those by the weight f.

Source: R. R. Craig, M. C. C. Bampton, Coupling of substructures for dynamic analyses, AIAA Journal 6 (1968).
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.linalg import eigh
from scipy.sparse import csc_array, csr_array, diags_array, hstack, issparse, kron
from scipy.sparse.linalg import eigsh, splu

from ...errors import InputError, UnknownNameError
from ...system import Array
from ...tolerances import HALF_DIGITS, RANK, SOLUTION_ROUNDING
from .checked_numbers import array, as_array, integer, require_loads, require_names
from .modal_body import ModalBody, Node

RIGID_MOTIONS = 6
WEIGHTS = {f"gravity {axis}": e for axis, e in zip("xyz", np.eye(3), strict=True)}


def modal_body(
    points: Any,
    masses: Any,
    K: Any,
    *,
    interface: Mapping[str, Sequence[int]],
    modes: int,
    clamped: str = "",
    damping: float | Sequence[float] = 0.0,
    loads: Sequence[str] = (),
) -> ModalBody:
    """Return a body of points with masses and a stiffness matrix as a modal body, by Craig and Bampton's reduction.

    Args:
        points: positions of n points in the frame of the body, (n, 3), in m.
        masses: masses of the points, (n,), in kg; or a mass matrix, (n, n), or (3n, 3n) of the displacements, dense or
            sparse, whose elements interpolate the three displacements by the same functions.
        K: stiffness by displacements x, y, z of the points in turn, (3n, 3n), dense or sparse, in N/m.
        interface: nodes by name, each a rigid set of points (indices) with its origin at their centroid; a node of a
            single point does not rotate with the modes. Together their points must prevent all rigid motions: they
            must not be on a line.
        modes: number of normal modes with fixed interfaces, in addition to the static modes of the interfaces.
        clamped: interface to which the frame of the body is fixed; if omitted, the frame floats with the free body.
        damping: damping ratio of each mode by frequency, including static modes and loads; or one ratio for all.
        loads: ``"gravity x"``, ``"gravity y"``, ..: loads by the weight whose deflections modes represent exactly.

    Raises:
        InputError: for wrong shapes, a K that is not symmetric or does not have exactly six rigid-body motions,
            masses that are not positive, a mass matrix that couples directions, interfaces on a line, too many normal
            modes, a repeated load, or negative damping.
        UnknownNameError: for an unknown clamped interface or load.
    """
    r = array(points, "modal_body: points", (len(points) if np.ndim(points) else 1, 3))
    m = _masses(masses, len(r))
    stiffness = _checked_stiffness(r, m, K, interface)
    if clamped and clamped not in interface:
        raise UnknownNameError("interface", clamped, interface)
    _require_rotations(r, interface, clamped)
    require_loads(loads, WEIGHTS)
    modes = integer(modes, "modal_body: modes", 0)
    T, boundary, inner = _coordinates(r, interface, clamped)
    Kr, Mr = csc_array(T.T @ stiffness @ T), csc_array(T.T @ kron(m, np.eye(3)) @ T)
    if modes + len(loads) >= max(len(inner), 1) and modes:
        got = f"modes = {modes}" + (f" and {len(loads)} loads" if loads else "")
        raise InputError(f"modal_body: {len(inner)} displacements between the interfaces, got {got}")
    point_masses = m.sum(axis=1)
    weights = T.T @ np.array([np.outer(point_masses, WEIGHTS[load]).ravel() for load in loads]).reshape(-1, r.size).T
    basis = _basis(Kr, Mr, boundary, inner, modes, weights)
    squares, shapes = eigh(basis.T @ (Kr @ basis), basis.T @ (Mr @ basis))
    elastic = squares > HALF_DIGITS * squares[-1]
    expected = 0 if clamped else RIGID_MOTIONS
    if (rigid := int(np.count_nonzero(~elastic))) != expected:
        found = f"{rigid} motions without elastic force, expected {expected}"
        raise InputError(f"modal_body: {found}: is K that of this body?")
    mass = float(m.sum())
    U = T @ (basis @ shapes[:, elastic]) * np.sqrt(mass)
    Phi = U.reshape(len(r), 3, -1)
    nodes = {name: _node(r, Phi, np.asarray(at, int)) for name, at in interface.items()}
    return ModalBody.of_points(r, m, Phi, mass * squares[elastic], damping, nodes)


def _masses(masses: Any, n: int) -> csr_array:
    """Return the mass matrix (n, n) of n points, from their masses or from a mass matrix of their displacements."""
    x = csr_array(masses) if issparse(masses) else as_array(masses)
    if x.ndim not in (1, 2):
        raise InputError(f"modal_body: masses need finite numbers of shape ({n},) or a matrix, got {masses!r:.60}")
    given = csr_array(diags_array(x) if x.ndim == 1 else x)
    m = given[::3, ::3] if given.shape == (3 * n, 3 * n) else given
    expanded = kron(m, np.eye(3)) if m is not given else m.T
    if m.shape == (n, n) and abs(given - expanded).max() > SOLUTION_ROUNDING * abs(given).max():
        reason = "is not symmetric" if m is given else "is not the same in x, y and z, or couples them"
        raise InputError(f"modal_body: the mass matrix {reason}")
    return m


def _checked_stiffness(r: Array, m: csr_array, K: Any, interface: Mapping[str, Sequence[int]]) -> csr_array:
    n, K = len(r), csr_array(K) if issparse(K) else as_array(K)
    if m.shape != (n, n) or K.shape != (3 * n, 3 * n):
        needed = f"shapes ({n}, 3), masses ({n},), ({n}, {n}) or ({3 * n}, {3 * n}), and K ({3 * n}, {3 * n})"
        raise InputError(f"modal_body: {n} points need {needed}; got {r.shape}, mass matrix {m.shape}, K {K.shape}")
    diagonal = m.diagonal()
    if not (diagonal > 0).all():
        i = int(diagonal.argmin())
        raise InputError(f"modal_body: masses must be positive, got {diagonal[i]:g} kg of point {i}")
    out = csr_array(K)
    size = abs(out).max()
    if not np.isfinite(size) or abs(out - out.T).max() > SOLUTION_ROUNDING * size:
        raise InputError("modal_body: K is not symmetric and finite")
    _require_points(interface, n)
    return out


def _require_points(interface: Mapping[str, Sequence[int]], n: int) -> None:
    """Reject interfaces that are not different points out of n."""
    if not isinstance(interface, Mapping):
        raise InputError(f"modal_body: interfaces must be lists of points by name, got {interface!r:.60}")
    require_names(list(interface), "modal_body: interface")
    used = [i for at in interface.values() for i in (at if np.ndim(at) else [at])]
    if not all(isinstance(i, int | np.integer) and 0 <= i < n for i in used) or len(set(used)) < len(used):
        raise InputError(f"modal_body: interfaces must be different points 0 to {n - 1}, got {used!r:.60}")
    if not all(np.size(at) for at in interface.values()):
        raise InputError("modal_body: an interface needs at least one point")


def _require_rotations(r: Array, interface: Mapping[str, Sequence[int]], clamped: str) -> None:
    """Reject interfaces whose points do not determine a rotation, and points that do not prevent rigid motions."""
    for name, at in interface.items():
        if len(at) == 1 and name != clamped:
            continue
        if len(at) < 3 or _are_on_a_line(r[list(at)]):
            text = f"modal_body: the modes cannot rotate interface {name!r}, whose {len(at)} points are on a line"
            raise InputError(f"{text}; use three points that are not, or a single point that is not clamped")
    used = r[[i for at in interface.values() for i in at]]
    if len(used) < 3 or _are_on_a_line(used):
        text = f"the {len(used)} points of all interfaces do not constrain the body"
        raise InputError(f"modal_body: {text}: add a node of a point that is not on a line with them")


def _are_on_a_line(points: Array) -> bool:
    sizes = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(sizes[1] <= RANK * sizes[0])


def _coordinates(r: Array, interface: Mapping[str, Sequence[int]], clamped: str) -> tuple[csr_array, Array, Array]:
    """Return displacements (3n, c) per coordinate, of rigid interfaces first, then of points, and their indices."""
    columns: list[Array] = []
    free = np.ones(len(r), bool)
    for name, at in interface.items():
        free[list(at)] = False
        if name == clamped:
            continue
        block = np.zeros((3 * len(r), 3 if len(at) == 1 else 6))
        centre = r[list(at)].mean(axis=0)
        for i in at:
            motion = np.hstack([np.eye(3), -pin.skew(r[i] - centre)])
            block[3 * i : 3 * i + 3] = motion[:, : block.shape[1]]
        columns.append(block)
    inner, number = np.flatnonzero(np.repeat(free, 3)), sum(block.shape[1] for block in columns)
    points = csr_array((np.ones(len(inner)), (inner, np.arange(len(inner)))), (3 * len(r), len(inner)))
    displacements = csr_array(hstack([*(csr_array(block) for block in columns), points]))
    return displacements, np.arange(number), np.arange(number, number + len(inner))


def _basis(K: csc_array, M: csc_array, boundary: Array, inner: Array, modes: int, weights: Array) -> Array:
    """Return static modes of the interfaces, deflections under weights (c, l), and normal modes, (c, b + l + modes).

    Deflections and normal modes have fixed interfaces.
    """
    Kii, Mii = csc_array(K[inner][:, inner]), csc_array(M[inner][:, inner])
    loads = weights.shape[1] if len(inner) else 0
    out = np.zeros((K.shape[0], len(boundary) + loads + modes))
    out[boundary, : len(boundary)] = np.eye(len(boundary))
    normal = eigsh(Kii, modes, Mii, 0.0)[1] if modes else np.zeros((len(inner), 0))
    if len(inner):
        solve = splu(Kii).solve
        if len(boundary):
            out[inner, : len(boundary)] = -solve(K[inner][:, boundary].toarray())
        basis = normal
        for f in weights[inner].T:
            static = solve(f)
            size = np.sqrt(static @ (Mii @ static))
            for _ in range(2):  # the second pass removes rounding errors
                static -= basis @ (basis.T @ (Mii @ static))
            if not np.sqrt(static @ (Mii @ static)) > RANK * size:
                raise InputError("modal_body: a load deflects the body as modes or other loads do: leave it out")
            basis = np.column_stack([basis, static / np.sqrt(static @ (Mii @ static))])
        out[inner[:, None], np.arange(len(boundary), out.shape[1])] = basis
    return out


def _node(r: Array, Phi: Array, at: Array) -> Node:
    """Return the node of a rigid interface at its centroid."""
    centre = r[at].mean(axis=0)
    A = np.concatenate([np.hstack([np.eye(3), -pin.skew(r[i] - centre)]) for i in at])
    if len(at) == 1:
        return Node(centre, Phi[at[0]], np.zeros_like(Phi[at[0]]))
    motion = np.linalg.lstsq(A, Phi[at].reshape(3 * len(at), -1), rcond=None)[0]
    return Node(centre, motion[:3], motion[3:])
