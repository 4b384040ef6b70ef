"""Derivatives of the poses of a mechanism with one degree of freedom with respect to its parameters, at fixed inputs u.

The closures, locked joints and the driver are rows g(p, u, q) = 0 of full rank. By the implicit function theorem, with
v = dq/du,

    G dq = -g_p dp,    G dv = -(B dq + Q dp),    B = d(G v)/dq,  Q = d(G v)/dp

and an output o(q, v, p) changes by

    do = (o_p - lam g_p - mu Q) dp,    G^T mu = o_v,    G^T lam = o_q - B^T mu

one transposed solve for all parameters: lam are the reactions to a unit load along the output with the drive locked.
The origin of a frame depends on q and on the placements of its supporting joints. By virtual work, the driver effort
that balances a pose at rest is -f(q) . v with the forces f.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...errors import InputError, UnknownNameError
from ...mechanism.discrete_sensitivity.frame_partials import frame_partials
from ...mechanism.discrete_sensitivity.parameter_partials import Parameters
from ...mechanism.tree.frames import WORLD, frame_names, frame_paths
from ...solution.columns import coordinates
from ...solution.signal_value import signal_values
from ...system import Array
from ...tolerances import COINCIDENT, RANK
from .result import Kinematics

HOLDING = "holding"
AXES = "xyz"


class Poses(NamedTuple):
    """Linearized constraint rows in the n poses of a curve.

    Attributes:
        inverse: pseudoinverses of G, (n, nv, ng).
        rates_by_q: dv/dq = -G^+ B, (n, nv, nv).
        rows: g_p, (n, ng, k).
        row_rates: Q, (n, ng, k).
    """

    inverse: Array
    rates_by_q: Array
    rows: Array
    row_rates: Array


class CurveSignals(Mapping[str, Array]):
    """Signals along a curve by name, (n,) each: ``u``, ``q.*``, ``v.*``, ``position.*``, and ``holding``.

    Args:
        curve: a curve without dead points.
        make_parameters: returns the parameters of its mechanism, with the input as last driver.
    """

    def __init__(self, curve: Kinematics, make_parameters: Callable[[], Parameters]) -> None:
        self.curve, self._make_parameters, self.system = curve, make_parameters, curve.mechanism.system()
        self.known = {n: x for n, x in signal_values(curve.mechanism).items() if n[:2] in ("q.", "v.")}
        self.states = np.array(list(curve.mechanism.states.values()))

    @cached_property
    def parameters(self) -> Parameters:
        """Parameters of the mechanism."""
        return self._make_parameters()

    def __iter__(self) -> Iterator[str]:
        frames = [name for name in frame_names(self.curve.mechanism.model) if name != WORLD]
        return iter(["u", *self.known, *(f"position.{n}.{x}" for n in frames for x in AXES), HOLDING])

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return name in list(self)

    def __getitem__(self, name: str) -> Array:
        if name not in self:
            raise UnknownNameError("signal of a curve", name, self)
        if name == "u":
            return self.curve.u
        if name == HOLDING:
            return self.holding
        if name in self.known:
            return self.coordinates[name]
        frame, axis = _point(name)
        return frame_paths(self.curve.mechanism.model, [frame], self.curve.q)[0, :, AXES.index(axis)]

    @cached_property
    def coordinates(self) -> dict[str, Array]:
        """Signals ``q.*`` and ``v.*``."""
        curve = self.curve
        rates = {name: row for name, row in zip(curve.velocity_names, curve.rates.T, strict=True)}
        return coordinates(curve.run()) | rates

    @cached_property
    def holding(self) -> Array:
        """Holding torque or force of the driver at rest in each pose, in N m or N, (n,)."""
        return np.array([-self._static_force(q) @ v for q, v in zip(self.curve.q, self.curve.rates, strict=True)])

    def _static_force(self, q: Array) -> Array:
        self.system.inertia(0.0, q)
        return self.system.force(0.0, q, np.zeros(self.system.nv), self.states)[0]

    @cached_property
    def poses(self) -> Poses:
        """Linearized rows in each pose."""
        s, all_rows = self.parameters.system, np.arange(self.parameters.system.ng)
        rows = []
        for u, q, v in zip(self.curve.u, self.curve.q, self.curve.rates, strict=True):
            G, B = s.rate_partials(u, q, v, all_rows)
            Q, g = self.parameters.row_partials(u, q, v)
            inverse = np.linalg.pinv(G, rcond=RANK)
            rows.append((inverse, -inverse @ B, g, Q))
        return Poses(*(np.array(x) for x in zip(*rows, strict=True)))

    def reactions(self, name: str) -> Array:
        """Return the reactions lam of all rows to a unit load along a signal, with the drive locked, (n, ng).

        A displacement dg of the rows changes the signal by -lam . dg.
        """
        by_q, by_v, _ = self.partials(name)
        adjoint = by_q + np.einsum("ni,nij->nj", by_v, self.poses.rates_by_q)
        return np.einsum("ni,nij->nj", adjoint, self.poses.inverse)

    def derivative(self, name: str) -> Array:
        """Return derivatives of a signal with respect to the parameters at fixed inputs, (n, k)."""
        _, by_v, by_p = self.partials(name)
        if name == "u":
            return by_p
        lam, mu = self.reactions(name), np.einsum("ni,nij->nj", by_v, self.poses.inverse)
        return np.asarray(
            by_p - np.einsum("nj,njk->nk", lam, self.poses.rows) - np.einsum("nj,njk->nk", mu, self.poses.row_rates)
        )

    def partials(self, name: str) -> tuple[Array, Array, Array]:
        """Return partials of a signal with respect to q in the tangent and v, (n, nv) each, and parameters (n, k)."""
        n, nq, nv, k = len(self.curve.u), self.system.nq, self.system.nv, len(self.parameters)
        by_q, by_v, by_p = np.zeros((n, nv)), np.zeros((n, nv)), np.zeros((n, k))
        if name == HOLDING:
            return self._holding_partials()
        if name in self.known:
            at = self.known[name]
            if at.kind == "angle":
                by_q[:, at.rate] = 1.0
            elif at.i >= nq:
                by_v[:, at.i - nq] = 1.0
            else:
                by_q[:] = [self.system.manifold.coordinate_partials(q)[at.i] for q in self.curve.q]
        elif name != "u":
            frame, axis = _point(name)
            partials, row = [frame_partials(self.parameters, q, [frame]) for q in self.curve.q], AXES.index(axis)
            by_q, by_p = (np.array([pair[i][0, row] for pair in partials]) for i in (0, 1))
        return by_q, by_v, by_p

    def _holding_partials(self) -> tuple[Array, Array, Array]:
        s, nv, out = self.parameters.system, self.system.nv, []
        zero_v, zero_lam = np.zeros(nv), np.zeros(s.ng)
        u = np.concatenate([zero_v, self.states, [0.0]])
        for q, v in zip(self.curve.q, self.curve.rates, strict=True):
            self.parameters.require_directions(0.0, q)
            K = s.partials(0.0, q, u, zero_v, zero_lam, np.arange(s.ng)).K[:nv]
            P = self.parameters.force_partials(0.0, q, zero_v, self.states, zero_v, zero_lam)[:nv]
            out.append((-v @ K, -self._static_force(q), -v @ P))
        by_q, by_v, by_p = (np.array(x) for x in zip(*out, strict=True))
        return by_q, by_v, by_p


def _point(name: str) -> tuple[str, str]:
    """Return frame and axis of ``position.<frame>.x``."""
    frame, _, axis = name.removeprefix("position.").rpartition(".")
    return frame, axis


def require_monotonic(curve: Kinematics, span: Sequence[float]) -> None:
    """Reject a curve whose input does not increase or decrease over a whole range.

    Raises:
        InputError: if the input turns back, or several branches intersect.
    """
    kind = "dead point" if curve.dead_points else "branch point" if curve.branch_points else ""
    if kind or not curve.moving.all():
        at = [*(u for u, _ in curve.dead_points), *(b.u for b in curve.branch_points)]
        raise InputError(f"{curve.drive!r} reaches a {kind or 'dead point'} at {min(at, default=curve.u[0]):.6g}: "
                         "poses at equal inputs have no derivatives there")  # fmt: skip
    if abs(curve.u[-1] - span[1]) > COINCIDENT * (1 + abs(span[1])):
        raise InputError(f"{curve.drive!r} moves from {span[0]:.6g} only to {curve.u[-1]:.6g}, not to {span[1]:.6g}")
