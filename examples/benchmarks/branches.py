"""Mechanisms of one degree of freedom with intersecting branches, each in closed form, and the motion along a branch.

A branch is q(s) with a parameter s in which it is analytic also where closures lose rank. The motion along it needs no
closures:

    v = T s',   T . (M (T s'' + T' s'^2) + n(q, T s')) = 0,   T = dq/ds,   n: gravity and velocity terms,

one equation that is regular in singular configurations, integrated by DOP853. Multipliers are those of smallest norm
with G^T lam = M v' + n. No steps, rows, or projections of mbdae are used.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

import mbdae

Array = np.ndarray
H = 3e-3  # of s: central differences of order 6 over seven points
OFFSETS = np.arange(-3, 4)
FIRST = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60
SECOND = np.array([2, -27, 270, -490, 270, -27, 2]) / 180


class Branch(NamedTuple):
    """A mechanism on one of its branches.

    Attributes:
        mech: the mechanism; all its joints have one coordinate.
        start: parameters at the start, (k,).
        jet: parameters (k,) -> q (nq,), T = dq/ds (nq,), T' (nq,).
        flow: parameters (k,) -> their derivatives with respect to s, (k,).
        project: q (nq,) -> parameters of a point of the branch close to q, (k,).
        angular: mask of the coordinates that are angles, (nq,).
    """

    mech: mbdae.Mechanism
    start: Array
    jet: Callable[[Array], tuple[Array, Array, Array]]
    flow: Callable[[Array], Array]
    project: Callable[[Array], Array]
    angular: Array

    def difference(self, a: Array, b: Array) -> Array:
        """Differences a - b of configurations, (..., nq), angles within half a turn."""
        d = a - b
        return d - 2 * np.pi * np.round(d / (2 * np.pi)) * self.angular

    def distance(self, q: Array) -> float:
        """Distance of q (nq,) from the branch in rad or m: the largest component after two Gauss-Newton steps."""
        p, best = self.project(q), np.inf
        for _ in range(4):
            at, T, _ = self.jet(p)
            d = self.difference(q, at)
            best = min(best, float(np.abs(d).max()))
            p = p + self.flow(p) * float(T @ d) / float(T @ T)
        return best


def differences(path: Callable[[Array], Array], angular: Array, p: Array) -> tuple[Array, Array, Array]:
    """q, T and T' of a path s (m,) -> q (m, nq) at p = (s,) by central differences."""
    q = path(p[0] + H * OFFSETS)
    d = q - q[3]
    d -= 2 * np.pi * np.round(d / (2 * np.pi)) * angular
    return q[3], FIRST @ d / H, SECOND @ d / H**2


def on_path(mech: mbdae.Mechanism, path: Callable[[Array], Array], angular: Array, start: float) -> Branch:
    """A branch s -> q in closed form with a period of at most four half turns; the nearest s is found on a grid."""
    grid = np.linspace(0, 4 * np.pi, 1441) + 1e-3  # not where bars are in line
    poses = path(grid)

    def nearest(q: Array) -> Array:
        d = q - poses
        d -= 2 * np.pi * np.round(d / (2 * np.pi)) * angular
        return grid[[int(np.abs(d).max(axis=1).argmin())]]

    return Branch(mech, np.array([start]), partial(differences, path, angular), np.ones_like, nearest, angular)


# -- mechanisms ----------------------------------------------------------------------------------------------------


def _bar(model: pin.Model, parent: int, kind: pin.JointModel, x: float, name: str, length: float, mass: float) -> int:
    """Add a uniform bar along x; its tip is a frame."""
    joint = model.addJoint(parent, kind, pin.SE3(np.eye(3), np.array([x, 0.0, 0.0])), name)
    about = mass * length**2 / 12 + 1e-3 * mass
    inertia = pin.Inertia(mass, np.array([length / 2, 0, 0]), np.diag([1e-3 * mass, about, about]))
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([length, 0.0, 0.0]))
    model.addFrame(pin.Frame(f"{name}_tip", joint, 0, tip, pin.FrameType.OP_FRAME))
    return joint


