"""Base classes of forces: a description, possibly from a file, and the force law bound to a workspace.

The generalized force tau (nv,) of a law has two parts: one derived from its potential, and one whose work is
integrated along the motion. A law may have internal states s, s' = h(t, q, v, s), which may jump at certain times.
"""

from collections.abc import Mapping, Sequence
from math import inf
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np
import pinocchio as pin
from pydantic import AfterValidator

from ...data_types import CoreData
from ...errors import InputError, NotCompiled, is_number
from ...system import Array
from ..checked_table import Table
from ..time_functions.input_functions import InputSetting
from ..time_functions.time_functions import Constant, TimeFunction
from ..tree.frames import Pair, find_joint, find_joints
from ..tree.wrench_partials import PairPartials

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism

ArrayOrZero = np.ndarray | float
"""An array, or 0 for one of zeros."""


def distinct_joints(names: str | tuple[str, ...], *, context: str = "") -> str | tuple[str, ...]:
    """Return names of joints, unchanged; messages begin with ``context``.

    Raises:
        InputError: for no name, or for a repeated name: the law would act twice on one coordinate.
    """
    if not names:
        raise InputError(f"{context}at least one joint is needed")
    if not isinstance(names, str) and (twice := [n for i, n in enumerate(names) if n in names[:i]]):
        raise InputError(f"{context}joint {twice[0]!r} is listed twice")
    return names


Joints = Annotated[str | tuple[str, ...], AfterValidator(distinct_joints)]
"""The name of a joint, or names of several."""


def distinct_frames(names: tuple[str, str]) -> tuple[str, str]:
    """Return the names of both frames of a force, unchanged.

    Raises:
        ValueError: for the same name twice: the force would have no effect.
    """
    if names[0] == names[1]:
        raise ValueError(f"it joins frame {names[0]!r} with itself")
    return names


FramePair = Annotated[tuple[str, str], AfterValidator(distinct_frames)]
"""The names of two frames."""


