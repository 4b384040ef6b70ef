"""All force laws of a workspace: the sum of their forces, and their states."""

from collections.abc import Sequence
from math import inf
from typing import TYPE_CHECKING, Self

import numpy as np
import pinocchio as pin

from ...errors import InputError, StepError
from .force import Array, ArrayOrZero, ForceElement
from .linear import Linear, LinearElement

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System

BoundLaw = tuple[ForceElement, slice]
"""A law and the slice of its states in s."""


def coincident(name: str) -> InputError:
    """Return the error for derivatives of a force whose points coincide."""
    return InputError(f"force {name!r} has no direction where its points coincide: no derivative")


class ForceElements:
    """All force laws of a workspace; their states are concatenated to s (ns,).

    Attributes:
        names: names of the laws.
        bound: the laws, each with the slice of its states in s.
        acting: the same, with all linear laws combined into one.
        ns: number of states.
        time_dependent: the laws that depend on time, including sampled laws.
    """

    def __init__(self, laws: Sequence[ForceElement], model: pin.Model) -> None:
        self.nv, self.ns, self.names = model.nv, 0, [law.name for law in laws]
        self.bound: list[BoundLaw] = []
        for law in laws:
            self.bound.append((law, slice(self.ns, self.ns + len(law.states))))
            self.ns += len(law.states)
        linear = [(law, at) for law, at in self.bound if isinstance(law, LinearElement)]
        self.acting: list[BoundLaw] = [(law, at) for law, at in self.bound if not isinstance(law, LinearElement)]
        if linear:
            self.acting.insert(0, (Linear(linear, model, self.ns), slice(0, self.ns)))
        self._external = [(law, at) for law, at in self.bound if law.external]
        jumps = ForceElement.breakpoint
        self.time_dependent = [law for law, _ in self.bound if law.time_functions or type(law).breakpoint is not jumps]
        self._without_potential = [type(law).potential is ForceElement.potential for law, _ in self.acting]

    def attached(self, system: "Index2System") -> Self:
        """Attach all laws to their workspace, and return them."""
        for law, _ in self.bound:
            law.attach(system)
        return self

    def states(self) -> dict[str, float]:
        """Return names ``law.state`` and initial values of all states, in the order of s.

        Raises:
            InputError: if two laws with states share a name.
        """
        laws = [law for law, _ in self.bound if law.states]
        names = [law.name for law in laws]
        if len(set(names)) < len(names):
            raise InputError(f"actuators and controllers need different names, got {', '.join(names)}")
        return {f"{law.name}.{key}": value for law in laws for key, value in law.states.items()}

    def require_directions(self) -> None:
        """Require that each force has a direction; kinematics must be current.

        Raises:
            InputError: for a force between coincident points.
        """
        for law, _ in self.bound:
            if law.direction_undefined():
                raise coincident(law.name)

    def generalized_force(self, t: float, q: Array, v: Array, s: Array) -> tuple[Array, Array]:
        """Return tau (nv,), and s' and the power of non-conservative forces, (ns + 1,)."""
        conservative, other, rates = self.split_generalized_force(t, q, v, s)
        rates[-1] = other.dot(v)
        return conservative + other, rates

    def split_generalized_force(self, t: float, q: Array, v: Array, s: Array) -> tuple[ArrayOrZero, Array, Array]:
        """Return the conservative and the non-conservative part of tau, (nv,) each, and s' and a zero, (ns + 1,).

        Raises:
            StepError: for a law with a conservative part that has no potential energy.
        """
        conservative: ArrayOrZero = 0.0
        other: ArrayOrZero = 0.0
        rates = np.zeros(self.ns + 1)
        for (law, at), without_potential in zip(self.acting, self._without_potential, strict=True):
            c, o, ds = law.evaluate(t, q, v, s[at])
            if without_potential and np.count_nonzero(c):
                method = f"{type(law).__name__} needs the method potential(q), or the other part contains it"
                raise StepError("force", f"force {law.name!r} has a conservative part without a potential: {method}")
            conservative, other = conservative + c, other + o
            if at.start < at.stop:
                rates[at] += ds
        return conservative, other if isinstance(other, np.ndarray) else np.zeros(self.nv), rates

    def partials(self, t: float, q: Array, v: Array, s: Array, each: list[Array] | None = None) -> Array:
        """Return the sum of the partial derivatives, (nv + ns + 1, 2 nv + ns); kinematics must be current at q.

        Those of the acting laws, one by one, are appended to ``each`` if given.
        """
        nv = self.nv
        out = np.zeros((nv + self.ns + 1, 2 * nv + self.ns))
        for law, at in self.acting:
            D, rows = law.partials(t, q, v, s[at]), slice(nv + at.start, nv + at.stop)
            if each is not None:
                each.append(D)
            columns = slice(nv + rows.start, nv + rows.stop)
            for target, block in ((slice(nv), D[:nv]), (rows, D[nv:-1]), (-1, D[-1])):
                out[target, : 2 * nv] += block[..., : 2 * nv]
                out[target, columns] += block[..., 2 * nv :]
        return out

    def time_partials(self, t: float, q: Array, v: Array, s: Array) -> Array:
        """Return the sum of `ForceElement.time_partials`, (nv + ns + 1,); kinematics must be current at q."""
        nv, out = self.nv, np.zeros(self.nv + self.ns + 1)
        for law, at in self.acting:
            d = np.zeros(nv + at.stop - at.start + 1) + law.time_partials(t, q, v, s[at])
            out[:nv] += d[:nv]
            out[nv + at.start : nv + at.stop] += d[nv:-1]
            out[-1] += d[-1]
        return out

    def potential(self, q: Array) -> float:
        """Return the potential energy in J; kinematics must be current at q."""
        return sum(law.potential(q) for law, _ in self.acting)

    def nonsmooth_times(self) -> list[float]:
        """Return the times at which functions of time in the laws are not smooth."""
        return sorted({x for law in self.time_dependent for u in law.time_functions for x in u.nonsmooth_times})

    def breakpoint(self, t: float, sign: float) -> float:
        """Return the next time after t, in the direction of sign, at which a law may jump; sign * inf if none."""
        return sign * min((sign * law.breakpoint(t, sign) for law in self.time_dependent), default=inf)

    def external_states(self, s: Array) -> dict[str, bytes | None]:
        """Return the states of external programs by name of the law; None if a program cannot save its state."""
        return {law.name: law.save(s[at]) for law, at in self._external}

    def set_inputs(self, s: Array, notify: bool = True) -> None:
        """Set the inputs that laws derive from their states; see `Input.set`."""
        for law, at in self._external:
            law.set_inputs(s[at], notify)

    def detach_programs(self) -> list[object]:
        """Detach the external programs of all laws, and return them; None for laws without one."""
        return [law.detach_program() for law, _ in self.bound]

    def attach_programs(self, programs: Sequence[object]) -> None:
        """Attach the external programs that the laws of another workspace have detached."""
        for (law, _), program in zip(self.bound, programs, strict=True):
            law.attach_program(program)

    def jump(self, t: float, q: Array, v: Array, s: Array, late: float = inf) -> Array:
        """Return s after a jump at time t, (ns,), and set inputs; each law receives the states before the jump.

        Laws that have jumped more than ``late`` units of rounding before t keep their states.
        """
        out = s.copy()
        for law, at in self.bound:
            if law.states and not law.has_jumped(t, late):
                out[at] = law.jump(t, q, v, s, at)
        self.set_inputs(out)
        return out
