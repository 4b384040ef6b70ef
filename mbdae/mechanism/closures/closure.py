"""Base of closures of all kinds; each kind is a file of `mbdae.mechanism.closures.kinds`."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticUndefined

from ...discovery import Members
from ...errors import InputError
from ...system import Array
from ..checked_table import OneLine, Table, wrong_kind
from ..key_units import Unit
from ..tree.frames import Pair
from .active_range import ActiveRange
from .joint_rows import JointRow
from .kind_files import KIND_FILES
from .rows import FrameRows
from .unilateral_constraint import UnilateralOptions

Vector = tuple[float, float, float]
Z, X = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)


def _require_nonzero(axis: Vector) -> Vector:
    if not np.linalg.norm(axis) > 0:
        raise ValueError("an axis must not be zero")
    return axis


Axis = Annotated[Vector, AfterValidator(_require_nonzero), Unit("1")]


def kinds_of(base: type[Any]) -> dict[str, type[Any]]:
    """Return the subclasses of a class that have a kind, by kind; the first subclass of a kind counts."""
    out: dict[str, type[Any]] = {}
    for c in base.__subclasses__():
        kind = c.model_fields["kind"].default if "kind" in c.model_fields else PydanticUndefined
        for name, subclass in ({kind: c} if isinstance(kind, str) else kinds_of(c)).items():
            out.setdefault(name, subclass)
    return dict(sorted(out.items()))


KINDS = Members({x.kind: x.module for x in KIND_FILES}, lambda module, kind: kinds_of(Closure)[kind])
"""Every kind of closure that a file or a saved run may have, including those of installed packages."""
_CREATORS = {name: x.kind for x in KIND_FILES for name in x.creators}


class ByKind(OneLine):
    """Metaclass: ``Closure(kind="point", ...)`` makes a `PointClosure`, and ``Closure.point`` is its `create`."""

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:
        if args or cls is not Closure:
            return super().__call__(*args, **kwargs)
        kind = kwargs.get("kind")
        found = (KINDS.get(kind) or kinds_of(cls).get(kind)) if isinstance(kind, str) else None
        if not found:
            raise InputError(f"Closure: {wrong_kind('kind', sorted({*KINDS, *kinds_of(cls)}), kind)}")
        return found(**kwargs)

    def __getattr__(cls, name: str) -> Callable[..., Any]:
        if name.startswith("_"):
            return super().__getattr__(name)  # type: ignore[misc]
        known = name if name in KINDS else _CREATORS.get(name)
        found = {known: KINDS[known]} if known and cls is Closure else kinds_of(cls)
        for kind, c in found.items():
            if name == kind or (name != "create" and isinstance(vars(c).get(name), classmethod)):
                return getattr(c, "create" if name == kind else name)
        raise AttributeError(f"type object {cls.__name__!r} has no attribute {name!r}", name=name, obj=cls)

    def __dir__(cls) -> list[str]:
        return [*super().__dir__(), *{*KINDS, *kinds_of(cls)}]


class Closure(Table, metaclass=ByKind):
    """A closure between two frames a and b, or a coupling between two joints i and j.

    ``Closure.revolute("a", "b")`` and ``Closure(kind="revolute", frames=("a", "b"))`` create the same closure; `help`
    of the first shows its arguments. Gaps are measured along axes of the first frame, in m; directions as products of
    unit axes, in rad for small angles; couplings in rad or m of joint i. Rolling rows along the tangents, knife edges,
    gears, screws and ratios are velocity rows: they enforce G v = 0 and have no g.

    Attributes:
        kind: one of the kinds below.
        name: name of the closure; by default the names of both frames or joints.
        within: range of a joint coordinate in which the closure is active; always active when left out.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint or frame.
    """

    kind: str
    name: str = ""
    within: ActiveRange | None = None

    friction: ClassVar[str] = ""
    """Kind of friction interface: ``"revolute"`` (a pin in a bearing), ``"spherical"`` (a ball joint), ``"prismatic"``
    (along an axis) or ``"surface"`` (on a surface); empty if the closure has none."""
    normal_force_rows: ClassVar[int] = 1
    """Number of rows, the first ones, whose multipliers make up the normal force of friction."""
    coincident_origins: ClassVar[bool] = False
    """Whether the origins of both frames coincide."""
    distinct_frames: ClassVar[bool] = False
    """Whether the frames are apart even if the closure is satisfied: no gap between them is drawn."""

    if TYPE_CHECKING:

        def __init__(self, **data: Any) -> None: ...

        @property
        def frames(self) -> tuple[str, str] | None:
            """Names of frames a and b; None between joints."""

        @property
        def joints(self) -> tuple[str, ...] | None:
            """Names of joints; None between frames."""

    @model_validator(mode="after")
    def _complete(self) -> "Closure":
        self._require_distinct_ends()
        if not self.name:
            object.__setattr__(self, "name", self._default_name())
        return self

    def _require_distinct_ends(self) -> None:
        if len(set(names := self.between)) < len(names):
            what = f"{self.name or self._default_name()!r} joins {'frame' if self.frames else 'joint'}"
            raise ValueError(f"closure {what} {names[0]!r} with itself")

    def _default_name(self) -> str:
        return "-".join(self.between)

    @property
    def between(self) -> tuple[str, ...]:
        """Names of the connected frames or joints."""
        raise NotImplementedError

    @property
    def m(self) -> int:
        """Number of rows."""
        return sum(r.m for r in self.primitives())

    def primitives(self) -> Sequence[FrameRows] | Sequence[JointRow]:
        """Primitive rows that make up this closure."""
        raise NotImplementedError

    @property
    def is_unilateral(self) -> bool:
        """Whether the first row transmits a force in one direction only."""
        return False

    def coinciding_axes(self) -> tuple[Array, Array]:
        """Unit axes of frames a and b that coincide where the closure is satisfied, (3, m) each; m may be 0."""
        return np.empty((3, 0)), np.empty((3, 0))

    def flipped(self, relative: Array) -> bool:
        """Return whether the second frame is flipped although the rows vanish; ``relative`` (3, 3) is its rotation.

        Products of perpendicular axes also vanish for a frame rotated by pi; those of a full frame, also by 2 pi/3
        about a space diagonal.
        """
        a, b = self.coinciding_axes()
        return bool((a * (relative @ b)).sum() < (a.shape[1] - 1) / 2)

    @property
    def has_precondition(self) -> bool:
        """Whether it has a precondition: `violated_precondition` or `excluded_axes`."""
        return False

    def violated_precondition(self, pair: Pair, relative: Array) -> str:
        """Return which precondition on both frames is violated; empty if none.

        Args:
            pair: frames of the closure, with current poses.
            relative: rotation from a to b at the start, R_b^T R_a, (3, 3).
        """
        return ""

    def excluded_axes(self, pair: Pair) -> tuple[Array, str] | None:
        """Return axes (k, 3) about which the bodies must not rotate, and a message if they can; None without these."""
        return None


class BetweenFrames(Closure):
    """A closure between two frames.

    Attributes:
        frames: names of frames a and b; one of them may be ``"world"``.
    """

    frames: tuple[str, str]

    @property
    def joints(self) -> None:
        """None: it connects frames."""
        return None

    @property
    def between(self) -> tuple[str, ...]:
        return self.frames


class UnilateralClosure(BetweenFrames, UnilateralOptions):
    """A closure whose first row may be unilateral; the other rows are active together with it."""

    free_side: ClassVar[float] = 1.0
    """Sign of g where the row is inactive."""

    @property
    def is_unilateral(self) -> bool:
        return bool(self.unilateral)


class BetweenJoints(Closure):
    """A closure between joints of one coordinate each.

    Attributes:
        joints: names of joints i, j and, for some kinds, further joints.
    """

    joints: tuple[str, ...] = Field(min_length=2)

    @property
    def frames(self) -> None:
        """None: it connects joints."""
        return None

    @property
    def between(self) -> tuple[str, ...]:
        return self.joints
