"""Base of forces: a description, possibly from a file, is bound to a workspace and becomes a law.

A law's generalised force tau (nv,) has two parts: one derived from its potential, and one whose work is integrated
along the motion. A law may have internal states s, s' = h(t, q, v, s), which may jump at certain times.
"""

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ...errors import InputError, NotCompiled
from ...system import Array
from ..checked_table import Table
from ..frames import Pair, find_joint, find_joints
from ..time_functions import Constant, TimeFunction
from ..wrench_partials import PairPartials

Part = np.ndarray | float
Joints = str | tuple[str, ...]


class ForceElement:
    """A force bound to a workspace whose kinematics must be current at q when it is called.

    Args:
        name: for messages.
        signals: the functions of time in it.
        states: names of its ns states and their start values.
    """

    def __init__(
        self, name: str, signals: Sequence[TimeFunction] = (), states: Mapping[str, float] | None = None
    ) -> None:
        self.name, self.states = name, dict(states or {})
        self.signals = [s for s in signals if not isinstance(s, Constant)]

    def evaluate(self, t: float, q: Array, v: Array, s: Array) -> tuple[Part, Part, Part]:
        """Return the conservative and the other part of tau, (nv,) each, and s' (ns,); 0 for missing parts."""
        return *self.torque(t, q, v), 0.0

    def torque(self, t: float, q: Array, v: Array) -> tuple[Part, Part]:
        """Return the conservative and the other part of tau of a law without states, (nv,) each, or 0."""
        raise NotImplementedError

    def partials(self, t: float, q: Array, v: Array, s: Array) -> Array:
        """Return the exact derivatives of (tau, s', power of the other part), (nv + ns + 1, 2 nv + ns).

        They are taken with respect to (q, v, s), q in the tangent. Python functions of the user without partial
        derivatives are differentiated by central differences.

        Raises:
            InputError: for a law without partial derivatives.
        """
        what = "implicit methods, equilibria and gradients take the method partials(t, q, v, s) of its law"
        raise InputError(f"force {self.name!r} has no partials: {what} {type(self).__name__}")

    def by_time(self, t: float, q: Array, v: Array, s: Array) -> Array | float:
        """Return the derivative of (tau, s', power of the other part) with respect to time, (nv + ns + 1,), or 0."""
        return 0.0

    def potential(self, q: Array) -> float:
        """Potential energy in J."""
        return 0.0

    def direction_undefined(self) -> bool:
        """Return whether its line of action is undefined because its ends coincide; kinematics must be current."""
        return False

    tension = False  # a tensile force between two points
    differenced = False  # its partial derivatives are finite differences
    by_state = True  # it depends on (t, q, v, s) only, not on multipliers and modes
    deflections: Sequence[tuple[int, str]] = ()  # of springs: a velocity index and "", or -1 and a description

    def acting_components(self, nv: int) -> list[int]:
        """Velocity components that it may act on; all if unknown."""
        return list(range(nv))

    def deflection(self, q: Array) -> Array:
        """Return the deflections of its springs, in rad or m, one for each of ``deflections``."""
        return np.empty(0)

    def breakpoint(self, t: float, sign: float) -> float:
        """Return the next time after t, in the direction of sign, where the law may jump; sign * inf if none."""
        return sign * min((sign * s.breakpoint(t, sign) for s in self.signals), default=inf)

    def jump(self, t: float, q: Array, v: Array, s: Array) -> Array:
        """Return s just after time t, (ns,); kinematics need not be current."""
        return s

    def core_data(self) -> dict[str, Any]:
        """Return the core data: ``kind``, the name of a file in native/mechanism/laws, and its arguments.

        Raises:
            NotCompiled: if the core does not support it.
        """
        raise NotCompiled(f"force {self.name!r} of kind {type(self).__name__}")


class WrenchPartials(NamedTuple):
    """A wrench F (6,) on b, -F on a, and its partials: dF = Da d_a + Db d_b + C d(V_b - V_a), (6, 6) each.

    Motions d of the frames are taken at constant V.
    """

    F: Array
    Da: Array
    Db: Array
    C: Array


class PairElement(ForceElement):
    """A law without states between the frames of a `Pair`."""

    pair: Pair

    def wrench_partials(self, t: float, V: Array) -> tuple[WrenchPartials, WrenchPartials]:
        """Return the wrenches of the conservative and the other part; the pair is located, V = V_b - V_a (6,)."""
        raise NotImplementedError

    def wrench_time_rate(self, t: float) -> Array | float:
        """Return the time derivative of the wrench at fixed motion, (6,), or 0; the pair is located."""
        return 0.0

    def by_time(self, t: float, q: Array, v: Array, s: Array) -> Array:
        self.pair.locate()
        tau = self.pair.torque(self.wrench_time_rate(t) + np.zeros(6))
        return np.append(tau, tau @ v)

    def partials(self, t: float, q: Array, v: Array, s: Array) -> Array:
        self.pair.locate()
        here, nv = PairPartials(self.pair, v), len(v)
        at, out = self.pair.branches.at, np.zeros((nv + 1, 2 * nv))
        conservative, other = self.wrench_partials(t, here.V)
        K, D = here.torque(*other), here.damping(other.C)
        out[-1, at], out[-1, nv + at] = v[at].dot(K), v[at].dot(D) + here.sign * other.F.dot(here.J)
        out[at[:, None], at] = K + here.torque(*conservative)
        out[at[:, None], nv + at] = D + here.damping(conservative.C)
        return out


class Force(Table):
    """Base of forces that can be described in a file.

    Attributes:
        name: the kind and a number when left out.
    """

    kind: str
    name: str = ""

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:
        """Return the law in a workspace, whose kinematics are current when the law is evaluated.

        Bound by a class of another package, the workspace has room for all algorithms of Pinocchio, 32 nv^3 bytes.

        Raises:
            UnknownNameError, InputError: for unknown or unsuitable frames and joints.
        """
        raise NotImplementedError


class PythonForce:
    """Base of forces defined by Python functions; files refer to them by name only."""

    name: str

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:
        """Return the law in a workspace."""
        raise NotImplementedError


def single(model: pin.Model, names: Joints, what: str) -> list[pin.JointModel]:
    """Return joints of one coordinate.

    Raises:
        InputError: for other joints.
    """
    joints = find_joints(model, names)
    for j, n in zip(joints, [names] if isinstance(names, str) else names, strict=True):
        if (j.nq, j.nv) != (1, 1):
            raise InputError(f"{what} needs a joint of one coordinate; {n!r} has nq = {j.nq}, nv = {j.nv}")
    return joints


def one_velocity(model: pin.Model, name: str, what: str) -> pin.JointModel:
    """Return a joint of one velocity.

    Raises:
        InputError: for another joint.
    """
    j = find_joint(model, name)
    if j.nv != 1:
        raise InputError(f"{what} needs a joint with one velocity; {name!r} has {j.nv}")
    return j


def start_values(name: str, start: Mapping[str, float]) -> dict[str, float]:
    """Return names and start values of states as floats.

    Raises:
        InputError: for any other value.
    """
    numbers = isinstance(start, Mapping) and all(
        isinstance(x, int | float | np.number) and np.isfinite(x) for x in start.values()
    )
    if not numbers:
        raise InputError(f"the states of {name!r} start from a table of names and finite numbers, got {start!r:.80}")
    return {str(key): float(value) for key, value in start.items()}