class ForceElement:
    """A force bound to a workspace whose kinematics must be current at q when it is called.

    Args:
        name: name in messages.
        time_functions: the functions of time that the law depends on.
        states: names and initial values of its ns states.
    """

    def __init__(
        self, name: str, time_functions: Sequence[TimeFunction] = (), states: Mapping[str, float] | None = None
    ) -> None:
        self.name, self.states = name, dict(states or {})
        self.time_functions = [u for u in time_functions if not isinstance(u, Constant)]

    def evaluate(self, t: float, q: Array, v: Array, s: Array) -> tuple[ArrayOrZero, ArrayOrZero, ArrayOrZero]:
        """Return the conservative and the non-conservative part of tau, (nv,) each, and s' (ns,), or 0 for each."""
        return *self.generalized_force(t, q, v), 0.0

    def generalized_force(self, t: float, q: Array, v: Array) -> tuple[ArrayOrZero, ArrayOrZero]:
        """Return both parts of tau of a law without states, conservative and non-conservative, (nv,) each, or 0."""
        raise NotImplementedError

    def partials(self, t: float, q: Array, v: Array, s: Array) -> Array:
        """Return the partial derivatives of (tau, s', power of the non-conservative part), (nv + ns + 1, 2 nv + ns).

        They are taken with respect to (q, v, s), q in the tangent space, and exact; only Python functions of the user
        without partial derivatives are differentiated by central differences.

        Raises:
            InputError: for a law without partial derivatives.
        """
        users = "implicit methods, equilibria and gradients need the method partials(t, q, v, s) of its law"
        raise InputError(f"force {self.name!r} has no partials: {users} {type(self).__name__}")

    def time_partials(self, t: float, q: Array, v: Array, s: Array) -> Array | float:
        """Return d/dt of (tau, s', power of the non-conservative part) at fixed (q, v, s), (nv + ns + 1,), or 0."""
        return 0.0

    def potential(self, q: Array) -> float:
        """Return the potential energy in J."""
        return 0.0

    def direction_undefined(self) -> bool:
        """Return whether the line of action is undefined, between coincident points; kinematics must be current."""
        return False

    tension = False  # whether the force is a tension along the line between two points
    reversing_pair: Pair | None = None  # frames: the force reverses its direction where their origins pass each other
    finite_differences = False  # whether the partial derivatives are finite differences
    depends_on_state_only = True  # on (t, q, v, s), not on multipliers and modes
    differentiated: Sequence[TimeFunction] = ()  # functions of time whose rates enter the force
    deflections: Sequence[tuple[int, str]] = ()  # of springs: velocity index of the joint or -1, and axis or ""

    def acting_components(self, nv: int) -> list[int]:
        """Return the indices of the velocity components that the force may act on; all if unknown."""
        return list(range(nv))

    def deflection(self, q: Array) -> Array:
        """Return the deflections of the springs, in rad or m, one for each of ``deflections``."""
        return np.empty(0)

    def breakpoint(self, t: float, sign: float) -> float:
        """Return the next time after t, in the direction of sign, at which the law may jump; sign * inf if none."""
        return sign * min((sign * u.breakpoint(t, sign) for u in self.time_functions), default=inf)

    def jump(self, t: float, q: Array, v: Array, s: Array, at: slice) -> Array:
        """Return its states s[at] after a jump at time t, for the s of all laws; kinematics need not be current."""
        return s[at]

    def has_jumped(self, t: float, late: float) -> bool:
        """Return whether the nearest instant of a jump is more than ``late`` units of rounding before t."""
        return False

    external = False  # an external program computes a state of the law besides s

    def input_settings(self, s: Array) -> Mapping[str, InputSetting]:
        """Return the settings of the inputs that the law sets, by name, from its states."""
        return {}

    def set_inputs(self, s: Array, notify: bool = True) -> None:
        """Set the inputs of the mechanism that depend on its states; see `Input.set`."""

    def attach(self, system: "Index2System") -> None:
        """Store the workspace to which the law is bound, if the law uses it."""

    def save(self, s: Array) -> bytes | None:
        """Return the external state that belongs to its states s; None if it cannot be saved; empty before a start."""
        return None

    def detach_program(self) -> object:
        """Detach the external program, and return it; None if there is none."""
        return None

    def attach_program(self, program: object) -> None:
        """Attach an external program, in its current state, that another workspace has detached; or None."""

    def core_data(self) -> CoreData:
        """Return the core data: ``kind``, the name of a file in native/mechanism/laws, and its data.

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
        """Return the wrenches of the conservative and the non-conservative part, and their partials.

        The poses of the pair must be current; V = V_b - V_a (6,).
        """
        raise NotImplementedError

    def wrench_time_rate(self, t: float) -> Array | float:
        """Return d/dt of the wrench at fixed motion, (6,), or 0; the poses of the pair must be current."""
        return 0.0

    def time_partials(self, t: float, q: Array, v: Array, s: Array) -> Array:
        self.pair.locate()
        tau = self.pair.generalized_force(self.wrench_time_rate(t) + np.zeros(6))
        return np.append(tau, tau @ v)

    def partials(self, t: float, q: Array, v: Array, s: Array) -> Array:
        self.pair.locate()
        pair, nv = PairPartials(self.pair, v), len(v)
        i, out = pair.at, np.zeros((nv + 1, 2 * nv))  # i: velocities that move the pair
        conservative, other = self.wrench_partials(t, pair.V)
        K, D = pair.generalized_force(*other), pair.damping(other.C)
        out[-1, i], out[-1, nv + i] = v[i].dot(K), v[i].dot(D) + pair.force(other.F)
        out[i[:, None], i] = K + pair.generalized_force(*conservative)
        out[i[:, None], nv + i] = D + pair.damping(conservative.C)
        return out


class Force(Table):
    """Base of forces that can be described in a file.

    Attributes:
        name: name of the force; the kind and a number if omitted.
    """

    kind: str
    name: str = ""

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:
        """Return the law bound to a workspace, whose kinematics are current when the law is evaluated.

        For classes of other packages the workspace has memory for all algorithms of Pinocchio, 32 nv^3 bytes.

        Raises:
            UnknownNameError, InputError: for unknown or unsuitable frames and joints.
        """
        raise NotImplementedError

    def require_signals(self, mech: "Mechanism") -> None:
        """Check that the signals it names exist; called when the mechanism is created.

        Raises:
            UnknownNameError, InputError: for unknown or unsuitable signals.
        """


class PythonForce:
    """Base of forces defined by Python functions; files refer to them by name only."""

    name: str

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:
        """Return the law bound to a workspace."""
        raise NotImplementedError


def single_coordinate_joints(model: pin.Model, names: Joints, what: str) -> list[pin.JointModel]:
    """Return joints by name, each of one coordinate.

    Raises:
        InputError: for joints of several coordinates.
    """
    joints = find_joints(model, names)
    for j, n in zip(joints, [names] if isinstance(names, str) else names, strict=True):
        if (j.nq, j.nv) != (1, 1):
            got = "is continuous: make it revolute" if j.nv == 1 else f"has nq = {j.nq}, nv = {j.nv}"
            raise InputError(f"{what} needs a joint of one coordinate; {n!r} {got}")
    return joints


def single_velocity_joint(model: pin.Model, name: str, what: str) -> pin.JointModel:
    """Return a joint by name, with one velocity.

    Raises:
        InputError: for a joint of several velocities.
    """
    j = find_joint(model, name)
    if j.nv != 1:
        raise InputError(f"{what} needs a joint with one velocity; {name!r} has {j.nv}")
    return j


def start_values(name: str, start: Mapping[str, float]) -> dict[str, float]:
    """Return names and initial values of states as floats.

    Raises:
        InputError: unless ``start`` is a table of names and finite numbers.
    """
    if not (isinstance(start, Mapping) and all(map(is_number, start.values()))):
        raise InputError(f"the states of {name!r} start from a table of names and finite numbers, got {start!r:.80}")
    return {str(key): float(value) for key, value in start.items()}
