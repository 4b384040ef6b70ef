"""The ratio closure."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from ...key_units import Unit
from ..closure import BetweenJoints
from ..joint_rows import Ratio


class RatioClosure(BetweenJoints):
    """1 row: v_i = (c_0 + c_1 q_k + c_2 q_k^2 + ...) v_j (continuously variable transmissions).

    Attributes:
        joints: names of joints i, j and, if c_1, ... are given, k.
        coefficients: c_0, c_1, ... of the powers of q_k; only c_0 for two joints.
    """

    kind: Literal["ratio"] = "ratio"
    coefficients: Annotated[tuple[float, ...], Unit("q/q1", powers_of="q2")] = Field(min_length=1)

    @model_validator(mode="after")
    def _check_keys(self) -> "RatioClosure":
        if len(self.joints) > 3:
            raise ValueError("a ratio has two or three joints")
        if (len(self.coefficients) > 1) != (len(self.joints) > 2):
            raise ValueError("a ratio needs a third joint for coefficients c_1, ..., and no third joint without them")
        return self

    def primitives(self) -> tuple[Ratio]:
        i, j, *k = self.joints
        return (Ratio(i, j, k[0] if k else "", self.coefficients),)

    @classmethod
    def create(
        cls, joint: str, other: str, coefficients: tuple[float, ...], setting: str = "", name: str = ""
    ) -> "RatioClosure":
        """Velocities of joints satisfy v_joint = (c_0 + c_1 q_setting + ...) v_other."""
        joints = (joint, other, setting) if setting else (joint, other)
        return cls(joints=joints, coefficients=tuple(coefficients), name=name)