def four_bar(bars: Array, gravity: float, title: str) -> mbdae.Mechanism:
    """A four-bar of lengths ground, crank, coupler, rocker with 1 kg/m; coordinates in this order, coupler relative."""
    model, (g, a, b, c) = pin.Model(), bars
    crank = _bar(model, 0, pin.JointModelRY(), 0.0, "crank", a, a)
    _bar(model, crank, pin.JointModelRY(), a, "coupler", b, b)
    _bar(model, 0, pin.JointModelRY(), g, "rocker", c, c)
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    return mbdae.Mechanism(model, [mbdae.Closure.point("coupler_tip", "rocker_tip")], title=title)


def quadrilateral(bars: Array, sign: float, s: Array) -> Array:
    """Coordinates (m, 3) of a four-bar (ground, crank, coupler, rocker) whose shortest bars rotate by s at a corner.

    The corner is at the shortest bar, which revolves where the lengths have s + l <= p + q. Twice the area of the
    triangle across it is a product of two roots; at a double zero of a factor, its root is the sine or cosine of s / 2,
    which changes sign there: that continues the branch analytically through the change point.
    """
    k = min(range(4), key=lambda i: (min(bars[i], bars[(i + 1) % 4]), bars[i] + bars[(i + 1) % 4]))
    x, y, w, z = (bars[(k + i) % 4] for i in range(4))  # from the corner to P, to Q, from Q to R, from R to P
    near, far = 4 * x * y * np.sin(s / 2) ** 2, 4 * x * y * np.cos(s / 2) ** 2
    inner, outer = (x - y) ** 2 - (z - w) ** 2, (z + w) ** 2 - (x + y) ** 2
    half = 2 * np.sqrt(x * y)
    one = half * np.sin(s / 2) if abs(inner) < 1e-12 else np.sqrt(inner + near)
    two = half * np.cos(s / 2) if abs(outer) < 1e-12 else np.sqrt(outer + far)
    d2 = (x - y) ** 2 + near
    across = y - x + 2j * y * np.sin(s / 2) * np.exp(0.5j * s)  # from P to Q = y exp(i s), P = x
    R = x + across * ((d2 + z * z - w * w) + sign * 1j * one * two) / (2 * d2)
    corners = [x + 0 * s, 0 * s, y * np.exp(1j * s), R]  # P, the corner, Q, R: bars k, k + 1, ... lie between them
    D, A, B, C = (corners[(i - k) % 4] for i in range(4))
    turned = (A - D) / np.abs(A - D)  # the ground leads from A to D along x
    crank, coupler, rocker = (np.angle(v / -turned) for v in (B - A, C - B, C - D))
    return np.stack([crank, coupler - crank, rocker], axis=1)


def folded_kite(bars: Array, s: Array) -> Array:
    """Coordinates (m, 3) of a kite whose corners between equal bars coincide: two bars rotate by s, the others rest."""
    g, a = bars[:2]
    columns = (0 * s, s, s) if np.isclose(g, a) else (s, np.pi + 0 * s, np.pi + 0 * s)
    return np.stack(columns, axis=1)


def rows(mech: mbdae.Mechanism, s: Array) -> Array:
    """Parallel cranks at s and couplers that do not rotate, (m, nq)."""
    return np.stack([s if n.startswith("crank") else -s for n in mech.joint_names], axis=1)


