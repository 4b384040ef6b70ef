"""Loop closures: joint constraints between two frames, and couplings between the coordinates of two joints."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Literal, get_args

import numpy as np
from pydantic import Field, model_validator

from ..tables import Table
from .rows import Coordinate, Distance, DotProduct1, DotProduct2, FrameRows

Kind = Literal[
    "point", "revolute", "frame", "prismatic", "cylindrical", "universal", "in_plane", "in_line", "parallel",
    "distance", "coupling",
]  # fmt: skip
KINDS: tuple[str, ...] = get_args(Kind)
Axis = tuple[float, float, float]
Polynomial = tuple[float, ...]

BETWEEN_FRAMES: dict[str, tuple[str, str]] = {  # kind: which gaps vanish, which directions are kept
    "point": ("all", ""),
    "revolute": ("all", "axis"),
    "frame": ("all", "frame"),
    "prismatic": ("across", "frame"),
    "cylindrical": ("across", "axis"),
    "universal": ("all", "cross"),
    "in_plane": ("along", ""),
    "in_line": ("across", ""),
    "parallel": ("", "axis"),
}
Z, X = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)


class Closure(Table):
    """A closure between two frames a and b, or a coupling between two joints i and j.

    ===========  ====  ===============================================================================
    kind         rows  what is kept
    ===========  ====  ===============================================================================
    point        3     the origins coincide (spherical joint)
    revolute     5     the origins coincide, and the axes keep one direction
    frame        6     the frames coincide (weld)
    prismatic    5     b slides along the axis of a and does not turn
    cylindrical  4     b slides along the axis of a and turns about it
    universal    4     the origins coincide, and the axis of a stays perpendicular to the second axis, of b
    in_plane     1     b's origin stays in the plane through a's origin with the axis of a as normal
    in_line      2     b's origin stays on the line through a's origin along the axis of a
    parallel     2     the axes keep one direction
    distance     1     the origins keep the distance ``length`` > 0 in m
    coupling     1     q_i = c_0 + c_1 q_j + c_2 q_j^2 + ... (gears, racks, mimic joints)
    ===========  ====  ===============================================================================

    Gaps are measured along axes of the first frame, in m; directions as products of unit axes, in rad for small
    angles; couplings in rad or m of joint i.

    The joints of a coupling have one coordinate each. That of an unbounded revolute joint is an angle known up to
    full turns: the coupling is measured up to the multiples that come of them, and refused where they leave nothing to
    measure (powers, or irrational ratios of two unbounded joints).

    Attributes:
        kind: one of the table.
        frames: names of frames a and b; ``"world"`` is one of them if need be.
        joints: names of joints i and j of a coupling.
        name: by default the names of both frames or joints.
        axis: an axis in the first frame; z when left out.
        second_axis: the axis in the second frame that goes with it; the same numbers when left out (universal: x).
        length: distance in m.
        coefficients: c_0, c_1, ... of a coupling.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is made, for a joint or frame that it does not have.
    """

    kind: Kind
    frames: tuple[str, str] | None = None
    joints: tuple[str, str] | None = None
    name: str = ""
    axis: Axis | None = None
    second_axis: Axis | None = None
    length: float | None = Field(default=None, gt=0)
    coefficients: Polynomial | None = Field(default=None, min_length=2)

    @model_validator(mode="after")
    def _keys_fit(self) -> "Closure":
        needed, possible = keys(self.kind)
        known = (*needed, *possible)
        given = {k for k in type(self).model_fields if getattr(self, k) is not None}
        for key in sorted(given.difference(known)):
            raise ValueError(f"{key} does not belong to a {self.kind} closure; known: {', '.join(known)}")
        for key in sorted(set(needed) - given):
            raise ValueError(f"a {self.kind} closure needs {key}")
        for axis in (self.axis, self.second_axis):
            if axis is not None and not np.linalg.norm(axis) > 0:
                raise ValueError("an axis must not be zero")
        a, b = ends = self.frames or self.joints or ("", "")
        if a == b:
            raise ValueError(f"closure {self.name!r} joins {'frame' if self.frames else 'joint'} {a!r} with itself")
        if not self.name:
            object.__setattr__(self, "name", "-".join(ends))
        return self

    @classmethod
    def point(cls, a: str, b: str, name: str = "") -> "Closure":
        """The origins of frames a and b coincide: 3 rows."""
        return cls(kind="point", frames=(a, b), name=name)

    @classmethod
    def revolute(cls, a: str, b: str, axis: Axis = Z, name: str = "", *, second_axis: Axis | None = None) -> "Closure":
        """Frames a and b share their origin and ``axis``: 5 rows."""
        return cls(kind="revolute", frames=(a, b), axis=axis, second_axis=second_axis, name=name)

    @classmethod
    def frame(cls, a: str, b: str, name: str = "") -> "Closure":
        """Frames a and b coincide: 6 rows."""
        return cls(kind="frame", frames=(a, b), name=name)

    @classmethod
    def prismatic(cls, a: str, b: str, axis: Axis = Z, name: str = "") -> "Closure":
        """Frame b slides along ``axis`` of frame a and does not turn: 5 rows."""
        return cls(kind="prismatic", frames=(a, b), axis=axis, name=name)

    @classmethod
    def cylindrical(
        cls, a: str, b: str, axis: Axis = Z, name: str = "", *, second_axis: Axis | None = None
    ) -> "Closure":
        """Frame b slides along ``axis`` of frame a and turns about it: 4 rows."""
        return cls(kind="cylindrical", frames=(a, b), axis=axis, second_axis=second_axis, name=name)

    @classmethod
    def universal(cls, a: str, b: str, axis: Axis = Z, second_axis: Axis = X, name: str = "") -> "Closure":
        """The origins coincide, ``axis`` of a and ``second_axis`` of b stay perpendicular: 4 rows."""
        return cls(kind="universal", frames=(a, b), axis=axis, second_axis=second_axis, name=name)

    @classmethod
    def in_plane(cls, a: str, b: str, axis: Axis = Z, name: str = "") -> "Closure":
        """The origin of b stays in the plane of a with normal ``axis``: 1 row."""
        return cls(kind="in_plane", frames=(a, b), axis=axis, name=name)

    @classmethod
    def in_line(cls, a: str, b: str, axis: Axis = Z, name: str = "") -> "Closure":
        """The origin of b stays on the line of a along ``axis``: 2 rows."""
        return cls(kind="in_line", frames=(a, b), axis=axis, name=name)

    @classmethod
    def parallel(cls, a: str, b: str, axis: Axis = Z, name: str = "", *, second_axis: Axis | None = None) -> "Closure":
        """``axis`` of a and ``second_axis`` of b keep one direction: 2 rows."""
        return cls(kind="parallel", frames=(a, b), axis=axis, second_axis=second_axis, name=name)

    @classmethod
    def distance(cls, a: str, b: str, length: float, name: str = "") -> "Closure":
        """The origins of frames a and b stay ``length`` metres apart: 1 row."""
        return cls(kind="distance", frames=(a, b), length=length, name=name)

    @classmethod
    def coupling(cls, joint: str, other: str, coefficients: Polynomial, name: str = "") -> "Closure":
        """Joint coordinates keep q_joint = c_0 + c_1 q_other + c_2 q_other^2 + ...: 1 row."""
        return cls(kind="coupling", joints=(joint, other), coefficients=tuple(coefficients), name=name)

    @property
    def between(self) -> tuple[str, ...]:
        """Names of the frames or joints that it is between."""
        return self.frames or self.joints or ()

    @property
    def m(self) -> int:
        """Number of rows."""
        return sum(r.m for r in self.rows())

    def rows(self) -> Sequence[FrameRows] | Sequence[Coordinate]:
        """The primitive rows that this closure is composed of."""
        if self.joints:
            return (Coordinate(*self.joints, self.coefficients or ()),)
        if self.kind == "distance":
            return (Distance(float(self.length or 0)),)
        return _between_frames(self.kind, self.axis or Z, self._other_axis)

    def agreeing(self) -> tuple[np.ndarray, np.ndarray]:
        """Unit axes of frames a and b that point the same way where the closure is closed, (3, m) each; m may be 0."""
        direction = BETWEEN_FRAMES.get(self.kind, ("", ""))[1]
        if direction == "frame":
            return np.eye(3), np.eye(3)
        axis, second = (x[:, None] for x in self._unit_axes())
        return (axis, second) if direction == "axis" else (axis[:, :0], second[:, :0])

    def turned_over(self, relative: np.ndarray) -> bool:
        """True where rows vanish because the second frame is turned over; ``relative`` (3, 3) is its rotation.

        Products of perpendicular axes vanish for a frame turned by half a turn too, for a whole frame also by a
        third of a turn about a space diagonal.
        """
        a, b = self.agreeing()
        return bool((a * (relative @ b)).sum() < (a.shape[1] - 1) / 2)

    def _unit_axes(self) -> tuple[np.ndarray, np.ndarray]:
        return _unit(self.axis or Z), _unit(self._other_axis)

    @property
    def _other_axis(self) -> Axis:
        return self.second_axis or (X if self.kind == "universal" else self.axis or Z)


@lru_cache(maxsize=256)
def _between_frames(kind: str, axis: Axis, other: Axis) -> tuple[FrameRows, ...]:
    """Rows between frames; workspaces share them, and they hold nothing that changes."""
    gap, direction = BETWEEN_FRAMES[kind]
    first, second = _unit(axis), _unit(other)
    normals, (x, y, z) = np.linalg.svd(first[None])[2][1:].T, np.eye(3)
    gaps = {"all": np.eye(3), "across": normals, "along": first[:, None]}
    axes = {
        "axis": (normals, np.column_stack([second, second])),
        "frame": (np.array([x, y, z]).T, np.array([y, z, x]).T),
        "cross": (first[:, None], second[:, None]),
    }
    out: list[FrameRows] = [DotProduct2(gaps[gap])] if gap else []
    return (*out, DotProduct1(*axes[direction])) if direction else tuple(out)


def _unit(axis: Axis) -> np.ndarray:
    return np.array(axis) / np.linalg.norm(axis)


def keys(kind: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Keys that a closure of this kind needs, and those that it may have."""
    if kind == "coupling":
        return ("kind", "joints", "coefficients"), ("name",)
    if kind == "distance":
        return ("kind", "frames", "length"), ("name",)
    gap, direction = BETWEEN_FRAMES[kind]
    axis = ("axis",) if gap in ("across", "along") or direction in ("axis", "cross") else ()
    second = ("second_axis",) if direction in ("axis", "cross") else ()
    return ("kind", "frames"), ("name", *axis, *second)
