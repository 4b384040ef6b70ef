"""A modal body: its inertia as polynomials in the modal coordinates, its elasticity, and its nodes.

Sums over points of mass m (nodes of a lumped model, or Gauss points of consistent elements), with S = s0 + C q:

    M(q) = [ m 1    -[S]x   C  ]     m, s0 = sum m r, C = sum m Phi, I0 = sum m (r.r 1 - r r^T)
           [ [S]x    I      H  ]     H0 = sum m [r]x Phi, Hj = sum m [Phi_j]x Phi, Mq = sum m Phi^T Phi
           [ C^T     H^T    Mq ]     I1_i = sum m (2 r.Phi_i 1 - r Phi_i^T - Phi_i r^T)
                                     I2_ij = sum m (2 Phi_i.Phi_j 1 - Phi_i Phi_j^T - Phi_j Phi_i^T)
    I = I0 + sum q_i I1_i + (sum q_i q_j I2_ij)/2,   H = H0 + sum q_j Hj

A displacement of second order (sum q_i q_j Phi2_ij)/2, such as the shortening of a beam by bending, makes C linear,
C + sum q_j C2_j with C2_ij = sum m Phi2_ij, and S = s0 + C q + (sum q_i q_j C2_ij)/2. It adds sum m [r]x Phi2_j to Hj
and sum m (2 r.Phi2_ij 1 - r Phi2_ij^T - Phi2_ij r^T) to I2_ij. Tension does work along it and so stiffens bending. All
blocks are of second order in q, since M might otherwise be indefinite where modes nearly span a rotation of the frame:

    H += (sum q_j q_l H2_jl)/2,   H2_i,jl = sum m (Phi2_jl x Phi_i + Phi_j x Phi2_il + Phi_l x Phi2_ij)
    Mq += sum q_l Mq1_l + (sum q_l q_n Mq2_ln)/2,   Mq1_ij,l = sum m (Phi_i.Phi2_jl + Phi_j.Phi2_il)
                                                    Mq2_ij,ln = sum m (Phi2_il.Phi2_jn + Phi2_in.Phi2_jl)

for nu = (v, w, q') of the frame in its axes. `delta` is M without the rigid body (m, s0, I0), which Pinocchio includes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ...data_types import CoreData
from ...errors import InputError
from ...system import Array
from ...tolerances import PIVOT_RANK, SUM_ROUNDING
from ..tree.frames import cross
from .checked_numbers import array, checked_points, damping_coefficients, require_nodes, require_symmetric
from .points import Node as Node
from .points import OutlinePoints

SECOND_ORDER = {"C2": "3kk", "H2": "3kkk", "Mq1": "kkk", "Mq2": "kkkk"}


class Deformation(NamedTuple):
    """The blocks of M at modal coordinates, polynomials of degree 1 or 2.

    Attributes:
        C, H, Mq: (3, k), (3, k), (k, k).
        I_q, H_q, Mq_q: derivatives of I, H and Mq with respect to q, (k, 3, 3), (k, 3, k), (k, k, k).
    """

    C: Array
    H: Array
    Mq: Array
    I_q: Array
    H_q: Array
    Mq_q: Array


@dataclass(frozen=True, eq=False)
class ModalBody:
    """A body with k modes.

    Attributes:
        mass: m in kg.
        s0, I0: first moment (3,) in kg m and inertia (3, 3) in kg m^2 of the undeformed body about its frame's origin.
        C, H0, Mq: (3, k), (3, k), (k, k).
        Hj, I1, I2: (k, 3, k), (k, 3, 3), (k, k, 3, 3).
        C2, H2, Mq1, Mq2: (3, k, k), (3, k, k, k), (k, k, k), (k, k, k, k), zero if omitted.
        stiffness, damping: coefficients of the elastic and damping forces -stiffness q - damping q', (k,).
        nodes: the nodes by name.
        outline: further points that determine size and deflection.
    """

    mass: float
    s0: Array
    I0: Array
    C: Array
    H0: Array
    Mq: Array
    Hj: Array
    I1: Array
    I2: Array
    stiffness: Array
    damping: Array
    nodes: Mapping[str, Node] = field(default_factory=dict)
    outline: OutlinePoints | None = None
    C2: Array | None = None
    H2: Array | None = None
    Mq1: Array | None = None
    Mq2: Array | None = None

    @property
    def modes(self) -> int:
        """Number of modes k."""
        return len(self.stiffness)

    @cached_property
    def frequencies(self) -> Array:
        """Natural frequencies of the modes in rad/s, with the frame at rest, (k,), if Mq is diagonal."""
        return np.sqrt(self.stiffness / np.diagonal(self.Mq))

    @property
    def size(self) -> float:
        """Largest distance in m between nodes, points of the outline and the frame's origin."""
        outline = () if self.outline is None else self.outline.r
        r = np.array([np.zeros(3), *(node.r for node in self.nodes.values()), *outline])
        return float(np.linalg.norm(r[:, None] - r, axis=2).max())

    def largest_motion(self, q: Array) -> tuple[float, float]:
        """Return the largest first-order deflection in m and rotation in rad of nodes and outline, at q (m, k)."""
        displacements, rotations = [x.Phi for x in self.nodes.values()], [x.Psi for x in self.nodes.values()]
        if self.outline is not None:
            displacements.extend(self.outline.Phi)
            rotations.extend(() if self.outline.Psi is None else self.outline.Psi)
        return _largest(q, displacements), _largest(q, rotations)

    def array(self, name: str) -> Array:
        """Return an array; zeros if it is omitted."""
        x = getattr(self, name)
        shape = SECOND_ORDER.get(name, "")
        return np.zeros([3 if c == "3" else self.modes for c in shape]) if x is None else np.asarray(x)

    @cached_property
    def second_order(self) -> list[Array]:
        """The arrays of `SECOND_ORDER`."""
        return [self.array(name) for name in SECOND_ORDER]

    def deformed(self, q: Array) -> Deformation:
        """Return the polynomials at q."""
        I_q, (C2, H2, Mq1, Mq2) = self.I1 + np.einsum("ijab,j->iab", self.I2, q), self.second_order
        H_q, Mq_q = self.Hj + (H2 @ q).transpose(2, 0, 1), (Mq1 + Mq2 @ q).transpose(2, 0, 1)
        H = self.H0 + np.einsum("jak,j->ak", self.Hj + H_q, q) / 2
        Mq = self.Mq + (Mq1 @ q + np.einsum("lij,l->ij", Mq_q, q)) / 2
        return Deformation(self.C + C2 @ q, H, Mq, I_q, H_q, Mq_q)

    def first_moment(self, q: Array) -> Array:
        """Return S - s0, (3,)."""
        return (self.C + self.deformed(q).C) @ q / 2

    def delta(self, q: Array) -> Array:
        """Return M(q) minus M of the rigid body, (6 + k, 6 + k)."""
        return self._delta(q, self.deformed(q))

    def _delta(self, q: Array, at: Deformation) -> Array:
        C, H, Mq, I_q, _, _ = at
        X = np.einsum("abc,b->ac", _CROSS, (self.C + C) @ q / 2)
        I = np.einsum("iab,i->ab", self.I1 + I_q, q) / 2  # noqa: E741 - the inertia
        out = np.zeros((6 + self.modes, 6 + self.modes), X.dtype)
        out[:3, 3:6], out[:3, 6:] = -X, C
        out[3:6, :3], out[3:6, 3:6], out[3:6, 6:] = X, I, H
        out[6:, :3], out[6:, 3:6], out[6:, 6:] = C.T, H.T, Mq
        return out

    def inertial_force(self, q: Array, nu: Array, rate: Array) -> Array:
        """Return M(q) nu' + h(q, nu), (6 + k,), without the rigid body.

        h = sum q'_i M_i nu + (w x p_v, w x p_w + v x p_v, -(nu^T M_i nu)/2), p = M nu, M_i = dM/dq_i.
        """
        v, w, u = nu[:3], nu[3:6], nu[6:]
        C, _, _, I_q, H_q, Mq_q = at = self.deformed(q)
        D, dS = self._delta(q, at), C @ u
        p = D[:6] @ nu
        dI, dH, Mq_u = np.einsum("iab,i->ab", I_q, u), np.einsum("jak,j->ak", H_q, u), Mq_q @ u
        linear = cross(w, dS + p[:3]) + self.second_order[0] @ u @ u
        angular = cross(dS, v) + dI @ w + dH @ u + cross(w, p[3:]) + cross(v, p[:3])
        by_q = cross(v, w) @ C + np.einsum("iab,a,b->i", I_q, w, w) / 2 + np.einsum("iak,a,k->i", H_q, w, u)
        return D @ rate + np.concatenate([linear, angular, dH.T @ w + u @ Mq_u - Mq_u @ u / 2 - by_q])

    def core_data(self) -> CoreData:
        """Return the coefficients of the body and of its nodes for the core, `native/mechanism/modal_body.hpp`."""
        zero, k = np.zeros((3, self.modes, self.modes)), self.modes
        second = {name: zero if x.Phi2 is None else x.Phi2 for name, x in self.nodes.items()}
        arrays = {"C": self.C.T, "H0": self.H0.T, "Mq": self.Mq, "Hj": self.Hj.transpose(0, 2, 1)}
        arrays |= {"C2": self.array("C2").transpose(1, 2, 0)}
        arrays |= {"H2": self.array("H2").transpose(2, 3, 1, 0)}
        arrays |= {"Mq1": self.array("Mq1").transpose(2, 0, 1), "Mq2": self.array("Mq2").transpose(2, 3, 0, 1)}
        if all(getattr(self, name) is None for name in SECOND_ORDER):
            arrays |= dict.fromkeys(("H2", "Mq1", "Mq2"), np.empty(0))
        arrays |= {"I1": self.I1[:, *_PACKED], "I2": self.I2[:, :, *_PACKED]}
        node_arrays = [
            {"r": x.r, "Phi": x.Phi.T, "Psi": x.Psi.T, "Phi2": second[name].transpose(1, 2, 0)}
            for name, x in self.nodes.items()
        ]
        nodes = [{name: x.ravel().tolist() for name, x in node.items()} for node in node_arrays]
        return {"modes": k, "nodes": nodes, **{name: x.ravel().tolist() for name, x in arrays.items()}}

    @classmethod
    def of_points(
        cls,
        r: Array,
        masses: Any,
        Phi: Array,
        stiffness: Array,
        damping_ratios: float | Sequence[float] | Array = 0.0,
        nodes: Mapping[str, Node] | None = None,
        Phi2: Array | None = None,
    ) -> "ModalBody":
        """Return the body of points with masses, from sums of m x y over the points, or of m_ij x_i y_j.

        Args:
            r: points (n, 3) in m.
            masses: (n,) in kg, or a symmetric matrix (n, n), dense or sparse: of consistent finite elements, which
                interpolate the three displacements by the same functions.
            Phi: displacements of the points in each mode, (n, 3, k).
            stiffness: stiffness of each mode, (k,).
            damping_ratios: damping ratio of each mode, (k,), or one for all modes.
            nodes: nodes by name.
            Phi2: displacements of second order of the points, (n, 3, k, k), zero if omitted.

        Raises:
            InputError: for wrong shapes, masses that no body has, stiffness that is not positive, or negative damping.
        """
        r, m, P, K = checked_points(r, masses, Phi, stiffness)
        require_nodes(nodes or {}, len(K), "flexible body")
        mP, k = _weighted(m, P), len(K)
        Mq = _modal_masses(P, mP)
        modes = P.transpose(2, 0, 1)
        cross = np.einsum("abc,nbi,ncj->iaj", _CROSS, P, mP)
        I2 = np.array([2 * _inertia(m, x, y) for x in modes for y in modes]).reshape(k, k, 3, 3)
        second: dict[str, Any] = {}
        if Phi2 is not None:
            P2 = array(Phi2, "flexible body: Phi2", (*P.shape, k))
            require_symmetric(P2, "flexible body: Phi2", (2, 3))
            second, (I2_second, Hj_second) = _second_order(r, m, P, P2)
            I2, cross = I2 + I2_second, cross + Hj_second
        return cls(
            mass=float(m.sum()),
            s0=_weighted(m, r).sum(axis=0),
            I0=_inertia(m, r, r),
            C=mP.sum(axis=0),
            H0=np.einsum("abc,nb,nci->ai", _CROSS, r, mP),
            Mq=Mq,
            Hj=cross,
            I1=np.array([2 * _inertia(m, r, x) for x in modes]).reshape(k, 3, 3),
            I2=I2,
            **second,
            stiffness=K,
            damping=damping_coefficients(damping_ratios, K, Mq),
            nodes=dict(nodes or {}),
            outline=OutlinePoints.of_extremes(r, P),
        )