def slider_crank(gravity: float, direction: float) -> mbdae.Mechanism:
    """Crank and rod of 1 m and 1 kg, a slider of 1 kg along x; gravity along x or z."""
    model = pin.Model()
    crank = _bar(model, 0, pin.JointModelRY(), 0.0, "crank", 1.0, 1.0)
    _bar(model, crank, pin.JointModelRY(), 1.0, "rod", 1.0, 1.0)
    slider = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slider")
    model.appendBodyToJoint(slider, pin.Inertia(1.0, np.zeros(3), 1e-3 * np.eye(3)), pin.SE3.Identity())
    model.addFrame(pin.Frame("pin", slider, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    model.gravity.linear = -gravity * np.array([np.sin(direction), 0.0, np.cos(direction)])
    return mbdae.Mechanism(model, [mbdae.Closure.point("rod_tip", "pin")], title="slider-crank, crank = rod")


def bricard(gravity: float, r1: float, folded: bool) -> Branch:
    """Bricard's closed mode: rod_3 = rod_1, rod_5 = -rod_1, rod_4 = -rod_2, (1 - sin rod_2) (1 + sin rod_1) = 1."""
    mech = mbdae.load("bricard")
    mech.model.gravity.linear = np.array([0.0, 0.0, -gravity])
    signs = np.array([[1, 0, 1, 0, -1], [0, 1, 0, -1, 0]], float)
    r2 = np.arcsin(np.sin(r1) / (1 + np.sin(r1)))

    def flow(p: Array) -> Array:
        return np.array([np.cos(p[1]) * (1 + np.sin(p[0])), np.cos(p[0]) * (1 - np.sin(p[1]))])

    def jet(p: Array) -> tuple[Array, Array, Array]:
        (s1, s2), (c1, c2) = np.sin(p), np.cos(p)
        f = flow(p)
        partials = np.array([[c2 * c1, -s2 * (1 + s1)], [-s1 * (1 - s2), -c1 * c2]])
        return p @ signs, f @ signs, partials @ f @ signs

    def project(q: Array) -> Array:
        p = q[:2].copy()
        for _ in range(3):  # onto the relation
            across = np.array([np.cos(p[0]) * (1 - np.sin(p[1])), -np.cos(p[1]) * (1 + np.sin(p[0]))])
            p -= across * ((1 - np.sin(p[1])) * (1 + np.sin(p[0])) - 1) / max(across @ across, 1e-3)
        return p

    return Branch(mech, np.array([r1, np.pi - r2 if folded else r2]), jet, flow, project, np.ones(5))


# -- motion --------------------------------------------------------------------------------------------------------


class Truth:
    """The motion along a branch.

    Args:
        branch: the branch.
        rate: s' at the start in 1/s.
        end: last time in s.
        rtol: of DOP853.
    """

    def __init__(self, branch: Branch, rate: float, end: float, rtol: float = 1e-11) -> None:
        self.branch, mech = branch, branch.mech
        self.model, self.data = mech.model, mech.model.createData()
        self.closures = mech.system().closures
        start = np.append(branch.start, rate)
        self.path = solve_ivp(self._rate, (0, end), start, "DOP853", rtol=rtol, atol=1e-2 * rtol, dense_output=True).sol

    def _rate(self, t: float, y: Array) -> Array:
        p, rate = y[:-1], y[-1]
        q, T, bend = self.branch.jet(p)
        M = pin.crba(self.model, self.data, q)
        M = np.triu(M) + np.triu(M, 1).T
        force = pin.rnea(self.model, self.data, q, T * rate, bend * rate**2)
        return np.append(self.branch.flow(p) * rate, -T @ force / (T @ M @ T))

    def at(self, t: float) -> tuple[Array, Array]:
        """Return q (nq,) and v (nv,)."""
        y = self.path(t)
        q, T, _ = self.branch.jet(y[:-1])
        return q, T * y[-1]

    def forces(self, t: float) -> tuple[Array, float]:
        """Return lam (ng,), of smallest norm, and the smallest singular value of G M^-1/2 over the largest.

        The rank is nv - 1: there is one degree of freedom.
        """
        y = self.path(t)
        q, T, bend = self.branch.jet(y[:-1])
        vdot = T * self._rate(t, y)[-1] + bend * y[-1] ** 2
        force = pin.rnea(self.model, self.data, q, T * y[-1], vdot)
        M = pin.crba(self.model, self.data, q)
        U = np.linalg.cholesky(np.triu(M) + np.triu(M, 1).T)
        G, rank = self.closures(q)[1], self.model.nv - 1
        sizes = np.linalg.svd(np.linalg.solve(U, G.T), compute_uv=False)
        left, singular_values, right = np.linalg.svd(G, full_matrices=False)
        with np.errstate(divide="ignore", invalid="ignore"):
            lam = left[:, :rank] @ (right[:rank] @ force / singular_values[:rank])
        return lam, float(sizes[rank - 1] / sizes[0])
