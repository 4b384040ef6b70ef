"""Base of elements between joints of one coordinate, or a joint and the ground."""

from pydantic import model_validator

from ..checked_table import Table


class JointPair(Table):
    """Names of one or two joints.

    Attributes:
        joint: name of a joint, against the ground; or
        joints: names of joints i and j.
    """

    joint: str | None = None
    joints: tuple[str, str] | None = None

    @model_validator(mode="after")
    def _require_distinct_joints(self) -> "JointPair":
        if self.joints and self.joints[0] == self.joints[1]:
            raise ValueError(f"a {type(self).__name__.lower()} joins {self.joints[0]!r} with itself")
        return self

    @property
    def frames(self) -> None:
        """None: it connects joints."""
        return None

    @property
    def between(self) -> tuple[str, ...]:
        """Names of the joints."""
        return (self.joint,) if self.joint else self.joints or ()
