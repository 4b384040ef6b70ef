"""Derivatives of signals with respect to state, parameters and time."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import InputError
from ...mechanism import Mechanism
from ...mechanism.signal_derivatives import MotionTangent, TangentDirections
from ...mechanism.signals.deformation import deformation_units
from ...mechanism.tree.tree_terms import flexible_bodies
from ...solution.signal_value import RESIDUALS, SignalValue, find_signal, signal_values
from ...system import Array
from .column_derivatives import DerivativeFamily, find_column

if TYPE_CHECKING:
    from .trajectory import Trajectory

ENERGIES = {"kinetic": (1.0, 0.0), "potential": (0.0, 1.0), "energy": (1.0, 1.0)}
KNOWN = ("t", "y", "angle", "rate", "lam", "force", *ENERGIES)
NOT_DIFFERENTIABLE = {
    **dict.fromkeys(RESIDUALS, "it is the largest magnitude over all rows"),
    "mode": "it counts the states of a switch",
    "impulse": "it exists only at times of impacts",
}


class _PointDerivatives(NamedTuple):
    """Derivatives at a point that signals need.

    Attributes:
        coordinates: of q with respect to the tangent, (nq, nv).
        energies: of the kinetic and the potential energy, (2, ny + k).
        lam: multipliers of all rows, (ng,).
        rates: of Y', (ny, ny + k + 1).
        multipliers: of lam, (ng, ny + k + 1).
        columns: of bodies and forces by name, (ny + k + 1,) each.
    """

    coordinates: Array
    energies: Array
    lam: Array
    rates: Array
    multipliers: Array
    columns: dict[str, Array]

    def of_multipliers(self, kind: str, rows: list[int]) -> Array:
        """Return derivatives of one multiplier, or of the magnitude of several; zero for zero force."""
        lam = self.lam[rows]
        weights = np.ones(1) if kind == "lam" else lam / (np.linalg.norm(lam) or 1.0)
        return weights @ self.multipliers[rows]


class SignalJacobian:
    """Rows of derivatives of signals of `mbdae.Solution.signals`.

    Args:
        trajectory: of a run.
        names: of the signals.

    Raises:
        UnknownNameError: for a signal that does not exist.
        InputError: for a signal that has no gradient.
    """

    def __init__(self, trajectory: "Trajectory", names: Sequence[str]) -> None:
        self.trajectory, self.names = trajectory, list(names)
        mech = trajectory.system.mechanism
        known = signal_values(mech)
        self.signals = [differentiable(mech, name, known) for name in names]
        found = zip(names, self.signals, strict=True)
        self.columns = {name: column_of(mech, name) for name, signal in found if signal.kind not in KNOWN}
        self.families = {id(family): family for family, _ in self.columns.values()}
        self.motion = MotionTangent(trajectory.sensitivity.parameters) if self.families else None
        self.kinds = {signal.kind for signal in self.signals}
        self.rated = bool(self.kinds & {"lam", "force", "rate"}) or any(f.rated for f in self.families.values())
        self._fixed: Array | None = None
        ny, ng, m = trajectory.system.ny, trajectory.system.ng, trajectory.sensitivity.ny + trajectory.sensitivity.k + 1
        self._zeros = np.zeros(ny), np.zeros(ng), np.zeros((ny, m)), np.zeros((ng, m))
        self.uses_positions = any(signal.kind == "y" and signal.i < mech.nq for signal in self.signals)
        varying = self.uses_positions and not trajectory.system.manifold.flat
        self.fixed = self.kinds <= {"t", "y", "angle"} and not varying  # constant derivatives

    def rows(self, i: int, t: float, y: Array) -> Array:
        """Return the derivatives at a point after node i with respect to (y, p, t), (len(names), ny + k + 1).

        Raises:
            InputError: if a derivative is not finite, as for an undetermined force.
        """
        if self._fixed is not None:
            return self._fixed
        trajectory, s = self.trajectory, self.trajectory.system
        q, v = s.split(y)
        N = s.manifold.coordinate_partials(q) if self.uses_positions else np.empty(0)
        energies = trajectory.sensitivity.energy(q, v) if self.kinds & set(ENERGIES) else np.empty(0)
        F, lam, rates, derivatives = self._rates(i, t, y) if self.rated else self._zeros
        columns = self._columns(t, y, F, lam, rates, derivatives)
        point = _PointDerivatives(N, energies, lam, rates, derivatives, columns)
        out = np.zeros((len(self.signals), s.ny + trajectory.sensitivity.k + 1))
        for row, signal, name in zip(out, self.signals, self.names, strict=True):
            self._fill(row, signal, name, point)
            if name in columns and not np.isfinite(row).all():
                raise InputError(f"signal {name!r} has no gradient at t = {t:.9g} s: it is not a number there")
        if self.fixed:
            self._fixed = out
        return out

    def _fill(self, row: Array, signal: SignalValue, name: str, point: "_PointDerivatives") -> None:
        """Write the derivatives of a signal into a row of zeros, (ny + k + 1,)."""
        s, kind = self.trajectory.system, signal.kind
        if name in point.columns:
            row[:] = point.columns[name]
        elif kind == "t":
            row[-1] = 1.0
        elif kind in ENERGIES:
            row[:-1] = np.array(ENERGIES[kind]) @ point.energies
        elif kind in ("lam", "force"):
            row[:] = point.of_multipliers(kind, list(signal.rows))
        elif kind == "rate":
            row[:] = point.rates[signal.i]
        elif kind == "angle":
            row[signal.rate] = 1.0
        elif signal.i < s.nq:
            row[: s.nv] = point.coordinates[signal.i]
        else:
            row[signal.i - s.nq + s.nv] = 1.0

    def _rates(self, i: int, t: float, y: Array) -> tuple[Array, Array, Array, Array]:
        """Return Y' and lam of all rows, and their partial derivatives."""
        self.trajectory.enter_node(i)
        F, lam, partials = self.trajectory.sensitivity.multipliers(t, y)
        return F, lam, *partials

    def _columns(self, t: float, y: Array, F: Array, lam: Array, rates: Array, derivatives: Array) -> dict[str, Array]:
        """Return derivatives of the columns of bodies and forces."""
        if self.motion is None:
            return {}
        s, (q, v) = self.trajectory.system, self.trajectory.system.split(y)
        nv, k, identity = s.nv, self.trajectory.sensitivity.k, np.eye(rates.shape[1])
        parts = identity[:nv], identity[nv : 2 * nv], identity[2 * nv : 2 * nv + s.ns], rates[nv : 2 * nv], derivatives
        d = TangentDirections(*parts, identity[s.ny : s.ny + k], identity[-1])
        self.motion.evaluate(t, q, v, s.element_states(y), F[nv : 2 * nv], lam, d)
        found = {at: family.rows(self.motion) for at, family in self.families.items()}
        return {name: found[id(family)][i] for name, (family, i) in self.columns.items()}


def differentiable(mech: Mechanism, name: str, known: dict[str, SignalValue] | None = None) -> SignalValue:
    """Return the differentiable signal with this name.

    Raises:
        UnknownNameError: for a signal that does not exist.
        InputError: for a signal that has no gradient.
    """
    found = find_signal(mech, name, known)
    if found.kind not in KNOWN:
        column_of(mech, name)
    return found


def column_of(mech: Mechanism, name: str) -> tuple[DerivativeFamily, int]:
    """Return the family of a column, and its index in it.

    Raises:
        InputError: for a signal that has no gradient.
    """
    known = not flexible_bodies(mech.model) or name in deformation_units(mech.model)
    if known and (found := find_column(mech, name)):
        return found
    if not known:
        words = "coordinates, multipliers, energies, displacement, strain and stress have one"
        raise InputError(f"signal {name!r} of a mechanism with flexible bodies has no gradient: {words}")
    why = NOT_DIFFERENTIABLE.get(name.partition(".")[0], "its derivative is not known")
    raise InputError(f"signal {name!r} has no gradient: {why}")
