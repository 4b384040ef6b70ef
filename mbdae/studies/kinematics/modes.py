"""Assembly modes: all poses in which a mechanism with one freedom can be put together at one value of its input.

They are looked for from random starts until no new one has turned up for long. Modes that the mechanism reaches from
each other by moving belong to one circuit (Chase, Mirth, J. Mech. Design 115 (1993)).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...errors import InputError, StepError, require, several
from ...mechanism import Mechanism
from ...mechanism.assembly import gauss_newton, is_closed
from ...mechanism.frames import find_joints
from ...mechanism.joints import lengths, turning
from ...mechanism.units import PARTS
from ...system import Array
from ...tabular import Tabular
from .curve import NEAR, PoseCurve
from .driven import Hold, check_freedom, driven, input_at, start_pose

__all__ = ["assembly_modes"]

STARTS, FOR_EACH = 60, 40  # random starts, and more for each mode that was found
BESIDE = 1e-6  # of the largest singular value: modes that coincide
LONGEST = 100.0  # rad and m: how far a circuit is followed


@dataclass(frozen=True)
class AssemblyMode:
    """One way to put a mechanism together.

    Attributes:
        label: the circuit's number and a letter, ``"1a"``: a is the model's own start on circuit 1 if it is there.
        circuit: modes with one number move into each other.
        q: configuration, (nq,).
        rising: whether the input rises along the circuit here, seen from its first mode.
        margin: smallest singular value of all rows over the largest: zero where two modes coincide.
    """

    label: str
    circuit: int
    q: Array
    rising: bool
    margin: float


@dataclass(frozen=True)
class AssemblyModes(Tabular):
    """All modes that were found.

    Attributes:
        mechanism: the mechanism.
        drive: name of the input.
        u: its value in rad or m.
        modes: sorted by circuit.
        starts: from how many random starts.
    """

    mechanism: Mechanism
    drive: str
    u: float
    modes: tuple[AssemblyMode, ...]
    starts: int

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        modes = [{**vars(m), "q": m.q.tolist()} for m in self.modes]
        return {"title": self.mechanism.title, "drive": self.drive, "u": self.u, "starts": self.starts, "modes": modes}

    def __str__(self) -> str:
        n, circuits = len(self.modes), len({m.circuit for m in self.modes})
        text = f"{self.mechanism.title}: {n} assembly modes at {self.drive} = {self.u:.6g}, on {circuits} circuits"
        lines = [f"{text}, from {self.starts} starts"]
        for m in self.modes:
            sense = "rises" if m.rising else "falls"
            lines.append(f"  {m.label}: {_words(self.mechanism, m.q)}; {self.drive} {sense}, margin {m.margin:.2g}")
        return "\n".join(lines)


def assembly_modes(
    mech: Mechanism,
    drive: str,
    at: float | None = None,
    *,
    hold: Hold = (),
    apart: str | Sequence[str] = (),
    most: int = 2000,
) -> AssemblyModes:
    """Find all poses of a mechanism with one freedom at one value of its input: the solutions of g(q) = 0, q_drive = u.

    They are looked for from random starts; those that move into each other belong to one circuit. Source: Chase,
    Mirth, J. Mech. Design 115 (1993).

    Args:
        mech: the mechanism.
        drive: a joint of one coordinate, or a driver of the mechanism.
        at: the input in rad or m; that of the model's start when left out.
        hold: joints that stand still, as in `mbdae.kinematics`.
        apart: joints by which modes are told apart; all when left out. Legs that may be mounted turned over double the
            number of modes each, and the platform does not see it.
        most: random starts at most.

    Raises:
        UnknownNameError: for a joint that does not exist.
        InputError: as `mbdae.kinematics`, or where no pose is found.
    """
    require(mech, Mechanism, "assembly_modes takes a Mechanism (see mbdae.load)")
    q0 = start_pose(mech)
    moved = driven(mech, drive, hold, q0)
    system = moved.system()
    check_freedom(moved, system, q0, drive, [d.joint or d.name for d in moved.drivers[:-1]])
    here = input_at(moved, system, q0)
    if at is not None and not np.isfinite(at):
        raise InputError(f"the input must be a number, got {at!r}")
    u = here if at is None else float(at)
    curve = PoseCurve(system, turning(mech.model))
    names = several(apart, "apart is a list of joints") or mech.joint_names
    counts = np.zeros(mech.nv, bool)
    for joint in find_joints(mech.model, names):
        counts[joint.idx_v : joint.idx_v + joint.nv] = True
    poses, starts = _search(curve, q0, u, counts, most)
    if not poses:
        raise InputError(f"no pose was found at {drive!r} = {u:.6g} from {starts} starts: it may not reach there")
    return AssemblyModes(mech, drive, u, _labelled(curve, poses, u), starts)


def _search(curve: PoseCurve, q0: Array, u: float, counts: Array, most: int) -> tuple[list[Array], int]:
    """Closed poses from the given one and from random ones, each once."""
    system, rng = curve.system, np.random.default_rng(0)
    model = system.model
    size = max([1e-3, *(float(np.linalg.norm(p.translation)) for p in model.jointPlacements)])
    widths = np.where(lengths(model), 2 * size, np.pi)
    poses: list[Array] = []
    found_at = 0
    for n in range(most):
        x = rng.uniform(-1, 1, system.nv) * widths if n else np.zeros(system.nv)
        q = gauss_newton(system, curve.manifold.integrate(q0, x), np.arange(system.nv), u)
        if is_closed(system, q, u) and not any(np.abs(curve.wrapped(p, q)[counts]).max() < 100 * NEAR for p in poses):
            poses.append(_unwound(curve, q0, q))
            found_at = n
        if n >= STARTS and n - found_at >= FOR_EACH * max(1, len(poses)):
            return poses, n + 1
    return poses, most


def _unwound(curve: PoseCurve, q0: Array, q: Array) -> Array:
    """The same pose with its angles within half a turn of the start's."""
    return curve.manifold.integrate(q0, curve.wrapped(q0, q))


