"""The derivatives of signals with respect to the state, the parameters and the time of a node."""

from collections.abc import Sequence

import numpy as np

from ...errors import InputError
from ...integrate.trace import Trace
from ...mechanism import Mechanism
from ...solution.columns import load_units
from ...solution.signal_value import RESIDUALS, SignalValue, find_signal, signal_values
from ...system import Array
from .load_slopes import load_row, load_slopes

ENERGIES = {"kinetic": (1.0, 0.0), "potential": (0.0, 1.0), "energy": (1.0, 1.0)}
LOADS = ("load", "torque")
KNOWN = ("t", "y", "angle", "rate", "lam", "force", *LOADS, *ENERGIES)


def differentiable(mech: Mechanism, name: str, known: dict[str, SignalValue] | None = None) -> SignalValue:
    """The signal of that name.

    Raises:
        UnknownNameError: for a signal that does not exist.
        InputError: for one that has no gradient.
    """
    found = find_signal(mech, name, known)
    if found.kind in RESIDUALS:
        raise InputError(f"signal {name!r} has no gradient: it is the largest magnitude over all rows")
    if found.kind not in KNOWN:
        raise InputError(f"signal {name!r} has no gradient: its derivative is not known")
    return found


class SignalSlopes:
    """Rows of derivatives of signals of `mbdae.Solution.signals`, and of forces and efforts.

    Args:
        trace: a run.
        names: of the signals.

    Raises:
        UnknownNameError: for a signal that does not exist.
        InputError: for one that has no gradient.
    """

    def __init__(self, trace: Trace, names: Sequence[str]) -> None:
        self.trace = trace
        mech = trace.system.mechanism
        known = signal_values(mech)
        self.signals = [differentiable(mech, name, known) for name in names]
        self.kinds = {signal.kind for signal in self.signals}
        self._fixed: Array | None = None
        self.placed = any(signal.kind == "y" and signal.i < mech.nq for signal in self.signals)
        listed = list(load_units(mech)) if any(signal.kind in LOADS for signal in self.signals) else []
        self.loads = [listed.index(name) if name in listed else -1 for name in names]

    def rows(self, i: int, t: float, y: Array) -> Array:
        """Return the derivatives at a point behind node i with respect to (y, p, t), (len(names), ny + k + 1)."""
        if self._fixed is not None:
            return self._fixed
        trace, s = self.trace, self.trace.system
        out, (q, v) = np.zeros((len(self.signals), s.ny + trace.slopes.k + 1)), s.split(y)
        kinds = self.kinds
        N = s.manifold.coordinate_slopes(q) if self.placed else np.empty(0)
        energies = trace.slopes.energy(q, v) if kinds & set(ENERGIES) else np.empty(0)
        lam = slopes = rates = np.empty(0)
        if kinds & {"lam", "force", "rate", *LOADS}:
            trace.hold(i)
            lam, (rates, slopes) = s.derivative(t, y)[1], trace.slopes.rate(t, y)
        loads = load_slopes(trace, t, y) if kinds & set(LOADS) else (np.empty(0), np.empty(0))
        for row, signal, load in zip(out, self.signals, self.loads, strict=True):
            if signal.kind == "t":
                row[-1] = 1.0
            elif signal.kind in ENERGIES:
                row[:-1] = np.array(ENERGIES[signal.kind]) @ energies
            elif signal.kind in ("lam", "force"):
                own = lam[list(signal.rows)]
                weights = np.ones(1) if signal.kind == "lam" else own / (np.linalg.norm(own) or 1.0)
                row[:] = weights @ slopes[list(signal.rows)]
            elif signal.kind in LOADS:
                row[:] = load_row(loads, load)
            elif signal.kind == "rate":
                row[:] = rates[signal.i]
            elif signal.kind == "angle":
                row[signal.rate] = 1.0
            elif signal.i < s.nq:
                row[: s.nv] = N[signal.i]
            else:
                row[signal.i - s.nq + s.nv] = 1.0
        if self.kinds <= {"t", "y", "angle"} and not self.placed:  # the same everywhere
            self._fixed = out
        return out