_CROSS = np.array([pin.skew(e) for e in np.eye(3)]).transpose(1, 0, 2)  # (a x b)_i = sum CROSS_ijk a_j b_k
_PACKED = ([0, 1, 1, 2, 2, 2], [0, 0, 1, 0, 1, 2])  # xx, xy, yy, xz, yz, zz


def _largest(q: Array, rows: Sequence[Array]) -> float:
    """Return the largest length of vectors x q, for some x (3, k) and q (m, k)."""
    return max((float(np.linalg.norm(q @ x.T, axis=1).max(initial=0.0)) for x in rows), default=0.0)


def _modal_masses(P: Array, mP: Array) -> Array:
    """Return Mq (k, k), diagonal for orthogonal modes."""
    Mq = np.einsum("nai,naj->ij", mP, P)
    if len(Mq) and not np.linalg.eigvalsh(Mq)[0] > PIVOT_RANK * np.diagonal(Mq).max():
        raise InputError("flexible body: modes need independent displacements of masses")
    sizes = np.sqrt(np.diagonal(Mq))
    return np.where(np.abs(Mq) > SUM_ROUNDING * np.outer(sizes, sizes), Mq, 0.0)


def _weighted(m: Any, x: Array) -> Array:
    """Return m x of points, (n, ..)."""
    return m.reshape(-1, *[1] * (x.ndim - 1)) * x if m.ndim == 1 else (m @ x.reshape(len(x), -1)).reshape(x.shape)