def _labelled(curve: PoseCurve, poses: list[Array], u: float) -> tuple[AssemblyMode, ...]:
    left, modes, circuit = dict(enumerate(poses)), [], 0
    while left:
        first = next(iter(left))
        circuit += 1
        others = {k: rising for k, rising in _reached(curve, left, first, u).items() if k != first}
        for letter, (k, rising) in zip(_letters(), {first: True, **others}.items(), strict=False):
            sizes = np.linalg.svd(curve.system.closures(left[k], u)[1], compute_uv=False)[: curve.system.nv]
            label = f"{circuit}{letter}"
            modes.append(AssemblyMode(label, circuit, left.pop(k), rising, float(sizes[-1] / sizes[0])))
    return tuple(modes)


def _reached(curve: PoseCurve, poses: dict[int, Array], first: int, u: float) -> dict[int, bool]:
    """Which poses the circuit of one passes, and whether the input rises there."""
    out: dict[int, bool] = {}
    way = PoseCurve(curve.system, curve.turning)
    try:
        way.begin(poses[first], u)
        way.follow(u - LONGEST, u + LONGEST)
        for i, (a, b) in enumerate(pairwise(way.nodes)):
            for k, q in poses.items():
                ahead = way.wrapped(a.q, q)
                if np.abs(ahead).max() > 2 * (b.s - a.s) or not 0 <= ahead @ a.tau <= b.s - a.s:
                    continue
                at = way.at(i, float(ahead @ a.tau))
                if np.abs(way.wrapped(at.q, q)).max() < 0.01 * (b.s - a.s):
                    out.setdefault(k, at.speed > 0)
    except (StepError, ValueError):
        pass  # a singular pose: what was reached before it counts
    return out


def _letters() -> list[str]:
    small = [chr(ord("a") + i) for i in range(26)]
    return small + [a + b for a in small for b in small]


def _words(mech: Mechanism, q: Array) -> str:
    """The coordinates of a pose."""
    out = []
    for name, joint in zip(mech.joint_names, find_joints(mech.model, mech.joint_names), strict=True):
        values = q[joint.idx_q : joint.idx_q + joint.nq]
        if (joint.nq, joint.nv) == (2, 1):
            values = np.array([np.arctan2(values[1], values[0])])
        parts = PARTS.get(mech.joint_kind(name), (("",),))[0] if len(values) > 1 else ("",)
        out += [f"{name}{'.' if p else ''}{p} {x:.4g}" for p, x in zip(parts, values, strict=False)]
    return ", ".join(out)
