"""One step of any half-explicit Runge-Kutta method, for any problem."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..system import State, Step, System

if TYPE_CHECKING:
    from .explicit import ExplicitMethod
    from .tableau import Tableau


def half_explicit_step(system: System, tableau: "Tableau | ExplicitMethod", t: float, h: float, state: State) -> Step:
    """Advance (t, y) to t + h with a HERK, PHERK or Arnold tableau.

    Stage i evaluates F_i = f(t + c_i h, Y_i, Z_i), Y_i = y (+) h sum_{j<i} a_ij F_j, where Z_i is such that
    y (+) h sum_{j<=i} ahat_ij F_j satisfies 0 = g(t + chat_i h, .); y_1 = y (+) h sum b_i F_i.

    Raises:
        mbdae.errors.StepError: if a stage cannot be solved.

    Source: Brasey, Hairer, SIAM J. Numer. Anal. 30 (1993), (2.1); Murua, Computing 59 (1997);
        Arnold, BIT 38 (1998), (6).
    """
    a = tableau.arrays
    n, first = len(a.c), int(tableau.explicit_first)
    chart = system.chart(t, state.y)
    F = np.zeros((n, system.ny))
    A, Ahat = h * a.A, h * a.Ahat
    times, constraint_times, factors = (t + a.c * h).tolist(), (t + a.chat * h).tolist(), Ahat.diagonal().tolist()
    if first:
        F[0], z = chart.first(state.carry)
    for i in range(first, n):  # F_i, ..., F_n are still zero
        F[i], z = chart.stage(times[i], A[i].dot(F), constraint_times[i], Ahat[i].dot(F), factors[i])
    x = h * a.b.dot(F) if state.compensation is None else h * a.b.dot(F) + state.compensation
    y = chart.point(x)
    carry = system.carry(F[-1], z) if first else None
    errors = h * a.e.dot(F)
    if tableau.project_embedded:
        errors = np.array([chart.project(e) for e in errors])
    return Step(State(y, carry, system.rounding_loss(state.y, x, y)), chart.all_multipliers(z), errors)


def step_doubling(
    step: Callable[[System, float, float, State], Step],
    order: int,
    system: System,
    t: float,
    h: float,
    state: State,
) -> Step:
    """Take two half steps, with the error estimate (y_half - y_full) / (2^p - 1), which needs no embedded formula.

    Source: Richardson extrapolation, Hairer, Noersett, Wanner I, (II.4.4).
    """
    full = step(system, t, h, state)
    half = step(system, t, h / 2, state)
    half = step(system, t + h / 2, h / 2, half.state)
    error = system.difference(full.state.y, half.state.y) / (2**order - 1)
    return Step(half.state, half.z, error[None])
