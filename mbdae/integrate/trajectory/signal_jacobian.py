"""Derivatives of signals with respect to state, parameters and time."""

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import InputError
from ...mechanism import Mechanism
from ...mechanism.signal_derivatives import MotionTangent, TangentDirections
from ...mechanism.signals.deformation import deformation_units
from ...mechanism.tree.tree_terms import flexible_bodies
from ...solution.signal_value import RESIDUALS, SignalValue, find_signal, signal_values
from ...system import Array
from .column_derivatives import DerivativeGroup, find_column

if TYPE_CHECKING:
    from .trajectory import Trajectory

ENERGIES = {"kinetic": (1.0, 0.0), "potential": (0.0, 1.0), "energy": (1.0, 1.0)}
DIRECT_KINDS = ("t", "y", "angle", "rate", "lam", "force", *ENERGIES)
NOT_DIFFERENTIABLE = {
    **dict.fromkeys(RESIDUALS, "it is the largest magnitude over all rows"),
    "mode": "it counts the states of a switch",
    "impulse": "it exists only at times of impacts",
}


class PointRates(NamedTuple):
    """Rates y' and multipliers at a point, and their derivatives in m directions.

    Attributes:
        F: y', (ny,).
        lam: multipliers of all rows, (ng,).
        rates: derivatives of y', (ny, m).
        multipliers: derivatives of lam, (ng, m).
    """

    F: Array
    lam: Array
    rates: Array
    multipliers: Array

    def of_multipliers(self, kind: str, rows: list[int]) -> Array:
        """Return derivatives of one multiplier, or of the magnitude of several; zero for zero force."""
        lam = self.lam[rows]
        weights = np.ones(1) if kind == "lam" else lam / (np.linalg.norm(lam) or 1.0)
        return weights @ self.multipliers[rows]


class SignalPoint:
    """A point after node i of a run, with m directions; derivatives shared by several signals are computed once.

    Args:
        trajectory: trajectory of the run.
        i: the node.
        t: time in s.
        y: the point.
        directions: tangents of y (ny, m), of the parameters (k, m) and of time (m,).
    """

    def __init__(
        self, trajectory: "Trajectory", i: int, t: float, y: Array, directions: tuple[Array, Array, Array]
    ) -> None:
        self.trajectory, self.i, self.t, self.y = trajectory, i, t, y
        self.dy, self.dp, self.dt = directions
        self.groups: dict[int, Array] = {}  # derivatives of groups of columns, cached

    @cached_property
    def rates(self) -> PointRates:
        """Rates y' and multipliers, and their derivatives."""
        self.trajectory.enter_node(self.i)
        F, lam, partials = self.trajectory.sensitivity.multipliers(self.t, self.y)
        d = np.concatenate([self.dy, self.dp, self.dt[None]])
        return PointRates(F, lam, partials.rate @ d, partials.lam @ d)

    @cached_property
    def coordinates(self) -> Array:
        """Derivatives of the components of q, (nq, m)."""
        s = self.trajectory.system
        dq = self.dy[: s.nv]
        return dq if s.manifold.flat else s.manifold.coordinate_partials(s.split(self.y)[0]) @ dq

    @cached_property
    def energies(self) -> Array:
        """Partial derivatives of kinetic and potential energy with respect to y and the parameters, (2, ny + k)."""
        return self.trajectory.sensitivity.energy(*self.trajectory.system.split(self.y))

    @property
    def no_rates(self) -> PointRates:
        """Zeros in place of `rates`, for signals that do not depend on them."""
        (ny, m), ng = self.dy.shape, self.trajectory.system.ng
        return PointRates(np.zeros(ny), np.zeros(ng), np.zeros((ny, m)), np.zeros((ng, m)))


