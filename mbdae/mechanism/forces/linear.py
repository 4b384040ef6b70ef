"""Linear elements: [tau; s'] = C [q; v; s; u(t); u'(t); 1], and springs, which have a potential.

Dampers, springs, torques, controllers, motors and sampled torques are linear elements. All linear elements of a
workspace are evaluated together, from the entries of one sparse matrix C, in Python and in the core.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ..time_functions.time_functions import Constant, TimeFunction
from .force import Array, CoreData, ForceElement

Term = tuple[str, int, str, int, float]
"""An entry of C: row ``"tau"`` or ``"ds"``, its index, column ``"q"``, ``"v"``, ``"s"``, ``"u"``, ``"du"`` or ``"1"``,
its index, and the value. ``"q"`` is a joint of one coordinate."""

ORDERS = {"u": 0, "du": 1}
ONE = np.ones(1)


class Spring(NamedTuple):
    """tau_iv = -stiffness (q_iq - rest) on a joint of one coordinate."""

    iq: int
    iv: int
    stiffness: float
    rest: float


class LinearElement(ForceElement):
    """A linear force law; the work of all terms except springs is integrated.

    Args:
        name: name in messages.
        terms: the entries of C.
        springs: springs in joints.
        time_functions: u, functions of time.
        states: names and initial values of s.
    """

    def __init__(
        self,
        name: str,
        terms: Sequence[Term] = (),
        *,
        springs: Sequence[Spring] = (),
        time_functions: Sequence[TimeFunction] = (),
        states: Mapping[str, float] | None = None,
    ) -> None:
        super().__init__(name, time_functions, states)
        self.terms, self.springs, self.u = terms, springs, time_functions
        self.differentiated = [time_functions[j] for _, _, column, j, value in terms if ORDERS.get(column) and value]
        self.deflections = [(spring.iv, "") for spring in springs]

    def acting_components(self, nv: int) -> list[int]:
        return sorted({i for row, i, *_ in self.terms if row == "tau"} | {spring.iv for spring in self.springs})

    def deflection(self, q: Array) -> Array:
        return np.array([q[spring.iq] - spring.rest for spring in self.springs])


class Linear(ForceElement):
    """All linear laws of a workspace, y = C x as one product.

    y = (tau of springs, remaining tau, s') and x = (q, v, s, 1, and the u and u' in use).

    Args:
        laws: each with the slice of its states in s.
        model: a Pinocchio model.
        ns: length of s.
    """

    def __init__(self, laws: Sequence[tuple[LinearElement, slice]], model: pin.Model, ns: int) -> None:
        super().__init__("linear")
        self.nq, self.nv, self.ns = model.nq, model.nv, ns
        self.tangent = dict(zip(model.idx_qs, model.idx_vs, strict=True))
        self.springs = [spring for law, _ in laws for spring in law.springs]
        self.u: list[tuple[TimeFunction, int]] = []  # functions and orders of their derivatives
        self._input_columns: dict[tuple[int, int], int] = {}
        one = self.nq + self.nv + ns
        entries = [(iv, iq, -k) for iq, iv, k, _ in self.springs]
        entries += [(iv, one, k * rest) for _, iv, k, rest in self.springs]
        for law, at in laws:
            rows = {"tau": self.nv, "ds": 2 * self.nv + at.start}
            columns = {"q": 0, "v": self.nq, "s": self.nq + self.nv + at.start, "1": one}
            for row, i, column, j, value in law.terms:
                known = column in columns
                x, value = (columns[column] + j, value) if known else self._input(law.u[j], ORDERS[column], value)
                entries.append((rows[row] + i, x, value))
        y, x, self.values = np.array([e for e in entries if e[2]], float).reshape(-1, 3).T
        self.y, self.x = y.astype(int), x.astype(int)

    def _input(self, u: TimeFunction, k: int, value: float) -> tuple[int, float]:
        """Return column and value of an entry for u or u'; constants use the column of 1."""
        one = self.nq + self.nv + self.ns
        if isinstance(u, Constant):
            return one, value * u.at(0.0, k)
        if value and (id(u), k) not in self._input_columns:
            self._input_columns[id(u), k] = len(self.u)
            self.u.append((u, k))
        return one + 1 + self._input_columns.get((id(u), k), 0), value

    def evaluate(self, t: float, q: Array, v: Array, s: Array) -> tuple[Array, Array, Array]:
        x = np.concatenate((q, v, s, [1.0, *[u.at(t, k) for u, k in self.u]] if self.u else ONE))
        y = np.bincount(self.y, self.values * x.take(self.x), 2 * self.nv + self.ns)
        return y[: self.nv], y[self.nv : 2 * self.nv], y[2 * self.nv :]

    def partials(self, t: float, q: Array, v: Array, s: Array) -> Array:
        nv, A = self.nv, self._matrix
        power = v @ A[nv : 2 * nv]
        power[nv : 2 * nv] += self.evaluate(t, q, v, s)[1]
        return np.vstack([A[:nv] + A[nv : 2 * nv], A[2 * nv :], power])

    def time_partials(self, t: float, q: Array, v: Array, s: Array) -> Array:
        x = np.zeros(len(q) + len(v) + len(s) + 1 + len(self.u))
        x[len(x) - len(self.u) :] = [u.derivative(t, k + 1) for u, k in self.u]
        y = np.bincount(self.y, self.values * x.take(self.x), 2 * self.nv + self.ns)
        other = y[self.nv : 2 * self.nv]
        return np.concatenate([other, y[2 * self.nv :], [other @ v]])

    @cached_property
    def _matrix(self) -> Array:
        """dy/d(q in the tangent, v, s), (2 nv + ns, 2 nv + ns)."""
        nq, size = self.nq, 2 * self.nv + self.ns
        out = np.zeros((size, size))
        for i, j, value in zip(self.y, self.x, self.values, strict=True):
            if j < nq + self.nv + self.ns:
                out[i, self.tangent[j] if j < nq else j - nq + self.nv] += value
        return out

    def potential(self, q: Array) -> float:
        return sum(0.5 * k * float(q[iq] - rest) ** 2 for iq, _, k, rest in self.springs)

    def core_data(self) -> CoreData:
        signals, orders = [u.core_data() for u, _ in self.u], [k for _, k in self.u]
        numbers = {"rows": self.y.tolist(), "columns": self.x.tolist(), "a": self.values.tolist()}
        energy = sum(0.5 * k * rest**2 for _, _, k, rest in self.springs)
        return {"kind": "linear", **numbers, "signals": signals, "orders": orders, "offset": energy}
