"""Signals of a mechanism at a single point: what `Solution.signals` and sweeps show over time, by the same names."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import UnknownNameError
from ..mechanism import Driver, Mechanism, loads
from ..mechanism.contacts import contact, path, rolling
from ..mechanism.frames import find_joint, skew
from ..system import Array
from .columns import PARTS, acceleration_names, load_columns, load_names, row_names

if TYPE_CHECKING:
    from ..mechanism.formulations.index2 import Index2System

REACTION, EFFORT = ("force", "torque"), "effort"
SUMS = ("kinetic", "potential", "energy")
RESIDUALS = ("g", "Gv")
IN_PYTHON = ("contact", "friction", "load")  # kinds that the core does not have


class SignalValue(NamedTuple):
    """Where a signal stands, or how it is computed.

    Attributes:
        kind: ``"t"``; ``"y"``, a number of y = (q, v, s, w); ``"rate"``, one of y' in the tangent; ``"angle"`` of a
            circle in q; ``"lam"``, ``"force"``, ``"torque"``, ``"load"``, ``"contact"``, ``"friction"``; or one of
            kinetic, potential, energy, g, Gv.
        i: the number of y or y'; of an angle that of its cosine in q; of a load that in `load_names`.
        rate: the number of y' in the tangent that is its rate; -1 where none is.
        rows: of closures.
    """

    kind: str
    i: int = 0
    rate: int = -1
    rows: tuple[int, ...] = ()

    @property
    def compiled(self) -> bool:
        """Whether the core has it."""
        return self.kind not in IN_PYTHON

    def plain(self) -> tuple[str, int, int, list[int]]:
        """What the core takes."""
        return self.kind, self.i, self.rate, list(self.rows)


def signal_values(mech: Mechanism) -> dict[str, SignalValue]:
    """All signals of a mechanism by name.

    Those of `mbdae.solution.columns.signals`, and ``effort.`` of closures and drivers.
    """
    nq, nv = mech.nq, mech.nv
    q: dict[str, SignalValue] = {}
    v: dict[str, SignalValue] = {}
    for name in mech.joint_names:
        j, kind = find_joint(mech.model, name), mech.joint_kind(name)
        angle = (j.nq, j.nv) == (2, 1)
        if angle:
            q[f"q.{name}"] = SignalValue("angle", j.idx_q, j.idx_v)
        for letter, n, out in (("q", 0 if angle else j.nq, q), ("v", j.nv, v)):
            parts = PARTS[kind][letter == "v"] if kind in PARTS else tuple(str(k + 1) for k in range(n))
            for k in range(n):
                known = (j.idx_v + k if j.nq == j.nv else -1) if letter == "q" else nv + j.idx_v + k
                at = j.idx_q + k if letter == "q" else nq + j.idx_v + k
                out[f"{letter}.{name}" + (f".{parts[k]}" if n > 1 else "")] = SignalValue("y", at, known)
    states = {f"s.{name}": SignalValue("y", nq + nv + i, 2 * nv + i) for i, name in enumerate(mech.states)}
    ns = len(states)
    work = {"work": SignalValue("y", nq + nv + ns, 2 * nv + ns)}
    sums: dict[str, SignalValue] = {name: SignalValue(name) for name in SUMS}
    kept = {name: SignalValue(name) for name in RESIDUALS}
    lam = {name: SignalValue("lam", rows=(i,)) for i, name in enumerate(row_names(mech))}
    rates = {name: SignalValue("rate", nv + i) for i, name in enumerate(acceleration_names(mech))}
    forces = {name: SignalValue("load", i) for i, name in enumerate(load_names(mech))}
    out = {"t": SignalValue("t"), **q, **v, **states, **sums, **work, **kept, **lam, **rates, **forces}
    for c in mech.constraints:
        rows = tuple(i for i, name in enumerate(mech.row_names) if name == c.name)
        if c.frames:
            pulls = tuple(i for i in rows if mech.row_units[i] == "m")
            out |= {f"force.{c.name}": SignalValue("force", rows=pulls)}
            out |= {f"torque.{c.name}": SignalValue("torque", rows=rows)}
    for c in rolling(mech):
        at = mech.row_names.index(c.name)
        out |= {f"contact.{c.name}.{x}": SignalValue("contact", k, rows=(at,)) for k, x in enumerate("xyz")}
        out[f"friction.{c.name}"] = SignalValue("friction", rows=(at,))
        first, grip = mech.row_names.index(c.name), int(c.contact is not False)
        if c.contact is not False:
            out[f"normal.{c.name}"] = SignalValue("lam", rows=(first,))
        if c.grip in (None, "full"):
            out[f"longitudinal.{c.name}"] = SignalValue("lam", rows=(first + grip,))
            out[f"lateral.{c.name}"] = SignalValue("lam", rows=(first + grip + 1,))
    for c in mech.constraints:
        if isinstance(c, Driver) or not c.frames:
            out[f"{EFFORT}.{c.name}"] = SignalValue("lam", rows=(mech.row_names.index(c.name),))
    return out


def find_signal(mech: Mechanism, name: str) -> SignalValue:
    """Return the signal of that name.

    Raises:
        UnknownNameError: lists the names that exist.
    """
    known = signal_values(mech)
    if name not in known:
        raise UnknownNameError("signal", name, known)
    return known[name]


def value(system: "Index2System", signal: SignalValue, t: float, y: Array) -> float:
    """Return a signal at a point y (n,); an angle between -pi and pi.

    Raises:
        StepError: where multipliers cannot be found.
    """
    kind, rows = signal.kind, list(signal.rows)
    if kind == "t":
        return t
    if kind == "y":
        return float(y[signal.i])
    if kind == "angle":
        return float(np.arctan2(y[signal.i + 1], y[signal.i]))
    q, v = system.split(y)
    if kind in SUMS:
        kinetic, potential = system.energy(q, v)
        return {"kinetic": kinetic, "potential": potential, "energy": kinetic + potential}[kind]
    if kind in RESIDUALS:
        return float(np.abs(system.residual(t, q, v)[RESIDUALS.index(kind)]).max(initial=0.0))
    if kind == "contact":
        return float(path(system.mechanism, system.mechanism.row_names[rows[0]], q[None])[0][signal.i])
    F, lam = system.derivative(t, y)
    if kind == "rate":
        return float(F[signal.i])
    if kind == "load":
        mech, motion = system.mechanism, (np.array([t]), q[None], v[None], F[None, system.nv : 2 * system.nv])
        columns = load_columns(mech, loads(mech, *motion, lam[None]))
        return float(columns[load_names(mech)[signal.i]][0])
    if kind == "friction":
        name = system.mechanism.row_names[rows[0]]
        return float(contact(system.mechanism, name, np.array([t]), q[None], lam[None]).friction[0])
    lam = lam[rows]
    if kind == "lam":
        return float(lam[0])
    if kind == "force":
        return float(np.linalg.norm(lam))
    part = next(p for p in system.constraints.frame_parts.values() if p.rows[0][0].start == rows[0])
    system.closures(q)
    W = system.constraints.W[:, rows]
    return float(np.linalg.norm((W[3:] - skew(part.pair.pb) @ W[:3]) @ lam))
