"""What stands between joints of one coordinate, or a joint and the ground."""

from ..tables import Table


class BetweenJoints(Table):
    """Names of one or two joints.

    Attributes:
        joint: name of a joint, against the ground; or
        joints: names of joints i and j.
    """

    joint: str | None = None
    joints: tuple[str, str] | None = None

    @property
    def frames(self) -> None:
        """None: it is between joints."""
        return None

    @property
    def between(self) -> tuple[str, ...]:
        """Names of its joints."""
        return (self.joint,) if self.joint else self.joints or ()
