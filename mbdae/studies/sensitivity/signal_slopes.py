"""The derivatives of signals with respect to the state, the parameters and the time of a node."""

from collections.abc import Sequence

import numpy as np

from ...errors import InputError, UnknownNameError
from ...integrate.trace import Trace
from ...mechanism import Mechanism
from ...solution.columns import coordinate_places, row_names
from ...system import Array

ENERGIES = {"kinetic": (1.0, 0.0), "potential": (0.0, 1.0), "energy": (1.0, 1.0)}
PEAKS = ("g", "Gv")  # largest magnitudes over rows


class SignalSlopes:
    """Rows of derivatives of signals of `mbdae.Solution.signals`.

    Args:
        trace: a run.
        names: of the signals.

    Raises:
        UnknownNameError: for a signal that does not exist.
        InputError: for one that has no gradient.
    """

    def __init__(self, trace: Trace, names: Sequence[str]) -> None:
        self.trace, self.names = trace, list(names)
        mech: Mechanism = trace.system.mechanism
        self.places = coordinate_places(mech)
        self.states = {f"s.{name}": i for i, name in enumerate(mech.states)}
        self.multipliers = {name: i for i, name in enumerate(row_names(mech))}
        known = ["t", *self.places, *self.states, *self.multipliers, *ENERGIES, "work"]
        for name in self.names:
            if name in PEAKS:
                raise InputError(f"signal {name!r} has no gradient: it is the largest magnitude over all rows")
            if name not in known:
                raise UnknownNameError("signal", name, known)

    def rows(self, i: int, t: float, y: Array) -> Array:
        """Return the derivatives at a point behind node i with respect to (y, p, t), (len(names), ny + k + 1)."""
        trace, s = self.trace, self.trace.system
        ny, width = s.ny, s.ny + trace.slopes.k + 1
        out, (q, v) = np.zeros((len(self.names), width)), s.split(y)
        N = lam = energies = None
        for row, name in zip(out, self.names, strict=True):
            if name in self.places:
                side, number, plain = self.places[name]
                if side == "v" or plain:
                    row[number + (s.nv if side == "v" else 0)] = 1.0
                else:
                    N = s.manifold.coordinate_slopes(q) if N is None else N
                    row[: s.nv] = N[number]
            elif name in self.states:
                row[2 * s.nv + self.states[name]] = 1.0
            elif name in self.multipliers:
                if lam is None:
                    trace.hold(i)
                    lam = trace.slopes.rate(t, y).lam
                row[:] = lam[self.multipliers[name]]
            elif name in ENERGIES:
                energies = trace.slopes.energy(q, v) if energies is None else energies
                row[:-1] = np.array(ENERGIES[name]) @ energies
            else:
                row[width - 1 if name == "t" else ny - 1] = 1.0
        return out
