"""Exact derivatives of a mechanism's equations with respect to its numbers: masses, places, lengths, stiffnesses, ...

A parameter is a direction in what a mechanism is made of: ten inertial numbers dpi of a body, a motion xi of a joint's
place or of a frame, gravity, armature, the numbers of closures, drivers and forces. The directions are found once,
from mechanisms made with other values. At a point

    inertial numbers             d(M v' + nle) = Y dpi with the bodies' regressors Y
    places and frames            columns of K, B, G and gamma_q of a frozen free joint there, times xi
    closures, drivers, forces    differences of these rows and laws alone, of order six: exact for numbers on which they
                                 depend by polynomials, and to rounding for others
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from ...errors import InputError
from ...system import Array
from ..closures.constraints import Constraints
from ..forces import bind_forces
from ..forces.force import PairElement
from ..frames import support
from .derivatives import hidden_slopes, jacobians
from .index2 import Index2System

if TYPE_CHECKING:
    from ..mechanism import Mechanism

WIDTH = 1e-2  # of the value, or the value itself where it is zero
WEIGHTS = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}  # of central differences of order six
REACHED = 1e-7  # of |dg/dp|: what closures cannot follow
Make = Callable[[Mapping[str, float]], "Mechanism"]


class ParameterSlopes(NamedTuple):
    """Slopes with respect to k parameters at a point (t, q, v, s, v', lam), all but the parameters held.

    Attributes:
        P: d(f + G^T lam - M v', h, power)/dp, (nv + ns + 1, k).
        Q: d(G v + g_t)/dp, (ng, k).
        g: dg/dp, (ng, k).
        gamma: d gamma/dp, (ng, k).
    """

    P: Array
    Q: Array
    g: Array
    gamma: Array


class Parameter:
    """A direction in the numbers of a mechanism.

    Args:
        name: for messages.
        mech: the mechanism.
        near: those with the parameter changed by k h, by k = -3 .. 3 without 0.
        h: the width.
    """

    def __init__(self, name: str, mech: "Mechanism", near: Mapping[int, "Mechanism"], h: float) -> None:
        self.name, self.near, self.h = name, near, h
        model = mech.model
        for other in (m.model for m in near.values()):
            same = [list(x.names) + [f.name for f in x.frames] for x in (model, other)]
            if same[0] != same[1] or (other.damping != model.damping).any():
                raise InputError(f"parameter {name!r} changes joints, frames or their damping: it has no derivative")
        self.inertias = self.each(model.njoints, lambda m, j: np.array(m.model.inertias[j].toDynamicParameters()))
        self.places = self.moved(mech, model.njoints, lambda m, j: m.model.jointPlacements[j])
        self.frames = self.moved(mech, model.nframes, lambda m, i: m.model.frames[i].placement)
        self.gravity = self.rate(lambda m: m.model.gravity.linear)
        self.armature = self.rate(lambda m: m.model.armature)
        self.ruled = any(m.constraints != mech.constraints or m.forces != mech.forces for m in near.values())

    def quotient(self, values: Mapping[int, Array]) -> Array:
        """Central difference of order six of values at k h; exactly zero where they do not change."""
        return np.array(sum((w / self.h) * (values[k] - values[-k]) for k, w in WEIGHTS.items()))

    def rate(self, value: Callable[["Mechanism"], Array]) -> Array:
        """Derivative of what a mechanism is made of."""
        return self.quotient({k: value(m) for k, m in self.near.items()})

    def each(self, n: int, value: Callable[["Mechanism", int], Array]) -> dict[int, Array]:
        """Derivatives of the parts 1 to n - 1 of a mechanism that change."""
        found = {i: self.rate(lambda m, i=i: value(m, i)) for i in range(1, n)}  # type: ignore[misc]
        return {i: d for i, d in found.items() if d.any()}

    def moved(self, mech: "Mechanism", n: int, place: Callable[["Mechanism", int], pin.SE3]) -> dict[int, Array]:
        """The motions (6,) of places that change, in their own axes."""
        found = self.each(n, lambda m, i: place(m, i).homogeneous)
        twists = {i: place(mech, i).inverse().homogeneous @ d for i, d in found.items()}
        return {i: np.array([*T[:3, 3], T[2, 1], T[0, 2], T[1, 0]]) for i, T in twists.items()}


class Parameters:
    """Derivatives with respect to some numbers of a mechanism, bound to a workspace.

    Args:
        make: makes a mechanism with these values, for instance `mbdae.mechanism.formats.template.Template.make`.
        values: names and values of the parameters.

    Raises:
        InputError: for a parameter that changes more than numbers.
    """

    def __init__(self, make: Make, values: Mapping[str, float]) -> None:
        self.mech = mech = make(values)
        self.system = s = Index2System(mech)
        self.all: list[Parameter] = []
        for name, value in values.items():
            h = WIDTH * (abs(value) or 1.0)
            near = {k: make({**values, name: value + k * h}) for k in (-3, -2, -1, 1, 2, 3)}
            self.all.append(Parameter(name, mech, near, h))
        self.rules = [
            {k: (Constraints(s.model, s.data, m.constraints), bind_forces(m.forces, s.model, s.data))
             for k, m in p.near.items()} if p.ruled else {}
            for p in self.all
        ]  # fmt: skip
        places = sorted({j for p in self.all for j in p.places})
        frames = sorted({i for p in self.all for i in p.frames})
        self.opened = _Opened(mech, places, frames, s) if places or frames else None

    def slopes(self, t: float, q: Array, v: Array, s: Array, vdot: Array, lam: Array) -> ParameterSlopes:
        """Take the slopes at (t, q, v, s, v', lam), lam (ng,) for all rows."""
        system, k = self.system, len(self.all)
        nv, ng = system.nv, system.ng
        out = ParameterSlopes(np.zeros((nv + len(s) + 1, k)), *np.zeros((3, ng, k)))
        at = self.opened.columns(t, q, v, vdot, lam) if self.opened else None
        pin.forwardKinematics(system.model, system.data, q, v, vdot)
        J = pin.computeJointJacobians(system.model, system.data, q)
        for i, p in enumerate(self.all):
            out.P[:nv, i] = -self._inertial(p, J) - p.armature * vdot
            if at is not None and self.opened is not None:
                xi = self.opened.motion(p)
                out.P[:nv, i] += at[0][:nv] @ xi
                out.P[-1, i] += at[0][-1] @ xi
                for to, columns in zip(out[1:], at[1:], strict=True):
                    to[:, i] += columns @ xi
        pin.forwardKinematics(system.model, system.data, q, v, np.zeros(nv))
        for i, (p, rules) in enumerate(zip(self.all, self.rules, strict=True)):
            found: dict[int, Array] = {}
            for j, (rows, laws) in rules.items():
                (g, G), (_, du, ddu) = rows.value(t), rows.motion(t)
                tau, rates = laws.torque(t, q, v, s)
                rates[-1] += lam @ du
                found[j] = np.concatenate([tau + lam @ G, rates, G @ v - du, g, rows.bias(v) - ddu])
            if found:
                parts = np.split(p.quotient(found), np.cumsum([nv + len(s) + 1, ng, ng]))
                for to, part in zip(out, parts, strict=True):
                    to[:, i] += part
        return out

    def _inertial(self, p: Parameter, J: Array) -> Array:
        """Slope of M v' + nle, (nv,), without armature; velocities and accelerations stand."""
        model, data, out = self.system.model, self.system.data, np.zeros(self.system.nv)
        for j in set(p.inertias) | (set(range(1, model.njoints)) if p.gravity.any() else set()):
            place, wrench = data.oMi[j], np.zeros(6)
            if j in p.inertias:
                a = data.a[j] - place.actInv(model.gravity)
                wrench += place.act(pin.Force(pin.bodyRegressor(data.v[j], a) @ p.inertias[j])).vector
            wrench -= (place.act(model.inertias[j]) * pin.Motion(p.gravity, np.zeros(3))).vector
            out += support(model, j) * (wrench @ J.reshape(6, -1))
        return out

    def refuse(self, t: float, q: Array) -> None:
        """Refuse parameters that open closures in a way that no motion closes: rows that depend on others.

        Raises:
            InputError: names the parameter.
        """
        nv, ng = self.system.nv, self.system.ng
        s = np.array(list(self.mech.states.values()))
        g, G = self.slopes(t, q, np.zeros(nv), s, np.zeros(nv), np.zeros(ng)).g, self.system.jacobian(q)
        for p, column in zip(self.all, g.T, strict=True):
            left = column + G @ np.linalg.lstsq(G, -column, rcond=1e-9)[0]
            if np.abs(left).max(initial=0.0) > REACHED * np.abs(column).max(initial=0.0):
                raise InputError(f"parameter {p.name!r} opens closures that depend on each other: no derivative exists")


class _Opened:
    """The mechanism with frozen free joints before joints whose place changes, and below frames that are moved."""

    def __init__(self, mech: "Mechanism", places: list[int], frames: list[int], s: Index2System) -> None:
        old, model, last = mech.model, pin.Model(), [0]
        model.gravity = old.gravity
        self.real: list[int] = []
        self.frozen: dict[tuple[str, int], int] = {}
        held: dict[int, int] = {}

        def freeze(kind: str, i: int, parent: int, place: pin.SE3) -> int:
            joint = model.addJoint(parent, pin.JointModelFreeFlyer(), place, f"{kind} {i} of {model.njoints}")
            self.frozen[kind, i] = model.idx_vs[joint]
            return int(joint)

        def freeze_frames(j: int) -> None:
            for i in frames:
                if old.frames[i].parentJoint == j:
                    held[i] = freeze("frame", i, last[j], old.frames[i].placement)

        for j in range(1, old.njoints):
            parent, place = last[old.parents[j]], old.jointPlacements[j]
            if j in places:
                parent, place = freeze("place", j, parent, place), pin.SE3.Identity()
            last.append(model.addJoint(parent, old.joints[j], place, old.names[j]))
            model.inertias[last[j]] = old.inertias[j]
            self.real += range(model.idx_vs[last[j]], model.idx_vs[last[j]] + old.nvs[j])
            freeze_frames(j)
        freeze_frames(0)
        for i, f in list(enumerate(old.frames))[1:]:
            joint, place = (held[i], pin.SE3.Identity()) if i in held else (last[f.parentJoint], f.placement)
            model.addFrame(pin.Frame(f.name, joint, place, f.type), False)
        self.iq = [model.idx_qs[last[j]] + i for j in range(1, old.njoints) for i in range(old.nqs[j])]
        forces = [f for f, (law, _) in zip(mech.forces, s.laws.bound, strict=False) if isinstance(law, PairElement)]
        self.model, self.system = model, type(mech)(model, mech.closures, forces, drivers=mech.drivers).system()

    def columns(self, t: float, q: Array, v: Array, vdot: Array, lam: Array) -> tuple[Array, Array, Array, Array]:
        """Columns of K, B, G and gamma_q of the frozen joints; the rows of K are those of the real ones, and power."""
        s, model = self.system, self.model
        whole = pin.neutral(model)
        whole[self.iq] = q
        u, a = np.zeros(model.nv + 1), np.zeros(model.nv)
        u[self.real], a[self.real] = v, vdot
        at = [i for first in self.frozen.values() for i in range(first, first + 6)]
        found = jacobians(s, t, whole, u, a, lam, np.arange(s.ng))
        gamma = hidden_slopes(s, whole, u[:-1])[0]
        return found.K[np.ix_([*self.real, -1], at)], found.B[:, at], found.G[:, at], gamma[:, at]

    def motion(self, p: Parameter) -> Array:
        """What a parameter moves the frozen joints by, (6 n,)."""
        known = {"place": p.places, "frame": p.frames}
        return np.concatenate([known[kind].get(i, np.zeros(6)) for kind, i in self.frozen])
