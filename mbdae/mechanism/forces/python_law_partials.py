"""Force laws in Python for the core, with partial derivatives from user functions or central differences."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from ...callbacks import call_with_views, checked_value
from .force import Array, CoreData, ForceElement

WIDTH = 6e-6
"""Half width of the central differences, absolute in q and t, relative to 1 + |x| in v and s: eps^(1/3).

Their error is about 6e-12 |f'''|, and 4e-11 |f| from rounding."""

LawFunction = Callable[[Array, Array, Array], Array]


def python_core_data(element: ForceElement) -> CoreData:
    """Return the core data of a law in Python: the core calls its functions."""
    law: CoreData = {"kind": "python", "call": lambda *point: element.evaluate(*point)[1:]}
    return law | {"partials": element.partials, "time_rate": element.time_partials}


def law_time_partials(law: Callable[[float], Array], t: float, v: Array) -> Array:
    """Return d/dt of (tau, s', power) by a central difference, for law: t -> (tau, s')."""
    difference = (law(t + WIDTH) - law(t - WIDTH)) / ((t + WIDTH) - (t - WIDTH))
    return np.append(difference, difference[: len(v)] @ v)


def law_partials(
    law: LawFunction,
    user_partials: Callable[..., Any] | None,
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
        user_partials: user function of (t, q, v), and of s if there are states, that returns d(tau, s'); or None.
        what: the law in messages.
        model: Pinocchio model, whose `integrate` displaces q.
        t: time.
        q: configuration.
        v: velocity.
        s: states, (ns,).
    """
    nv, n = len(v), len(v) + len(s)
    tau = law(q, v, s)[:nv]
    if user_partials is not None:
        what = f"partials of {what}"
        value = call_with_views(what, user_partials, t, q, v, *([s] if len(s) else []))
        partials = checked_value(value, (n, nv + n), t, what)
    else:
        columns = [(law(pin.integrate(model, q, e), v, s) - law(pin.integrate(model, q, -e), v, s)) / (2 * WIDTH)
                   for e in WIDTH * np.eye(nv)]  # fmt: skip
        x = np.concatenate([v, s])
        for i, h in enumerate(WIDTH * (1 + np.abs(x))):
            plus, minus = x.copy(), x.copy()
            plus[i], minus[i] = x[i] + h, x[i] - h
            difference = law(q, plus[:nv], plus[nv:]) - law(q, minus[:nv], minus[nv:])
            columns.append(difference / (plus[i] - minus[i]))
        partials = np.array(columns).T
    power = v @ partials[:nv]
    power[nv : 2 * nv] += tau
    return np.vstack([partials, power])
