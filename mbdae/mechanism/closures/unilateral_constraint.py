"""Unilateral closures and joint stops: their rows are active while they transmit a force."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field, model_validator

from ..checked_table import Table
from ..key_units import Unit
from .joint_pair import JointPair
from .joint_rows import Coordinate


class UnilateralOptions(Table):
    """Options of unilateral rows.

    Attributes:
        unilateral: whether the row transmits compression only (tension only for a rope), and is inactive otherwise.
        restitution: coefficient of restitution of Newton's law of impact, between 0 and 1; 0 when left out.
        rest: flight time in s between two impacts, below which the contact remains closed; 1e-6 when left out.
    """

    unilateral: bool | None = None
    restitution: Annotated[float | None, Unit("1")] = Field(default=None, ge=0, le=1)
    rest: Annotated[float | None, Unit("s")] = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _check_options(self) -> "UnilateralOptions":
        if not self.unilateral and (self.restitution is not None or self.rest is not None):
            raise ValueError("restitution and rest belong to unilateral = true")
        return self


class Stop(JointPair, UnilateralOptions):
    """Stops that limit a joint coordinate, or the play of a coupling (backlash).

        lower <= q_i <= upper,   lower <= q_i - c_0 - c_1 q_j - c_2 q_j^2 - ... <= upper

    Each stop is a unilateral row; its multiplier is the torque (N m) or force (N) on joint i.

    Attributes:
        joint: name of a bounded joint of one coordinate; or
        joints: names of joints i and j, with ``coefficients``.
        coefficients: c_0, c_1, ... for ``joints``.
        lower: lower limit in rad or m; no lower stop when left out.
        upper: upper limit in rad or m; no upper stop when left out.
        limits: whether to use the limits of the source (URDF ``limit``, MJCF ``range``); without a joint, those of all
            joints that have limits.
        restitution: coefficient of restitution of Newton's law of impact, between 0 and 1; 0 when left out.
        rest: flight time in s between two impacts, below which the contact remains closed; 1e-6 when left out.
        unilateral: always true.
        name: name of the stop; by default the names of the joints and "stop".

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint.
    """

    unilateral: bool | None = True
    coefficients: Annotated[tuple[float, ...] | None, Unit("q", powers_of="q1")] = Field(default=None, min_length=2)
    lower: Annotated[float | None, Unit("q")] = None
    upper: Annotated[float | None, Unit("q")] = None
    limits: bool = False
    name: str = ""

    @model_validator(mode="after")
    def _check_joints(self) -> "Stop":
        if not self.unilateral:
            raise ValueError("a stop is always unilateral")
        if (self.joints is None) != (self.coefficients is None):
            raise ValueError("a stop of joints needs coefficients, and no other stop takes them")
        if self.joint is not None and self.joints is not None:
            raise ValueError("a stop needs one of joint and joints")
        if not self.name and self.between:
            object.__setattr__(self, "name", "-".join(self.between) + " stop")
        return self

    @model_validator(mode="after")
    def _check_limits(self) -> "Stop":
        if self.limits and (self.joints is not None or self.lower is not None or self.upper is not None):
            raise ValueError("limits = true takes the limits from the source: give no joints, lower or upper")
        if not self.limits and not self.between:
            raise ValueError("a stop needs joint, joints or limits = true")
        if not self.limits and self.lower is None and self.upper is None:
            raise ValueError("a stop needs lower, upper or both")
        if self.lower is not None and self.upper is not None and not self.lower < self.upper:
            raise ValueError(f"lower must lie below upper, got lower = {self.lower:g} and upper = {self.upper:g}")
        return self

    @property
    def one_sided_limits(self) -> tuple[tuple[float, float], ...]:
        """Limits, and the side on which the joint moves: 1 above, -1 below the limit."""
        both = ((self.lower, 1.0), (self.upper, -1.0))
        return tuple((end, side) for end, side in both if end is not None)

    @property
    def one_sided_names(self) -> tuple[str, ...]:
        """Name of each row: the name of the stop, followed by the side if there are two rows."""
        sides = ("lower", "upper") if self.m > 1 else ()
        return tuple(f"{self.name} {side}" for side in sides) or (self.name,)

    @property
    def m(self) -> int:
        """Number of rows: one for each limit."""
        return len(self.one_sided_limits)

    def primitives(self) -> Sequence[Coordinate]:
        """The rows q_i - p(q_j) - limit."""
        joint, other = self.joints or (self.joint or "", "")
        c_0, *rest = self.coefficients or (0.0,)
        return [Coordinate(joint, other, (c_0 + end, *rest)) for end, _ in self.one_sided_limits]