def _second_order(r: Array, m: Any, Phi: Array, Phi2: Array) -> tuple[dict[str, Array], tuple[Array, Array]]:
    """Return the arrays of `SECOND_ORDER`, and the contributions of displacements of second order to I2 and to Hj."""
    k = Phi2.shape[-1]
    weighted = _weighted(m, Phi2)
    rows = weighted.reshape(-1, k * k).T
    D = (rows @ Phi2.reshape(-1, k * k)).reshape((k,) * 4)
    E = (rows @ Phi.reshape(-1, k)).reshape((k,) * 3)  # sum m Phi2_jl.Phi_i
    X = np.einsum("abc,bjlci->ajli", _CROSS, np.einsum("nbjl,nci->bjlci", weighted, Phi, optimize=True))
    arrays = {
        "C2": weighted.sum(axis=0),
        "H2": X.transpose(0, 3, 1, 2) - X.transpose(0, 1, 3, 2) - X,
        "Mq1": E.transpose(2, 0, 1) + E.transpose(0, 2, 1),
        "Mq2": D.transpose(0, 2, 1, 3) + D.transpose(0, 2, 3, 1),
    }
    pairs = [2 * _inertia(m, r, Phi2[:, :, i, j]) for i in range(k) for j in range(k)]
    crossed = np.einsum("abc,nb,ncji->jai", _CROSS, r, weighted)
    return arrays, (np.array(pairs).reshape(k, k, 3, 3), crossed)


def _inertia(m: Any, x: Array, y: Array) -> Array:
    """Return sum m (x.y 1 - (x y^T + y x^T)/2), (3, 3)."""
    mixed = _weighted(m, x).T @ y
    return np.trace(mixed) * np.eye(3) - (mixed + mixed.T) / 2
