"""Mechanism with frozen free joints, whose motions displace joints and frames."""

from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ...errors import NotCompiled
from ...system import Array
from ..forces.force import PairElement
from ..formulations.equation_partials import EquationPartials, gamma_partials
from ..formulations.index2 import Index2System
from .parameter_direction import Parameter

if TYPE_CHECKING:
    from ..mechanism import Mechanism


class PlacementTree:
    """The mechanism with frozen free joints as parents of displaced joints and frames."""

    def __init__(
        self, mech: "Mechanism", placed_joints: list[int], frames: list[int], s: Index2System, native: ModuleType | None
    ) -> None:
        old, model, last = mech.model, pin.Model(), [0]
        model.gravity = old.gravity
        self.real: list[int] = []
        self.frozen: dict[tuple[str, int], int] = {}
        held: dict[int, int] = {}

        def freeze(kind: str, i: int, parent: int, placement: pin.SE3) -> int:
            joint = model.addJoint(parent, pin.JointModelFreeFlyer(), placement, f"{kind} {i} of {model.njoints}")
            self.frozen[kind, i] = model.idx_vs[joint]
            return int(joint)

        def freeze_frames(j: int) -> None:
            for i in frames:
                if old.frames[i].parentJoint == j:
                    held[i] = freeze("frame", i, last[j], old.frames[i].placement)

        for j in range(1, old.njoints):
            parent, placement = last[old.parents[j]], old.jointPlacements[j]
            if j in placed_joints:
                parent, placement = freeze("place", j, parent, placement), pin.SE3.Identity()
            last.append(model.addJoint(parent, old.joints[j], placement, old.names[j]))
            model.inertias[last[j]] = old.inertias[j]
            self.real += range(model.idx_vs[last[j]], model.idx_vs[last[j]] + old.nvs[j])
            freeze_frames(j)
        freeze_frames(0)
        for i, f in list(enumerate(old.frames))[1:]:
            joint, placement = (held[i], pin.SE3.Identity()) if i in held else (last[f.parentJoint], f.placement)
            model.addFrame(pin.Frame(f.name, joint, placement, f.type), False)
        self.iq = [model.idx_qs[last[j]] + i for j in range(1, old.njoints) for i in range(old.nqs[j])]
        forces = [f for f, (law, _) in zip(mech.forces, s.laws.bound, strict=False) if isinstance(law, PairElement)]
        other = type(mech)(model, mech.closures, forces, drivers=mech.drivers)
        self.model, self.ng = model, s.ng
        names = [c.name for c in mech.closures] + [d.name for d in mech.drivers]  # stops and brakes have no frames
        spans = [s.constraints.spans[name] for name in names]
        self.kept = np.array([i for at in spans for i in range(at.start, at.stop)], int)
        try:
            self.system = other.system(native=None if other.switches else native)
        except NotCompiled:
            self.system = other.system()
        self.system.constraints.inactive = np.empty(0, int)  # partials are those of all rows, in any mode
        self.system.use_rows(tuple(range(self.system.ng)))
        self.at = [i for first in self.frozen.values() for i in range(first, first + 6)]

    def full_configuration(self, q: Array) -> Array:
        """Return the configuration, frozen joints included."""
        out = pin.neutral(self.model)
        out[self.iq] = q
        return out

    def _partials(self, t: float, q: Array, v: Array, vdot: Array, lam: Array) -> EquationPartials:
        u, a = np.zeros(self.model.nv + 1), np.zeros(self.model.nv)
        u[self.real], a[self.real] = v, vdot
        return self.system.partials(t, self.full_configuration(q), u, a, lam[self.kept], np.arange(self.system.ng))

    def _all(self, own: Array) -> Array:
        """Return the partials of all rows of the mechanism, (ng, 6 n)."""
        out = np.zeros((self.ng, len(self.at)))
        out[self.kept] = own[:, self.at]
        return out

    def torques(self, t: float, q: Array, v: Array, vdot: Array, lam: Array) -> Array:
        """Return columns of K of the frozen joints, (nv + 1, 6 n); the rows are those of the real ones, and power."""
        return self._partials(t, q, v, vdot, lam).K[np.ix_([*self.real, -1], self.at)]

    def rows(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return columns of B and G of the frozen joints, (ng, 6 n) each."""
        found = self._partials(t, q, v, np.zeros(len(v)), np.zeros(self.ng))
        return self._all(found.B), self._all(found.G)

    def bias(self, q: Array, v: Array) -> Array:
        """Return columns of gamma_q of the frozen joints, (ng, 6 n)."""
        if not v.any():  # it is quadratic in v
            return np.zeros((self.ng, len(self.at)))
        u = np.zeros(self.model.nv)
        u[self.real] = v
        return self._all(gamma_partials(self.system, self.full_configuration(q), u)[0])

    def motion(self, p: Parameter) -> Array:
        """Return the motion of the frozen joints by a parameter, (6 n,)."""
        known = {"place": p.placements, "frame": p.frames}
        return np.concatenate([known[kind].get(i, np.zeros(6)) for kind, i in self.frozen])
