"""Derivatives of textbook problems by difference quotients, and a check of the derivatives of g, on which z depends."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Protocol

import numpy as np

from ..errors import InputError, StepError
from ..finite_differences import ABOVE, BELOW, STENCIL, converged_difference
from ..system import Array
from ..tolerances import THREE_DIGITS

WIDTH = 1e-3  # fraction of 1 + |u|: largest width of the differences
IRRATIONAL = (np.sqrt(5) - 1) / 2  # the fractional parts of its multiples differ for all components of y


class ConstraintDerivatives(Protocol):
    """g and its derivatives."""

    problem: Any

    def g(self, t: float, y: Array) -> Array:
        """Return g (nz,)."""

    def g_y(self, t: float, y: Array) -> Array:
        """Return g_y (nz, ny)."""

    def g_t(self, t: float, y: Array) -> Array:
        """Return g_t (nz,)."""


def require_derivatives_of_g(system: ConstraintDerivatives, t: float, y: Array) -> None:
    """Check that g_t + g_y w = d/ds g(t + s, y + s w) at s = 0 for one direction w, whose components all differ.

    Where g has a kink, as at the first entry of a table, one-sided derivatives are accepted.

    Raises:
        InputError: if three digits do not agree; even for g = a t^1.5, difference quotients have four correct digits.
    """
    w = (1 + np.abs(y)) * (0.5 + np.arange(1, len(y) + 1) * IRRATIONAL % 1)
    g_y, g_t = system.g_y(t, y), system.g_t(t, y)
    derivative, scale = g_t + g_y @ w, float((np.abs(g_t) + np.abs(g_y) @ w).max(initial=0.0))

    quotients: list[Array] = []
    for stencil in (STENCIL, ABOVE, BELOW):
        with suppress(StepError):  # where g is not defined
            quotients.append(_derivative(lambda s: system.g(t + s, y + s * w), WIDTH, stencil))
            if not np.isfinite(quotients[-1]).all() or np.abs(quotients[-1] - derivative).max() <= THREE_DIGITS * scale:
                return
    if quotients:
        i = int(np.argmax(np.abs(quotients[0] - derivative)))
        raise InputError(
            f"g_y or g_t of {system.problem.title!r} is not the derivative of g at the start: g_t + g_y w of row "
            f"{i + 1} is {derivative[i]:.6g} in a direction w where difference quotients give {quotients[0][i]:.6g}"
        )


def jacobian(function: Callable[[Array], Array], u: Array) -> Array:
    """Return partial derivatives, (m, n), by differences of order six that agree with those of a smaller width."""
    directions = zip(np.eye(len(u)), WIDTH * (1 + np.abs(u)), strict=True)
    return np.stack([_derivative(lambda s, e=e: function(u + s * e), h) for e, h in directions], axis=-1)  # type: ignore[misc]


def _derivative(value: Callable[[float], Array], width: float, stencil: Sequence[int] = STENCIL) -> Array:
    """Return the derivative of value: s -> (m,) at s = 0, (m,), by differences of at most this width."""
    return converged_difference(lambda h: {k: value(k * h) for k in stencil}, width).derivative
