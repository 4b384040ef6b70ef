"""Dense output of a mechanism within a step, from states and accelerations at both ends."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ....hermite import fit, fit_many, nodes, powers, values
from ....system import Array
from ...tree.tree_terms import update_poses

if TYPE_CHECKING:
    from ..index2 import Index2System

VELOCITY_ORDER = 4  # order of v, interpolated from q, v and v' at both ends
STATE_ORDER = 3  # order of s, interpolated from s and s' at both ends
WORK_NODES = 2


def interpolant(
    system: "Index2System",
    t: float,
    h: float,
    ends: tuple[Array, Array],
    rates: tuple[Array, Array],
    order: int,
) -> Callable[[float], Array]:
    """Return theta -> y on t + theta h, theta in [0, 1].

    In the chart q = q_n (+) x, x(theta) interpolates x, x' = J v and x'' = J v' + J' v at both ends: a quintic, order 5
    in q and 4 in v. For higher orders, accelerations from the hidden constraint at interior points are added. Both q
    and v are continuous, and satisfy G v = 0 to that order. States s and work w are cubics, order 3, raised by their
    rates at the same points; without states, the work uses the power at two other points.

    Args:
        system: workspace for accelerations and forces.
        t: start of the step.
        h: step size.
        ends: y at both ends.
        rates: tangent rates (v, v', s', w') at both ends.
        order: required order of v and s.
    """
    nq, nv, m = system.nq, system.nv, system.manifold
    (y0, y1), (F0, F1) = ends, rates
    guess = h / 2 * (F0[:nv] + F1[:nv]) + h * h / 12 * (F0[nv : 2 * nv] - F1[nv : 2 * nv])
    x1 = m.unwrapped(y0[:nq], y1[:nq], guess)
    c1 = m.tangent(x1, F1[:nv])

    def second(x: Array, dx: Array, v: Array, vdot: Array) -> Array:
        return m.tangent(x, vdot) + m.tangent_rate(x, dx, v)

    def state(theta: float, c: Array) -> tuple[Array, Array, Array, Array]:
        """Return x, x', the configuration and v."""
        x, dx = powers(theta, len(c) - 1) @ c, powers(theta, len(c) - 1, 1) @ c / h
        return x, dx, m.integrate(y0[:nq], x), m.velocity(x, dx)

    def rate(theta: float, c: Array, tail: Array) -> tuple[Array, Array]:
        """Return the second derivative of x and the first of (s, w) with respect to theta."""
        x, dx, q, v = state(theta, c)
        F, _ = system.derivative(t + theta * h, np.concatenate([q, v, powers(theta, len(tail) - 1) @ tail]))
        return h * h * second(x, dx, v, F[nv : 2 * nv]), h * F[2 * nv :]

    data = [
        (np.zeros(nv), x1),
        (h * F0[:nv], h * c1),
        (h * h * F0[nv : 2 * nv], h * h * second(x1, c1, F1[:nv], F1[nv : 2 * nv])),
    ]
    tail_data = [(y0[nq + nv :], y1[nq + nv :]), (h * F0[2 * nv :], h * F1[2 * nv :])]
    sweeps = max(0, order - (STATE_ORDER if system.ns else VELOCITY_ORDER))
    c, tail = fit(data, np.empty((0, nv))), fit(tail_data, np.empty((0, system.ns + 1)))
    for _ in range(sweeps):
        inner = [rate(theta, c, tail) for theta in nodes(sweeps)]
        c, tail = fit(data, np.array([a for a, _ in inner])), fit(tail_data, np.array([b for _, b in inner]))
    tails = [tail] if system.ns else []

    def power(theta: float) -> Array:
        _, _, q, v = state(theta, c)
        return h * _power(system, t + theta * h, q, v)

    def at(theta: float) -> Array:
        if not tails:
            tails.append(fit(tail_data, np.array([power(s) for s in nodes(WORK_NODES)])))
        _, _, q, v = state(theta, c)
        return np.concatenate([q, v, powers(theta, len(tails[0]) - 1) @ tails[0]])

    return at


def can_sample_at_once(system: "Index2System", order: int) -> bool:
    """Return whether `sample_at_once` applies: vector-space coordinates, no force states, order at most 4."""
    return system.manifold.flat and not system.ns and order <= VELOCITY_ORDER


def sample_at_once(
    system: "Index2System",
    t: Array,
    h: Array,
    ends: tuple[Array, Array],
    rates: tuple[Array, Array],
    which: Array,
    theta: Array,
) -> Array:
    """Return y (k, ny) at k points of n steps, equal to those of `interpolant` if `can_sample_at_once`.

    Args:
        system: workspace for forces.
        t: starts of the steps, (n,).
        h: step sizes, (n,).
        ends: y at both ends of each step, (n, ny).
        rates: tangent rates at these points, (n, 2 nv + 1).
        which: step index of each point, (k,).
        theta: position of each point in its step, 0 to 1, (k,).
    """
    nv, size = system.nv, h[:, None]
    (y0, y1), (F0, F1) = ends, rates
    c = fit_many(
        [(np.zeros_like(F0[:, :nv]), y1[:, :nv] - y0[:, :nv])]
        + [(size**k * F0[:, s], size**k * F1[:, s]) for k, s in ((1, slice(0, nv)), (2, slice(nv, 2 * nv)))],
        [],
    )

    def state(theta: Array, which: Array) -> tuple[Array, Array]:
        return y0[which, :nv] + values(c[which], theta), values(c[which], theta, 1) / size[which]

    inner = []
    for x in nodes(WORK_NODES):
        power = np.zeros((len(h), 1))
        if system.laws.acting or system.driven:
            points = zip(t + x * h, *state(np.full(len(h), x), np.arange(len(h))), strict=True)
            power[:] = [_power(system, *point) for point in points]
        inner.append(size * power)
    tail = fit_many([(y0[:, -1:], y1[:, -1:]), (size * F0[:, -1:], size * F1[:, -1:])], inner)
    return np.hstack([*state(theta, which), values(tail[which], theta)])


def _power(system: "Index2System", t: float, q: Array, v: Array) -> Array:
    """Return the power of non-conservative forces, (1,), of a system without states of forces."""
    if system.driven or system.closure_friction:  # their power depends on lam
        return system.derivative(t, np.concatenate([q, v, [0.0]]))[0][-1:]
    if not system.laws.acting:
        return np.zeros(1)
    update_poses(system.model, system.workspace, q)
    return system.generalized_force(t, q, v, np.empty(0))[1]
