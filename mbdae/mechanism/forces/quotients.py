"""Partial derivatives of Python laws: given by the user, or by central differences of that law alone."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from ..callbacks import call_with_views, checked_value
from .force import Array

STEP = 6e-6
"""Step of the central differences in q, and relative to 1 + |x| in v and s: eps^(1/3). Their error is 4e-11 |f'''|."""

LawFunction = Callable[[Array, Array, Array], Array]


def by_time(law: Callable[[float], Array], t: float, v: Array) -> Array:
    """Return the derivative of (tau, s', power) with respect to time, for law: t -> (tau, s')."""
    change = (law(t + STEP) - law(t - STEP)) / ((t + STEP) - (t - STEP))
    return np.append(change, change[: len(v)] @ v)


def law_partials(
    law: LawFunction,
    own: Callable[..., Any] | None,
    what: str,
    model: pin.Model,
    t: float,
    q: Array,
    v: Array,
    s: Array,
) -> Array:
    """Return the partial derivatives of (tau, s', power) with respect to (q, v, s), (nv + ns + 1, 2 nv + ns).

    Args:
        law: (q, v, s) -> (tau, s'), (nv + ns,).
        own: partial derivatives from the user, called with (t, q, v) and, if there are states, s; or None.
        what: kind of law, for messages.
        model: defines q (+) e.
        t: time.
        q: configuration.
        v: velocity.
        s: states, (ns,).
    """
    nv, n = len(v), len(v) + len(s)
    tau = law(q, v, s)[:nv]
    if own is not None:
        what = f"partials of {what}"
        known = call_with_views(what, own, t, q, v, *([s] if len(s) else []))
        partials = checked_value(known, (n, nv + n), t, what)
    else:
        columns = [(law(pin.integrate(model, q, e), v, s) - law(pin.integrate(model, q, -e), v, s)) / (2 * STEP)
                   for e in STEP * np.eye(nv)]  # fmt: skip
        x = np.concatenate([v, s])
        for i, h in enumerate(STEP * (1 + np.abs(x))):
            ahead, behind = x.copy(), x.copy()
            ahead[i], behind[i] = x[i] + h, x[i] - h
            change = law(q, ahead[:nv], ahead[nv:]) - law(q, behind[:nv], behind[nv:])
            columns.append(change / (ahead[i] - behind[i]))
        partials = np.array(columns).T
    power = v @ partials[:nv]
    power[nv : 2 * nv] += tau
    return np.vstack([partials, power])
