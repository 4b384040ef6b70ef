"""Springs and dampers in joints of one coordinate."""

from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
import pinocchio as pin
from pydantic import Field, field_validator, model_validator

from ..key_units import Unit
from ..time_functions.piecewise_polynomial import (
    Interpolation,
    PiecewisePolynomial,
    Point,
    interpolant_of_points,
    require_increasing,
)
from .force import Array, CoreData, Force, ForceElement, Joints, single_coordinate_joints
from .joint_law import Effort, JointElement
from .linear import LinearElement, Spring

if TYPE_CHECKING:
    from scipy.interpolate import PPoly


class JointSpring(Force):
    """A spring and damper on joints of one coordinate: tau = -c(q - rest) - damping * v.

    Attributes:
        joint: one joint or several; not a continuous joint, whose angle is known only up to full revolutions.
        stiffness: stiffness in N m/rad or N/m, c(x) = stiffness * x.
        table: points (deflection, restoring torque) of a nonlinear c instead, deflections increasing; linear
            extrapolation beyond its ends. The potential is the exact integral.
        interpolation: kind of curve: ``"spline"`` (natural cubic) or ``"monotone"`` (cubic without overshoot).
        rest: rest position in rad or m.
        damping: damping coefficient in N m s/rad or N s/m, in addition to that of the joint.
        name: name in parameters, signals and messages; the kind and a number if omitted.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint or frame.
    """

    kind: Literal["joint_spring"] = "joint_spring"
    joint: Joints
    stiffness: Annotated[float | None, Unit("e/q")] = None
    table: Annotated[tuple[Point, ...] | None, Unit("q", "e")] = Field(default=None, min_length=2)
    interpolation: Interpolation = "spline"
    rest: Annotated[float, Unit("q")] = 0.0
    damping: Annotated[float, Unit("e s/q")] = Field(default=0.0, ge=0)

    @field_validator("table")
    @classmethod
    def _check_deflections(cls, table: tuple[Point, ...] | None) -> tuple[Point, ...] | None:
        return require_increasing(table) if table else None

    @model_validator(mode="after")
    def _check_law(self) -> "JointSpring":
        if (self.stiffness is None) == (self.table is None):
            raise ValueError("a joint_spring takes a stiffness or a table")
        _ = self.table and self.curve
        return self

    @cached_property
    def curve(self) -> "PPoly":
        """The table's restoring torque as a function of the deflection."""
        return interpolant_of_points(self.table or (), self.interpolation, "linear")

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:
        joints = single_coordinate_joints(model, self.joint, f"joint_spring {self.name!r}")
        indices = [(j.idx_q, j.idx_v) for j in joints]
        if self.stiffness is None:
            return CurveElement(self, indices)
        springs = [Spring(iq, iv, self.stiffness, self.rest) for iq, iv in indices]
        return LinearElement(self.name, [("tau", iv, "v", iv, -self.damping) for _, iv in indices], springs=springs)


class CurveElement(JointElement):
    """The law of a `JointSpring` with a table, c a piecewise polynomial."""

    def __init__(self, spec: JointSpring, indices: list[tuple[int, int]]) -> None:
        super().__init__(spec.name, [iv for _, iv in indices], [iq for iq, _ in indices])
        self.curve, self.rest, self.damping = spec.curve, spec.rest, spec.damping
        self.integral, self.tangent_stiffness = self.curve.antiderivative(), self.curve.derivative()
        self.deflections = [(iv, "") for iv in self.rows]

    def deflection(self, q: Array) -> Array:
        return q[self.columns] - self.rest

    def effort(self, q: Array, v: Array) -> Effort:
        x = q - self.rest
        torque = self.curve(x.real)
        if np.iscomplexobj(x):
            torque = torque + 1j * self.tangent_stiffness(x.real) * x.imag
        return -torque, -self.damping * v

    def potential(self, q: Array) -> float:
        """Return the integral of c from 0 to the deflection, over all coordinates, in J."""
        return float((self.integral(self.deflection(q)) - self.integral(0.0)).sum())

    def core_data(self) -> CoreData:
        functions = [PiecewisePolynomial.from_ppoly(x).core_data() for x in (self.curve, self.integral)]
        indices = {"rows": self.rows, "columns": self.columns, "a": [self.rest, self.damping]}
        return {"kind": "curve", **indices, "signals": functions}