class SignalJacobian:
    """Rows of derivatives of signals of `mbdae.Solution.signals`.

    Args:
        trajectory: trajectory of a run.
        names: names of the signals.

    Raises:
        UnknownNameError: for a signal that does not exist.
        InputError: for a signal that has no gradient.
    """

    def __init__(self, trajectory: "Trajectory", names: Sequence[str]) -> None:
        self.trajectory, self.names = trajectory, list(names)
        mech = trajectory.system.mechanism
        all_signals = signal_values(mech)
        self.signals = [differentiable(mech, name, all_signals) for name in names]
        named = zip(names, self.signals, strict=True)
        self.columns = {name: column_of(mech, name) for name, signal in named if signal.kind not in DIRECT_KINDS}
        self.groups = {id(group): group for group, _ in self.columns.values()}
        self.motion = MotionTangent(trajectory.sensitivity.parameters) if self.groups else None
        kinds = {signal.kind for signal in self.signals}
        self.needs_rates = bool(kinds & {"lam", "force", "rate"}) or any(f.needs_rates for f in self.groups.values())
        self._constant_rows: Array | None = None
        uses_positions = any(signal.kind == "y" and signal.i < mech.nq for signal in self.signals)
        has_curved_positions = uses_positions and not trajectory.system.manifold.flat
        self.is_constant = kinds <= {"t", "y", "angle"} and not has_curved_positions

    def rows(self, i: int, t: float, y: Array) -> Array:
        """Return the derivatives at a point after node i with respect to (y, p, t), (len(names), ny + k + 1).

        Raises:
            InputError: if a derivative is not finite, as for an undetermined force.
        """
        if self._constant_rows is not None:
            return self._constant_rows
        ny = self.trajectory.system.ny
        identity = np.eye(ny + self.trajectory.sensitivity.k + 1)
        point = SignalPoint(self.trajectory, i, t, y, (identity[:ny], identity[ny:-1], identity[-1]))
        out = self.directional_derivatives(point)
        if self.is_constant:
            self._constant_rows = out
        return out

    def directional_derivatives(self, point: SignalPoint) -> Array:
        """Return the derivatives at a point in its m directions, (len(names), m).

        Raises:
            InputError: if a derivative is not finite, as for an undetermined force.
        """
        columns = self._columns(point)
        out = np.zeros((len(self.signals), len(point.dt)))
        for row, signal, name in zip(out, self.signals, self.names, strict=True):
            row[:] = columns[name] if name in columns else self._derivatives(signal, point)
            if name in columns and not np.isfinite(row).all():
                raise InputError(f"signal {name!r} has no gradient at t = {point.t:.9g} s: it is not a number there")
        return out

    def _derivatives(self, signal: SignalValue, point: SignalPoint) -> Array:
        """Return the derivatives of a signal that is not a column of bodies or forces, (m,)."""
        s, kind = self.trajectory.system, signal.kind
        if kind == "t":
            return point.dt
        if kind in ENERGIES:
            y_partials, p_partials = np.split(np.array(ENERGIES[kind]) @ point.energies, [s.ny])
            return y_partials @ point.dy + p_partials @ point.dp
        if kind in ("lam", "force"):
            return point.rates.of_multipliers(kind, list(signal.rows))
        if kind == "rate":
            return point.rates.rates[signal.i]
        if kind == "angle":
            return point.dy[signal.rate]
        if signal.i < s.nq:
            return point.coordinates[signal.i]
        return point.dy[signal.i - s.nq + s.nv]

    def _columns(self, point: SignalPoint) -> dict[str, Array]:
        """Return the derivatives of the columns of bodies and forces, (m,) each."""
        if self.motion and not self.groups.keys() <= point.groups.keys():
            s, rates = self.trajectory.system, point.rates if self.needs_rates else point.no_rates
            (q, v), nv, dy = s.split(point.y), s.nv, point.dy
            self.trajectory.enter_node(point.i)
            tangents = dy[:nv], dy[nv : 2 * nv], dy[2 * nv : 2 * nv + s.ns], rates.rates[nv : 2 * nv], rates.multipliers
            d = TangentDirections(*tangents, point.dp, point.dt)
            self.motion.evaluate(point.t, q, v, s.element_states(point.y), rates.F[nv : 2 * nv], rates.lam, d)
            point.groups = {key: group.rows(self.motion) for key, group in self.groups.items()}
        return {name: point.groups[id(group)][i] for name, (group, i) in self.columns.items()}


def differentiable(mech: Mechanism, name: str, known: dict[str, SignalValue] | None = None) -> SignalValue:
    """Return the differentiable signal with this name.

    Raises:
        UnknownNameError: for a signal that does not exist.
        InputError: for a signal that has no gradient.
    """
    signal = find_signal(mech, name, known)
    if signal.kind not in DIRECT_KINDS:
        column_of(mech, name)
    return signal


def column_of(mech: Mechanism, name: str) -> tuple[DerivativeGroup, int]:
    """Return the group of a column, and its index in the group.

    Raises:
        InputError: for a signal that has no gradient.
    """
    supported = not flexible_bodies(mech.model) or name in deformation_units(mech.model)
    if supported and (column := find_column(mech, name)):
        return column
    if not supported:
        alternatives = "coordinates, multipliers, energies, displacement, strain and stress have one"
        raise InputError(f"signal {name!r} of a mechanism with flexible bodies has no gradient: {alternatives}")
    reason = NOT_DIFFERENTIABLE.get(name.partition(".")[0], "its derivative is not known")
    raise InputError(f"signal {name!r} has no gradient: {reason}")
