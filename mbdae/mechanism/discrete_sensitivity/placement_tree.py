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
        self.mechanism_velocities: list[int] = []
        self.frozen: dict[tuple[str, int], int] = {}
        frozen_frames: dict[int, int] = {}

        def freeze(kind: str, i: int, parent: int, placement: pin.SE3) -> int:
            joint = model.addJoint(parent, pin.JointModelFreeFlyer(), placement, f"{kind} {i} of {model.njoints}")
            self.frozen[kind, i] = model.idx_vs[joint]
            return int(joint)

        def freeze_frames(j: int) -> None:
            for i in frames:
                if old.frames[i].parentJoint == j:
                    frozen_frames[i] = freeze("frame", i, last[j], old.frames[i].placement)

        for j in range(1, old.njoints):
            parent, placement = last[old.parents[j]], old.jointPlacements[j]
            if j in placed_joints:
                parent, placement = freeze("placement", j, parent, placement), pin.SE3.Identity()
            last.append(model.addJoint(parent, old.joints[j], placement, old.names[j]))
            model.inertias[last[j]] = old.inertias[j]
            self.mechanism_velocities += range(model.idx_vs[last[j]], model.idx_vs[last[j]] + old.nvs[j])
            freeze_frames(j)
        freeze_frames(0)
        for i, f in list(enumerate(old.frames))[1:]:
            joint, placement = last[f.parentJoint], f.placement
            if i in frozen_frames:
                joint, placement = frozen_frames[i], pin.SE3.Identity()
            model.addFrame(pin.Frame(f.name, joint, placement, f.type), False)
        self.iq = [model.idx_qs[last[j]] + i for j in range(1, old.njoints) for i in range(old.nqs[j])]
        forces = [f for f, (law, _) in zip(mech.forces, s.laws.bound, strict=False) if isinstance(law, PairElement)]
        other = type(mech)(model, mech.closures, forces, drivers=mech.drivers)
        self.model, self.ng = model, s.ng
        names = [c.name for c in mech.closures] + [d.name for d in mech.drivers]  # stops and brakes have no frames
        spans = [s.constraints.spans[name] for name in names]
        self.frame_rows = np.array([i for at in spans for i in range(at.start, at.stop)], int)
        try:
            self.system = other.system(native=None if other.switches else native)
        except NotCompiled:
            self.system = other.system()
        self.system.constraints.inactive = np.empty(0, int)  # partials of all rows, in any mode
        self.system.use_rows(tuple(range(self.system.ng)))
        self.frozen_columns = [i for first in self.frozen.values() for i in range(first, first + 6)]

    def full_configuration(self, q: Array) -> Array:
        """Return the configuration with frozen joints."""
        out = pin.neutral(self.model)
        out[self.iq] = q
        return out

    def _partials(self, t: float, q: Array, v: Array, vdot: Array, lam: Array) -> EquationPartials:
        u, a = np.zeros(self.model.nv + 1), np.zeros(self.model.nv)
        u[self.mechanism_velocities], a[self.mechanism_velocities] = v, vdot
        x, multipliers = self.full_configuration(q), lam[self.frame_rows]
        return self.system.partials(t, x, u, a, multipliers, np.arange(self.system.ng))

    def _in_all_rows(self, partials: Array) -> Array:
        """Return the partials with respect to frozen joints in all rows of the mechanism, (ng, 6 n)."""
        out = np.zeros((self.ng, len(self.frozen_columns)))
        out[self.frame_rows] = partials[:, self.frozen_columns]
        return out

    def force_partials(self, t: float, q: Array, v: Array, vdot: Array, lam: Array) -> Array:
        """Return columns of K of the frozen joints, (nv + 1, 6 n); rows are mechanism velocities and power."""
        return self._partials(t, q, v, vdot, lam).K[np.ix_([*self.mechanism_velocities, -1], self.frozen_columns)]

    def rows(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return columns of B and G of the frozen joints, (ng, 6 n) each."""
        found = self._partials(t, q, v, np.zeros(len(v)), np.zeros(self.ng))
        return self._in_all_rows(found.B), self._in_all_rows(found.G)

    def bias(self, q: Array, v: Array) -> Array:
        """Return columns of gamma_q of the frozen joints, (ng, 6 n)."""
        if not v.any():  # gamma is quadratic in v
            return np.zeros((self.ng, len(self.frozen_columns)))
        u = np.zeros(self.model.nv)
        u[self.mechanism_velocities] = v
        return self._in_all_rows(gamma_partials(self.system, self.full_configuration(q), u)[0])

    def motion(self, p: Parameter) -> Array:
        """Return the motion of the frozen joints caused by a parameter, (6 n,)."""
        motions = {"placement": p.placements, "frame": p.frames}
        return np.concatenate([motions[kind].get(i, np.zeros(6)) for kind, i in self.frozen])
