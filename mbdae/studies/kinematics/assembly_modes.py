"""Assembly modes: all poses of a mechanism with one degree of freedom at one value of its input.

They are searched from random starts. Modes between which the mechanism can move belong to one circuit
(Chase, Mirth, J. Mech. Design 115 (1993)), which is traced from each new mode.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from ...data_types import JsonObject
from ...errors import InputError, as_list, is_count, is_number
from ...mechanism import Mechanism, ModelSource
from ...mechanism.assembly.assembly import start_configuration
from ...mechanism.tree.coordinate_units import COORDINATE_NAMES, coordinate_units
from ...mechanism.tree.frames import find_joints
from ...solution.problem import mechanism_of
from ...system import Array
from ...tabular import Tabular, rounded_zero
from ...units import quantity
from .driven_mechanism import Hold, driven_mechanism, input_at, omitted_elements, require_one_dof
from .mode_search import ModeSearch, coordinates_in_couplings_only

__all__ = ["assembly_modes"]


@dataclass(frozen=True)
class AssemblyMode:
    """An assembly mode.

    Attributes:
        label: number of the circuit and a letter; ``"1a"`` is the model's start, if it is a mode.
        circuit: number of its circuit: a mechanism can move between modes of one circuit.
        q: configuration, (nq,).
        rising: whether the input increases along the circuit at this mode, in the direction of its first mode.
        margin: ratio of the smallest to the largest singular value of all rows: zero where two modes coincide.
        hits: number of random starts that led to it.
    """

    label: str
    circuit: int
    q: Array
    rising: bool
    margin: float
    hits: int


@dataclass(frozen=True)
class AssemblyModes(Tabular):
    """All modes that were found.

    Attributes:
        mechanism: the mechanism.
        drive: name of the input.
        u: its value in rad or m.
        modes: sorted by circuit.
        starts: number of random starts.
        closed: number of starts that led to a mode.
        warnings: reasons why modes may be missing.
    """

    mechanism: Mechanism
    drive: str
    u: float
    modes: tuple[AssemblyMode, ...]
    starts: int
    closed: int
    warnings: tuple[str, ...] = ()

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        modes = [{**vars(m), "q": m.q.tolist()} for m in self.modes]
        found = {"starts": self.starts, "closed": self.closed}
        title = {"title": self.mechanism.title, "drive": self.drive, "u": self.u}
        return {**title, **found, "warnings": list(self.warnings), "modes": modes}

    def __str__(self) -> str:
        n, circuits = len(self.modes), len({m.circuit for m in self.modes})
        unit = coordinate_units(self.mechanism).get(f"v.{self.drive}", "").removesuffix("/s")
        modes, on = (f"{k} {noun}{'s' if k != 1 else ''}" for k, noun in ((n, "assembly mode"), (circuits, "circuit")))
        text = f"{self.mechanism.title}: {modes} at {self.drive} = {quantity(self.u, unit)}, on {on}"
        lines = [f"{text}, from {self.starts} starts of which {self.closed} closed"]
        if self.closed:
            rarest = min(m.hits for m in self.modes)
            lines[0] += (
                f"; the rarest was found {rarest} times; a mode that fewer than 1 in {max(1, self.closed // 3)} "
            )
            lines[0] += "of the closed starts lead to may be missing"
        for m in self.modes:
            sense = "increases" if m.rising else "decreases"
            lines.append(
                f"  {m.label}: {_coordinates_text(self.mechanism, m.q)}; {self.drive} {sense}, margin {m.margin:.2g}"
            )
        lines += [f"  doubtful: {warning}" for warning in self.warnings]
        return "\n".join(lines)


def assembly_modes(
    mech: Mechanism | ModelSource,
    drive: str,
    at: float | None = None,
    *,
    hold: Hold = (),
    apart: str | Sequence[str] = (),
    most: int = 2000,
) -> AssemblyModes:
    """Find all poses of a mechanism with one degree of freedom at an input u: the solutions of g(q) = 0, q_drive = u.

    They are searched from random starts, and along the circuits of the modes found, until each has been found three
    times and another mode as likely as these would be missed with a probability of 1 %. Modes between which the
    mechanism can move belong to one circuit. Source: Chase, Mirth, J. Mech. Design 115 (1993).

    Poses that differ by full turns of joints are one mode, even if a wheel or rack that is moved by couplings alone has
    a different position; so are those with other angles of several axes between two bodies, of a ball joint of three
    hinges with massless links.

    Args:
        mech: the mechanism, or an argument of `mbdae.load`.
        drive: the input: a joint of one coordinate, or a driver of the mechanism.
        at: value of the input, in rad or m; the start when left out.
        hold: joints to lock in place, or at given values: joint=value. See `mbdae.kinematics`.
        apart: joints that distinguish the modes; by default all that do not merely count turns. Each leg that can be
            assembled in two ways doubles the number of modes without moving the platform.
        most: largest number of random starts.

    Raises:
        UnknownNameError: for a joint that does not exist.
        InputError: as `mbdae.kinematics`, or if no pose is found.
    """
    mech = mechanism_of(mech, "assembly_modes")
    q0 = start_configuration(mech)
    driven = driven_mechanism(mech, drive, hold, q0)
    system = driven.system()
    require_one_dof(driven, system, q0, drive, [d.joint or d.name for d in driven.drivers[:-1]], omitted_elements(mech))
    u_start = input_at(driven, system, q0)
    if at is not None and not is_number(at):
        raise InputError(f"the input must be a number, got {at!r:.60}")
    if not is_count(most, 1):
        raise InputError(f"most must be a positive number of starts, got {most!r:.60}")
    u = u_start if at is None else float(at)
    names = as_list(apart, "apart is a list of joints")
    distinguishing = ~coordinates_in_couplings_only(driven, system, u) if not names else np.zeros(mech.nv, bool)
    for joint in find_joints(mech.model, names):
        distinguishing[joint.idx_v : joint.idx_v + joint.nv] = True
    search = ModeSearch(driven, q0, u, distinguishing).run(most)
    if not search.modes:
        text = f"no pose was found at {drive!r} = {u:.6g} from {search.starts} starts"
        raise InputError(f"{text}: the mechanism may not assemble there")
    return AssemblyModes(mech, drive, u, _labelled(search), search.starts, search.closed, tuple(search.warnings))


def _labelled(search: ModeSearch) -> tuple[AssemblyMode, ...]:
    modes = []
    for number, members in groupby(search.modes, key=lambda m: m.circuit):
        for letter, m in zip(_letters(), members, strict=False):
            modes.append(AssemblyMode(f"{number}{letter}", number, m.q, m.rising, m.margin, m.hits))
    return tuple(modes)


def _letters() -> list[str]:
    letters = [chr(ord("a") + i) for i in range(26)]
    return letters + [a + b for a in letters for b in letters]


def _coordinates_text(mech: Mechanism, q: Array) -> str:
    """Return the coordinates of a pose as text."""
    out, units = [], coordinate_units(mech)
    for name, joint in zip(mech.joint_names, find_joints(mech.model, mech.joint_names), strict=True):
        at = slice(joint.idx_q, joint.idx_q + joint.nq)
        values = [rounded_zero(x, scale) for x, scale in zip(q[at], mech.q_scales[at], strict=True)]
        if (joint.nq, joint.nv) == (2, 1):
            values = [np.arctan2(values[1], values[0])]
        components = COORDINATE_NAMES.get(mech.joint_kind(name), (("",),))[0] if len(values) > 1 else ("",)
        names = [f"{name}.{c}" if c else name for c in components]
        known = [units.get(f"q.{n}", "") for n in names]
        out += [f"{n} {quantity(x, u, '.4g')}" for n, u, x in zip(names, known, values, strict=False)]
    return ", ".join(out)
