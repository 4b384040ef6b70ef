"""Derivatives of the poses of a mechanism with one degree of freedom with respect to its parameters, at fixed inputs u.

The closures, locked joints and the driver are rows g(p, u, q) = 0 of full rank. By the implicit function theorem, with
v = dq/du,

    G dq = -g_p dp,    G dv = -(B dq + Q dp),    B = d(G v)/dq,  Q = d(G v)/dp

and a frame's origin moves with q and with the placements of the joints that carry it. By virtual work, the driver
effort that balances a pose at rest is -f(q) . v with the forces f.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np

from ...errors import InputError, UnknownNameError
from ...mechanism.discrete_sensitivity.frame_partials import frame_partials
from ...mechanism.discrete_sensitivity.parameter_partials import Parameters
from ...mechanism.tree.frames import WORLD, frame_names, frame_paths
from ...solution.columns import coordinates
from ...solution.signal_value import signal_values
from ...system import Array
from ...tolerances import COINCIDENT, RANK
from ..kinematics.result import Kinematics

HOLDING = "holding"
AXES = "xyz"


class CurveSignals(Mapping[str, Array]):
    """Signals along a curve by name, (n,) each: ``u``, ``q.*``, ``v.*``, ``position.*``, and ``holding``.

    Args:
        found: a curve without dead points.
        make_parameters: returns the parameters of its mechanism, with the input as last driver.
    """

    def __init__(self, found: Kinematics, make_parameters: Callable[[], Parameters]) -> None:
        self.found, self._make_parameters, self.system = found, make_parameters, found.mechanism.system()
        self.known = {n: x for n, x in signal_values(found.mechanism).items() if n[:2] in ("q.", "v.")}
        self.states = np.array(list(found.mechanism.states.values()))

    @cached_property
    def parameters(self) -> Parameters:
        """Parameters of the mechanism."""
        return self._make_parameters()

    def __iter__(self) -> Iterator[str]:
        frames = [name for name in frame_names(self.found.mechanism.model) if name != WORLD]
        return iter(["u", *self.known, *(f"position.{n}.{x}" for n in frames for x in AXES), HOLDING])

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return name in list(self)

    def __getitem__(self, name: str) -> Array:
        if name not in self:
            raise UnknownNameError("signal of a curve", name, self)
        if name == "u":
            return self.found.u
        if name == HOLDING:
            return self.holding
        if name in self.known:
            return self.coordinates[name]
        frame, axis = _point(name)
        return frame_paths(self.found.mechanism.model, [frame], self.found.q)[0, :, AXES.index(axis)]

    @cached_property
    def coordinates(self) -> dict[str, Array]:
        """Signals ``q.*`` and ``v.*``."""
        found = self.found
        rates = {name: row for name, row in zip(found.velocity_names, found.rates.T, strict=True)}
        return coordinates(found.run()) | rates

    @cached_property
    def holding(self) -> Array:
        """Holding torque or force of the driver at rest in each pose, in N m or N, (n,)."""
        return np.array([-self._at_rest(q) @ v for q, v in zip(self.found.q, self.found.rates, strict=True)])

    def _at_rest(self, q: Array) -> Array:
        self.system.inertia(0.0, q)
        return self.system.force(0.0, q, np.zeros(self.system.nv), self.states)[0]

    @cached_property
    def derivatives(self) -> tuple[Array, Array]:
        """Derivatives of q in the tangent and of v = dq/du at fixed inputs, (n, nv, k) each."""
        return tuple(np.array(x) for x in zip(*self._poses(), strict=True))  # type: ignore[return-value]

    def _poses(self) -> Iterator[tuple[Array, Array]]:
        s, all_rows = self.parameters.system, np.arange(self.parameters.system.ng)
        for u, q, v in zip(self.found.u, self.found.q, self.found.rates, strict=True):
            G, B = s.rate_partials(u, q, v, all_rows)
            Q, g = self.parameters.row_partials(u, q, v)
            G_inverse = np.linalg.pinv(G, rcond=RANK)
            dq = -G_inverse @ g
            yield dq, -G_inverse @ (B @ dq + Q)

    def derivative(self, name: str) -> Array:
        """Return derivatives of a signal with respect to the parameters at fixed inputs, (n, k)."""
        dq, dv = self.derivatives
        if name == "u":
            return np.zeros((len(dq), len(self.parameters)))
        if name == HOLDING:
            return self._holding_derivatives(dq, dv)
        if name in self.known:
            at, nq, nv = self.known[name], self.system.nq, self.system.nv
            if at.kind == "angle":
                return dq[:, at.rate]
            if at.i >= nq:
                return dv[:, at.i - nq]
            by_q = [self.system.manifold.coordinate_partials(q)[at.i] for q in self.found.q]
            return np.einsum("ni,nik->nk", np.reshape(by_q, (-1, nv)), dq)
        frame, axis = _point(name)
        partials = [frame_partials(self.parameters, q, [frame]) for q in self.found.q]
        row = AXES.index(axis)
        return np.array([by_q[0, row] @ d + by_p[0, row] for (by_q, by_p), d in zip(partials, dq, strict=True)])

    def _holding_derivatives(self, dq: Array, dv: Array) -> Array:
        s, nv, out = self.parameters.system, self.system.nv, []
        zero_v, zero_lam = np.zeros(nv), np.zeros(s.ng)
        u = np.concatenate([zero_v, self.states, [0.0]])
        for q, v, q_p, v_p in zip(self.found.q, self.found.rates, dq, dv, strict=True):
            self.parameters.require_directions(0.0, q)
            K = s.partials(0.0, q, u, zero_v, zero_lam, np.arange(s.ng)).K[:nv]
            P = self.parameters.force_partials(0.0, q, zero_v, self.states, zero_v, zero_lam)[:nv]
            out.append(-v @ (K @ q_p + P) - self._at_rest(q) @ v_p)
        return np.array(out)


def _point(name: str) -> tuple[str, str]:
    """Return frame and axis of ``position.<frame>.x``."""
    frame, _, axis = name.removeprefix("position.").rpartition(".")
    return frame, axis


def require_monotonic(found: Kinematics, span: Sequence[float]) -> None:
    """Reject a curve that does not cover a range of its input from one end to the other.

    Raises:
        InputError: if the input turns back, or several branches intersect.
    """
    what = "dead point" if found.dead_points else "branch point" if found.branch_points else ""
    if what or not found.moving.all():
        at = [*(u for u, _ in found.dead_points), *(b.u for b in found.branch_points)]
        raise InputError(f"{found.drive!r} reaches a {what or 'dead point'} at {min(at, default=found.u[0]):.6g}: "
                         "poses at equal inputs have no derivatives there")  # fmt: skip
    if abs(found.u[-1] - span[1]) > COINCIDENT * (1 + abs(span[1])):
        raise InputError(f"{found.drive!r} moves from {span[0]:.6g} only to {found.u[-1]:.6g}, not to {span[1]:.6g}")
