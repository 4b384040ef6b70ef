"""All force laws of a workspace: their sum, and their states."""

from collections.abc import Sequence
from math import inf

import numpy as np
import pinocchio as pin

from ...errors import InputError
from .force import Array, ForceElement, Part
from .linear import Linear, LinearElement

Bound = tuple[ForceElement, slice]


class ForceElements:
    """All force laws of a workspace; their states are concatenated to s (ns,).

    Attributes:
        names: of the laws.
        bound: the laws, and the slices of their states in s.
        acting: the same with all linear laws combined.
        ns: number of states.
    """

    def __init__(self, laws: Sequence[ForceElement], model: pin.Model) -> None:
        self.nv, self.ns, self.names = model.nv, 0, [law.name for law in laws]
        self.bound: list[Bound] = []
        for law in laws:
            self.bound.append((law, slice(self.ns, self.ns + len(law.states))))
            self.ns += len(law.states)
        linear = [(law, at) for law, at in self.bound if isinstance(law, LinearElement)]
        self.acting: list[Bound] = [(law, at) for law, at in self.bound if not isinstance(law, LinearElement)]
        if linear:
            self.acting.insert(0, (Linear(linear, model, self.ns), slice(0, self.ns)))

    def states(self) -> dict[str, float]:
        """Names ``law.state`` and start values of all states, in the order of s.

        Raises:
            InputError: if two laws with states share a name.
        """
        laws = [law for law, _ in self.bound if law.states]
        names = [law.name for law in laws]
        if len(set(names)) < len(names):
            raise InputError(f"actuators and controllers need names of their own, got {', '.join(names)}")
        return {f"{law.name}.{key}": value for law in laws for key, value in law.states.items()}

    def refuse_lost(self) -> None:
        """Reject a configuration where a force has no direction; kinematics must be current.

        Raises:
            InputError: names the force.
        """
        for law, _ in self.bound:
            if law.direction_undefined():
                raise InputError(f"force {law.name!r} has no direction where its points coincide: no derivative")

    def torque(self, t: float, q: Array, v: Array, s: Array) -> tuple[Array, Array]:
        """Return tau (nv,), and s' and the power of non-conservative forces, (ns + 1,)."""
        conservative, other, rates = self.split_torque(t, q, v, s)
        rates[-1] = other.dot(v)
        return conservative + other, rates

    def split_torque(self, t: float, q: Array, v: Array, s: Array) -> tuple[Part, Array, Array]:
        """Return the conservative and the other part of tau, (nv,) each, and s' with a zero appended, (ns + 1,)."""
        rates = np.zeros(self.ns + 1)
        if not self.acting:
            return 0.0, np.zeros(self.nv), rates
        (law, at), *more = self.acting
        conservative, other, rates[at] = law.evaluate(t, q, v, s[at])
        for law, at in more:
            c, o, ds = law.evaluate(t, q, v, s[at])
            conservative, other = conservative + c, other + o
            if at.start < at.stop:
                rates[at] += ds
        return conservative, other if isinstance(other, np.ndarray) else np.zeros(self.nv), rates

    def partials(self, t: float, q: Array, v: Array, s: Array) -> Array:
        """Return the sum of the partial derivatives, (nv + ns + 1, 2 nv + ns); kinematics must be current at q."""
        nv = self.nv
        out = np.zeros((nv + self.ns + 1, 2 * nv + self.ns))
        for law, at in self.acting:
            known, rows = law.partials(t, q, v, s[at]), slice(nv + at.start, nv + at.stop)
            columns = slice(nv + rows.start, nv + rows.stop)
            for to, block in ((slice(nv), known[:nv]), (rows, known[nv:-1]), (-1, known[-1])):
                out[to, : 2 * nv] += block[..., : 2 * nv]
                out[to, columns] += block[..., 2 * nv :]
        return out

    def by_time(self, t: float, q: Array, v: Array, s: Array) -> Array:
        """Return the sum of `ForceElement.by_time`, (nv + ns + 1,); kinematics must be current at q."""
        nv, out = self.nv, np.zeros(self.nv + self.ns + 1)
        for law, at in self.acting:
            known = np.zeros(nv + at.stop - at.start + 1) + law.by_time(t, q, v, s[at])
            out[:nv] += known[:nv]
            out[nv + at.start : nv + at.stop] += known[nv:-1]
            out[-1] += known[-1]
        return out

    def potential(self, q: Array) -> float:
        """Potential energy in J; kinematics must be current at q."""
        return sum(law.potential(q) for law, _ in self.acting)

    def breaks(self) -> list[float]:
        """Times at which functions of time in the laws are not smooth."""
        return sorted({x for law, _ in self.bound for signal in law.signals for x in signal.breaks})

    def breakpoint(self, t: float, sign: float) -> float:
        """Return the next time after t, in the direction of sign, where a law may jump; sign * inf if none."""
        return sign * min((sign * law.breakpoint(t, sign) for law, _ in self.bound), default=inf)

    def jump(self, t: float, q: Array, v: Array, s: Array) -> Array:
        """Return s just after time t, (ns,); each law receives the states before it."""
        out = s.copy()
        for law, at in self.bound:
            if law.states:
                out[at] = law.jump(t, q, v, s[at])
        return out
