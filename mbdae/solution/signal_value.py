"""Values of signals of a mechanism at a single point, by the names of `Solution.signals`."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from ..data_types import CoreData
from ..errors import InputError, UnknownNameError, require
from ..mechanism import Mechanism
from ..mechanism.formulations.slip_friction import with_slip_friction
from ..mechanism.hybrid.kinds.unilateral import Unilateral
from ..mechanism.hybrid.mode_point import AllRows
from ..mechanism.signals.contacts import rolling_closures
from ..mechanism.tree.coordinate_units import acceleration_units, component_suffixes
from ..mechanism.tree.frames import anchor, find_joint, frame_index, skew
from ..mechanism.tree.tree_terms import update_poses
from ..system import Array
from .columns import force_rows, moving_frames, reaction_units, row_names
from .signals import effort_rows, signals, units

if TYPE_CHECKING:
    from ..mechanism.formulations.index2 import Index2System

SUMS = ("kinetic", "potential", "energy")
RESIDUALS = ("g", "Gv")
PYTHON_KINDS = ("column", "gap", "position", "reaction")  # kinds that the core does not support
STATE_KINDS = ("position", "gap", *SUMS, *RESIDUALS)  # kinds that do not need accelerations
RUN_PREFIXES = ("mode", "impulse", "work")  # prefixes of signals without a value at a point


class SignalValue(NamedTuple):
    """Definition of a signal: its kind, and its index in y, in y' or in the rows.

    Attributes:
        kind: ``"t"``; ``"y"``, a component of y = (q, v, s, w); ``"rate"``, one of y' in the tangent; ``"angle"`` of a
            circle in q; ``"lam"``, ``"force"``, ``"torque"``; one of kinetic, potential, energy, g, Gv; or
            ``"position"``, ``"gap"`` of a switch, ``"column"`` of `mbdae.solution.signals.units` and ``"reaction"``
            of a joint or closure, which the core does not support.
        i: index in y or y'; for an angle, of its cosine in q; for a column, of the column; for a position, of its
            axis; for a gap, of its switch.
        rate: index in the tangent y' of its time derivative; -1 if there is none.
        rows: rows of closures; for a position, the index of the frame in the model.
    """

    kind: str
    i: int = 0
    rate: int = -1
    rows: tuple[int, ...] = ()

    @property
    def compiled(self) -> bool:
        """Whether the core supports it."""
        return self.kind not in PYTHON_KINDS

    def core_data(self) -> CoreData:
        """Return the definition as core data."""
        return {"kind": self.kind, "i": self.i, "rate": self.rate, "rows": list(self.rows)}


@dataclass(frozen=True)
class SinglePoint:
    """A single point with the attributes of a solution that `signals` uses: all arrays have one row."""

    mechanism: Mechanism
    t: Array
    q: Array
    v: Array
    s: Array
    vdot: Array
    lam: Array


_KNOWN: WeakKeyDictionary[Mechanism, dict[str, SignalValue]] = WeakKeyDictionary()  # mechanisms are immutable


def signal_values(mech: Mechanism) -> dict[str, SignalValue]:
    """Return all signals of a mechanism by name, those of `mbdae.solution.signals.signals`."""
    if mech not in _KNOWN:
        _KNOWN[mech] = _all_signals(mech)
    return _KNOWN[mech]


def _all_signals(mech: Mechanism) -> dict[str, SignalValue]:
    nq, nv, ns = mech.nq, mech.nv, len(mech.states)
    out = {"t": SignalValue("t"), **_coordinates(mech)}
    out |= {f"s.{name}": SignalValue("y", nq + nv + i, 2 * nv + i) for i, name in enumerate(mech.states)}
    out["work"] = SignalValue("y", nq + nv + ns, 2 * nv + ns)
    out |= {name: SignalValue(name) for name in (*SUMS, *RESIDUALS)}
    out |= {name: SignalValue("lam", rows=(i,)) for i, name in enumerate(row_names(mech))}
    out |= {name: SignalValue("rate", nv + i) for i, name in enumerate(acceleration_units(mech))}
    for name, rows in force_rows(mech).items():
        out[f"force.{name}"] = SignalValue("force", rows=tuple(rows))
        out[f"torque.{name}"] = SignalValue("torque", rows=tuple(mech.rows_of(name)))
    out |= _contact_forces(mech)
    out |= _positions(mech)
    out |= {f"effort.{name}": SignalValue("lam", rows=(i,)) for name, i in effort_rows(mech).items()}
    out |= {f"gap.{s.name}": SignalValue("gap", s.index) for s in mech.switches if isinstance(s, Unilateral)}
    reactions = reaction_units(mech)
    return {
        name: out[name] if name in out else SignalValue("reaction" if name in reactions else "column", i)
        for i, name in enumerate(units(mech))
    }


def _coordinates(mech: Mechanism) -> dict[str, SignalValue]:
    """Return coordinates and velocities of all joints."""
    nq, nv = mech.nq, mech.nv
    q: dict[str, SignalValue] = {}
    v: dict[str, SignalValue] = {}
    for name in mech.joint_names:
        j, (q_suffixes, v_suffixes) = find_joint(mech.model, name), component_suffixes(mech, name)
        v |= {f"v.{name}{x}": SignalValue("y", nq + j.idx_v + k, nv + j.idx_v + k) for k, x in enumerate(v_suffixes)}
        if (j.nq, j.nv) == (2, 1):
            q[f"q.{name}"] = SignalValue("angle", j.idx_q, j.idx_v)
            continue
        rates = [j.idx_v + k if j.nq == j.nv else -1 for k in range(j.nq)]
        q |= {f"q.{name}{x}": SignalValue("y", j.idx_q + k, rates[k]) for k, x in enumerate(q_suffixes)}
    return q | v


def _positions(mech: Mechanism) -> dict[str, SignalValue]:
    """Return positions of all frames."""
    out: dict[str, SignalValue] = {}
    for name in moving_frames(mech):
        frame = frame_index(mech.model, name)
        out |= {f"position.{name}.{axis}": SignalValue("position", i, rows=(frame,)) for i, axis in enumerate("xyz")}
    return out


def _contact_forces(mech: Mechanism) -> dict[str, SignalValue]:
    """Return those normal, longitudinal and lateral forces of rolling bodies that are multipliers."""
    out: dict[str, SignalValue] = {}
    for c in rolling_closures(mech):
        first, grip = mech.rows_of(c.name)[0], int(c.contact is not False)
        if c.contact is not False:
            out[f"normal.{c.name}"] = SignalValue("lam", rows=(first,))
        if c.grip in (None, "full"):
            out[f"longitudinal.{c.name}"] = SignalValue("lam", rows=(first + grip,))
            out[f"lateral.{c.name}"] = SignalValue("lam", rows=(first + grip + 1,))
    return out


def find_signal(mech: Mechanism, name: str, known: dict[str, SignalValue] | None = None) -> SignalValue:
    """Return the signal of a given name.

    Raises:
        UnknownNameError: for an unknown name, with the valid names.
    """
    known = known or signal_values(mech)
    if name not in known:
        raise UnknownNameError("signal", name, known)
    return known[name]


def find_point_signal(mech: Mechanism, name: str) -> SignalValue:
    """Return the signal of a given name, if it has a value at a point.

    Raises:
        UnknownNameError: for an unknown name, with the valid names.
        InputError: for a signal of a whole run: the mode or impulses of a switch, or work.
    """
    require(name, str, "a signal is given by its name")
    find_similar = _positions if name.startswith("position.") else _coordinates
    if mech not in _KNOWN and name in (similar := find_similar(mech)):  # creating all signals is slow
        return similar[name]
    known = signal_values(mech)
    signal = find_signal(mech, name, known)
    prefix, _, switch = name.partition(".")
    if signal.kind == "column" and prefix in RUN_PREFIXES:
        gap = f"gap.{switch}"
        alternative = f"; use {gap!r}" if gap in known else ""
        raise InputError(f"signal {name!r} has no value at a point, it belongs to a run{alternative}")
    return signal


def value(system: "Index2System", signal: SignalValue, t: float, y: Array) -> float:
    """Return a signal at a point y (n,); an angle between -pi and pi.

    Raises:
        StepError: if multipliers cannot be computed.
    """
    kind = signal.kind
    if kind == "t":
        return t
    if kind == "y":
        return float(y[signal.i])
    if kind == "angle":
        return float(np.arctan2(y[signal.i + 1], y[signal.i]))
    q, v = system.split(y)
    if kind in STATE_KINDS:
        return _value_from_state(system, signal, t, q, v)
    F, lam = system.derivative(t, y)
    if kind == "rate":
        return float(F[signal.i])
    lam = with_slip_friction(system, q, v, lam)
    if kind in PYTHON_KINDS:
        name, state_slice = list(units(system.mechanism))[signal.i], slice(system.nq + system.nv, -1)
        arrays: Any = (np.array(x, ndmin=2) for x in (q, v, y[state_slice], F[system.nv : 2 * system.nv], lam))
        point: Any = SinglePoint(system.mechanism, np.array([t]), *arrays)
        return float(signals(point, [name])[name][0])
    return _value_from_multipliers(system, kind, list(signal.rows), q, lam)


def _value_from_state(system: "Index2System", signal: SignalValue, t: float, q: Array, v: Array) -> float:
    """Return a position, a gap, an energy, or a residual of closures."""
    kind = signal.kind
    if kind == "position":
        origin = anchor(system.model, system.model.frames[signal.rows[0]].name)
        update_poses(system.model, system.workspace, q)
        return float(system.workspace.oMi[origin.joint].act(origin.p)[signal.i])
    if kind == "gap":
        switch: Any = system.mechanism.switches[signal.i]
        return float(switch.sign * AllRows(system)(t, q)[0][switch.row])
    if kind in SUMS:
        kinetic, potential = system.energy(q, v)
        return {"kinetic": kinetic, "potential": potential, "energy": kinetic + potential}[kind]
    return float(np.abs(system.residual(t, q, v)[RESIDUALS.index(kind)]).max(initial=0.0))


def _value_from_multipliers(system: "Index2System", kind: str, rows: list[int], q: Array, lam: Array) -> float:
    """Return a multiplier, or the magnitude of the force or torque of a closure, from the multipliers of all rows."""
    lam = lam[rows]
    if kind == "lam":
        return float(lam[0])
    if kind == "force":
        return float(np.linalg.norm(lam))
    bound_rows = next(p for p in system.constraints.frame_rows.values() if p.rows[0][0].start == rows[0])
    system.closures(q)
    W = system.constraints.W[:, rows]
    return float(np.linalg.norm((W[3:] - skew(bound_rows.pair.pb) @ W[:3]) @ lam))
