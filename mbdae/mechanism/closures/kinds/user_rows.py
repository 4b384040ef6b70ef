"""Rows from a Python function, at position or velocity level, for constraints not covered by other closures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
import pinocchio as pin
from pydantic import BeforeValidator, Field, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticOmit

from ....callbacks import call_with_views, checked_value, function_name
from ....data_types import CoreData
from ....errors import InputError, StepError
from ....finite_differences import numerical_derivative
from ....system import Array
from ....tolerances import INTERPOLATION
from ...tree.frames import find_joint
from ..closure import BetweenJoints
from ..joint_rows import BoundJointRow, JointRow

STEP = 4e-3  # rad or m, of sixth-order central differences: error 3e-17 times the seventh derivative, rounding 1e-13

Names = Annotated[tuple[str, ...], BeforeValidator(lambda x: (x,) if isinstance(x, str) else x)]


class UserRows(BetweenJoints):
    """Rows 0 = g(q), or 0 = G(q) v, from a Python function of the coordinates of some joints.

    q are the coordinates of the joints in order, as in a configuration (cos and sin for a continuous joint; x, y, z and
    a quaternion for a free one), and n is the number of their velocities. For one row

        position: function(q) -> (g, G), a number and (n,), d/dt g = G v
        velocity: function(q) -> G, (n,)

    and for ``size`` rows g (size,), G (size, n). The function must be smooth. The unit of a multiplier is J per unit of
    g: N for g in m, N m for g in rad.

    Attributes:
        joints: names of the joints.
        function: the Python function, see above. A loaded solution has only its name: operations that evaluate it fail.
        partials: q -> dG/dq, (n, n) or (size, n, n), [.., j, k] the derivative of G_j along velocity k; by central
            differences when left out, to about 1e-12.
        size: number of rows.
        velocity: whether the rows are nonholonomic, 0 = G(q) v.

    Raises:
        InputError: for wrong values; at the first evaluation, if G is not the derivative of g.
    """

    kind: Literal["rows"] = "rows"
    joints: Names = Field(min_length=1)
    function: Callable[[Array], Any] | None = Field(default=None, exclude=True)
    partials: Callable[[Array], Any] | None = Field(default=None, exclude=True)
    size: int = Field(default=1, ge=1)
    velocity: bool = False

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """Omit the kind from the schema: a file cannot contain a function."""
        raise PydanticOmit

    def _require_distinct_ends(self) -> None:
        if len(set(self.joints)) < len(self.joints):
            raise ValueError(f"a joint is named twice: {', '.join(self.joints)}")
        if self.within:
            raise ValueError("within does not belong to rows")

    def _default_name(self) -> str:
        return function_name(self.function) if self.function else "rows"

    def primitives(self) -> "tuple[UserRow, ...]":
        return tuple(UserRow(self, i, not self.velocity) for i in range(self.size))

    @classmethod
    def create(cls, function: object, joints: str | Sequence[str], size: int = 1, **more: Any) -> "UserRows":
        """Rows from a Python function of joint coordinates."""
        return cls(joints=joints, function=function, size=size, **more)


@dataclass(frozen=True)
class UserRow(JointRow):
    """One of the rows of a function, by its index."""

    rows: UserRows
    index: int
    positional: bool

    def bind(self, model: pin.Model, data: pin.Data, at: int, name: str) -> "BoundUserRow":
        return BoundUserRow(model, data, self, at)


class BoundUserRow(BoundJointRow):
    """A row of a function, bound to a workspace."""

    def __init__(self, model: pin.Model, data: pin.Data, row: UserRow, at: int) -> None:
        self.at, self.rows, self.index, self.checked = at, row.rows, row.index, not row.positional
        self.joints = [find_joint(model, n) for n in row.rows.joints]
        self.columns = [i for j in self.joints for i in range(j.idx_v, j.idx_v + j.nv)]
        self._joint_data = [data.joints[j.id] for j in self.joints]
        self._joint_model = pin.Model()  # defines q (+) e
        for name, j in zip(row.rows.joints, self.joints, strict=True):
            self._joint_model.addJoint(0, j, pin.SE3.Identity(), name)
        self.what = f"rows {row.rows.name!r}"

    def core_data(self) -> CoreData:
        """See `BoundJointRow`; the core calls the functions."""
        coordinates = [i for j in self.joints for i in range(j.idx_q, j.idx_q + j.nq)]
        indices = {"iq": coordinates, "iv": self.columns, "positional": not self.rows.velocity}
        return {
            "kind": "function",
            **indices,
            "value": lambda q: np.append(*self._evaluate(q)),
            "bias": lambda q, v: np.array([self._bias(q, v)]),
            "partials": lambda q: np.ascontiguousarray(self._partials(q)),
        }

    def value(self) -> tuple[float, list[float]]:
        q = self._q()
        g, G = self._evaluate(q)
        if not self.checked:
            self._check(q, G)
            self.checked = True
        return g, G.tolist()

    def bias(self, v: Array) -> float:
        return self._bias(self._q(), v[self.columns])

    def partials(self, v: Array, lam: float, K: Array, B: Array) -> None:
        D = self._partials(self._q())
        K[np.ix_(self.columns, self.columns)] += lam * D
        B[self.columns] += v[self.columns] @ D

    def bias_partials(self, v: Array, by_q: Array, by_v: Array) -> None:
        q, rates = self._q(), v[self.columns]
        D = self._partials(q)
        by_v[self.columns] += (D + D.T) @ rates
        by_q[self.columns] += [self._derivative(lambda x: self._bias(x, rates), q, e) for e in np.eye(len(rates))]

    def _q(self) -> Array:
        return np.concatenate([j.joint_q for j in self._joint_data])

    def _evaluate(self, q: Array) -> tuple[float, Array]:
        """Return g at q, 0 for a velocity row, and G (n,)."""
        rows, n = self.rows, len(self.columns)
        if rows.function is None:
            raise InputError(f"{self.what} are a Python function and not in the file: load the mechanism with it again")
        value, shape = call_with_views(self.what, rows.function, None, q), (rows.size,) if rows.size > 1 else ()
        g = np.zeros(shape)
        if not rows.velocity:
            if not isinstance(value, tuple | list) or len(value) != 2:
                raise StepError("force", f"{self.what} returned {value!r:.80}, expected g and G")
            g, value = checked_value(value[0], shape, None, self.what), value[1]
        G = checked_value(value, (*shape, n), None, self.what)
        return (float(g[self.index]), G[self.index]) if shape else (float(g), G)

    def _bias(self, q: Array, v: Array) -> float:
        if self.rows.partials:
            return float(v @ self._partials(q) @ v)
        speed = float(np.abs(v).max())
        return speed * float(self._derivative(lambda x: self._evaluate(x)[1], q, v / speed) @ v) if speed else 0.0

    def _partials(self, q: Array) -> Array:
        """Return dG/dq, (n, n)."""
        n, size = len(self.columns), self.rows.size
        if self.rows.partials:
            what = f"partials of {self.what}"
            shape = (size, n, n) if size > 1 else (n, n)
            partials = checked_value(call_with_views(what, self.rows.partials, None, q), shape, None, what)
            return partials[self.index] if size > 1 else partials
        return np.column_stack([self._derivative(lambda x: self._evaluate(x)[1], q, e) for e in np.eye(n)])

    def _derivative(self, f: Callable[[Array], Any], q: Array, e: Array) -> Any:
        """Return the derivative of f at q along a velocity e."""
        return numerical_derivative(lambda x: f(pin.integrate(self._joint_model, q, x * e)), STEP)

    def _check(self, q: Array, G: Array) -> None:
        for k, e in enumerate(np.eye(len(G))):
            derivative = float(self._derivative(lambda x: self._evaluate(x)[0], q, e))
            if abs(derivative - G[k]) > INTERPOLATION * (1 + abs(G[k])):
                row = f" of row {self.index}" if self.rows.size > 1 else ""
                what = f"G{row} is {G[k]:.6g} along velocity {k}, but the derivative of g is {derivative:.6g}"
                raise InputError(f"{self.what}: {what}")
