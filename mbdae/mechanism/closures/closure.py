"""Closures: joint constraints and rolling between two frames, couplings between joint coordinates."""

from collections.abc import Sequence
from typing import Any, Literal, get_args

import numpy as np
from pydantic import Field, model_validator

from ..time_functions import Harmonic
from .active_range import ActiveRange
from .contact import ConvexBody
from .key_rules import BETWEEN_FRAMES, GRIPS, check_key_values, check_keys
from .motion_laws import Law, LawTable
from .primitives import primitives_of
from .profiles import AnyProfile, Profile
from .rows import FrameRows, JointRow, unit_axis
from .unilateral_constraint import UnilateralOptions

Kind = Literal[
    "point", "revolute", "frame", "prismatic", "cylindrical", "universal", "in_plane", "in_line", "parallel",
    "distance", "coupling", "cam", "slot", "rolling", "knife_edge", "gear", "bevel", "screw", "ratio",
]  # fmt: skip
KINDS: tuple[str, ...] = get_args(Kind)
Axis = tuple[float, float, float]
Polynomial = tuple[float, ...]

Z, X = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
Surface = Literal["plane", "sphere", "cylinder"]


class Closure(UnilateralOptions):
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
    coupling     1     q_i = c_0 + c_1 q_j + c_2 q_j^2 + ... or q_i = c_0 + c_1 q_j + c_2 q_k + ... or q_i = f(q_j)
    rolling      3     b rolls on a plane (z of a), sphere or cylinder of a: it touches and does not slip
    knife_edge   1     b's origin does not slip along the axis of b
    gear         1     wheels about parallel axes do not slip where the line of centres is divided as by their radii
    bevel        1     wheels about axes that meet do not slip on each other: r_a w_a = -r_b w_b on their carrier
    screw        1     b advances along the axis of a by ``lead`` per turn about it, besides a cylindrical closure
    cam          1     a roller of b, or a flat face of it, touches a profile in the x-y plane of a
    slot         1     b's origin stays on a curve in the x-y plane of a
    ratio        1     v_i = (c_0 + c_1 q_k + c_2 q_k^2 + ...) v_j (continuously variable transmissions)
    ===========  ====  ===============================================================================

    Gaps are measured along axes of the first frame, in m; directions as products of unit axes, in rad for small
    angles; couplings in rad or m of joint i.

    Rolling rows along the tangents, knife edges, gears, screws and ratios are velocity rows: they enforce G v = 0 and
    have no g. A rolling body is a disc or torus (``radius``, ``tyre``, ``axis``), a sphere (``tyre`` equals the
    radius, or is left out with the axis) or an ellipsoid (``semi_axes``, ``centre``). The rolling rows are the height
    (multiplier N > 0 under compression), then no slip forwards and no slip to the left of the wheel; for a body without
    an axle, along x and y of a.

    The joints of a coupling have one coordinate each. Angles of unbounded revolute joints are known up to full turns:
    the coupling is evaluated up to their multiples, and rejected where this is not possible (powers, irrational
    ratios).

    Attributes:
        kind: one of the table.
        frames: names of frames a and b; one of them may be ``"world"``.
        joints: names of joints i and j of a coupling; of i, j and, where c_1, ... are given, k of a ratio.
        name: by default the names of both frames or joints.
        axis: an axis in the first frame, z when left out; of a wheel (its axle, to its left) and of a knife edge in
            the second frame; of a cam's flat face through b's origin, in the second frame, away from the cam.
        second_axis: the corresponding axis in the second frame; the same components when left out (universal: x). Both
            axes of a bevel pair point from their intersection to the wheels.
        length: distance in m.
        coefficients: c_0, c_1, ... of a ratio or a coupling: powers between two joints, else one for each joint.
        curve: the law f of a coupling of two joints, in place of coefficients (cams by their law, indexing drives).
        profile: of a cam, or of a slot, in the x-y plane of the first frame.
        radius: of a wheel or sphere in m, the outer one; of a cam's roller about b's origin.
        tyre: radius of the section of a wheel's tyre in m: 0 when left out, a knife edge; ``radius`` for a sphere.
        semi_axes: of an ellipsoid along the axes of the second frame, in m.
        centre: of an ellipsoid in the second frame, in m; its origin when left out.
        grip: no-slip directions of a rolling body: ``"full"`` when left out, ``"lateral"``, ``"longitudinal"``,
            ``"none"``, or along one line at an angle in rad from ahead to the left (rollers of omni and mecanum
            wheels).
        contact: whether the closure keeps a rolling body on the surface; false where joints do so. True when left out.
        surface: on which a body rolls: the x-y plane of the first frame when left out; spheres on a sphere or cylinder.
        surface_radius: of a sphere or cylinder in m; negative where the body rolls inside.
        radii: of both wheels of a gear or bevel pair in m; negative for a ring whose teeth point inwards.
        lead: of a screw in m per turn, positive for a right-handed one.
        within: active range of the closure over a joint coordinate; always active when left out.
        unilateral: the one row pushes and does not pull (a rope pulls and does not push); it opens and closes.
        restitution: of its impacts, between 0 and 1: speed after an impact to speed before; 0 when left out.
        rest: duration in s below which a flight between two impacts ends in rest; 1e-6 when left out.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint or frame.
    """

    kind: Kind
    frames: tuple[str, str] | None = None
    joints: tuple[str, ...] | None = Field(default=None, min_length=2)
    name: str = ""
    axis: Axis | None = None
    second_axis: Axis | None = None
    length: float | None = Field(default=None, gt=0)
    coefficients: Polynomial | None = Field(default=None, min_length=1)
    curve: Law | None = None
    profile: Profile | None = None
    radius: float | None = Field(default=None, gt=0)
    tyre: float | None = Field(default=None, ge=0)
    semi_axes: tuple[float, float, float] | None = None
    centre: tuple[float, float, float] | None = None
    grip: Literal["full", "lateral", "longitudinal", "none"] | float | None = None
    contact: bool | None = None
    surface: Surface | None = None
    surface_radius: float | None = None
    radii: tuple[float, float] | None = None
    lead: float | None = None
    within: ActiveRange | None = None

    @model_validator(mode="after")
    def _checked(self) -> "Closure":
        self._keys_fit()
        if not self.name:
            object.__setattr__(self, "name", "-".join(self.between))
        return self

    def _keys_fit(self) -> None:
        check_keys(self)
        check_key_values(self)

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
    def coupling(cls, joint: str, other: str | Sequence[str], coefficients: Polynomial, name: str = "") -> "Closure":
        """Joint coordinates keep q_joint = c_0 + c_1 q_other + c_2 q_other^2 + ...: 1 row; or a sum over several."""
        others = (other,) if isinstance(other, str) else other
        return cls(kind="coupling", joints=(joint, *others), coefficients=tuple(coefficients), name=name)

    @classmethod
    def law(cls, joint: str, other: str, curve: LawTable | Harmonic, name: str = "") -> "Closure":
        """Joint coordinates keep q_joint = f(q_other): 1 row of a coupling."""
        return cls(kind="coupling", joints=(joint, other), curve=curve, name=name)

    @classmethod
    def cam(cls, a: str, b: str, profile: AnyProfile, name: str = "", **more: Any) -> "Closure":
        """A roller (``radius``) or a flat face (``axis``) of b touches a profile of a: 1 row."""
        return cls(kind="cam", frames=(a, b), profile=profile, name=name, **more)

    @classmethod
    def slot(cls, a: str, b: str, profile: AnyProfile, name: str = "") -> "Closure":
        """The origin of b stays on a curve in the x-y plane of a: 1 row."""
        return cls(kind="slot", frames=(a, b), profile=profile, name=name)

    @classmethod
    def rolling(cls, a: str, b: str, radius: float, axis: Axis | None = None, name: str = "", **more: Any) -> "Closure":
        """A wheel of b with its axle, or a sphere, rolls on the x-y plane of a: 3 rows; further keys by name."""
        return cls(kind="rolling", frames=(a, b), radius=radius, axis=axis, name=name, **more)

    @classmethod
    def knife_edge(cls, a: str, b: str, axis: Axis, name: str = "") -> "Closure":
        """The origin of b does not slip along ``axis`` of b: 1 row."""
        return cls(kind="knife_edge", frames=(a, b), axis=axis, name=name)

    @classmethod
    def gear(cls, a: str, b: str, radii: tuple[float, float], axis: Axis = Z, name: str = "") -> "Closure":
        """Wheels about parallel axes through the origins of a and b do not slip on each other: 1 row."""
        return cls(kind="gear", frames=(a, b), radii=radii, axis=axis, name=name)

    @classmethod
    def bevel(
        cls, a: str, b: str, radii: tuple[float, float], axis: Axis = Z, second_axis: Axis = Z, name: str = ""
    ) -> "Closure":
        """Wheels about ``axis`` of a and ``second_axis`` of b, which meet, do not slip on each other: 1 row."""
        return cls(kind="bevel", frames=(a, b), radii=radii, axis=axis, second_axis=second_axis, name=name)

    @classmethod
    def screw(cls, a: str, b: str, lead: float, axis: Axis = Z, name: str = "") -> "Closure":
        """B advances along ``axis`` of a by ``lead`` metres per turn: 1 row, besides a cylindrical closure."""
        return cls(kind="screw", frames=(a, b), lead=lead, axis=axis, name=name)

    @classmethod
    def ratio(cls, joint: str, other: str, coefficients: Polynomial, setting: str = "", name: str = "") -> "Closure":
        """Speeds of joints keep v_joint = (c_0 + c_1 q_setting + ...) v_other: 1 row."""
        joints = (joint, other, setting) if setting else (joint, other)
        return cls(kind="ratio", joints=joints, coefficients=tuple(coefficients), name=name)

    @classmethod
    def rows(cls, function: Any, joints: str | Sequence[str], size: int = 1, **more: Any) -> "Closure":
        """Rows from a Python function of joint coordinates, see `mbdae.mechanism.closures.user_rows`."""
        from .user_rows import UserRows  # a subclass of Closure
        return UserRows(kind="rows", joints=joints, function=function, size=size, **more)

    @property
    def between(self) -> tuple[str, ...]:
        """Names of the connected frames or joints."""
        return self.frames or self.joints or ()

    @property
    def m(self) -> int:
        """Number of rows."""
        return sum(r.m for r in self.primitives())

    def primitives(self) -> Sequence[FrameRows] | Sequence[JointRow]:
        """Primitive rows that make up this closure."""
        return primitives_of(self)

    @property
    def tangents(self) -> tuple[float, ...]:
        """Angles from ahead to the left along which a rolling body does not slip, in rad."""
        grip = "full" if self.grip is None else self.grip
        return GRIPS[grip] if isinstance(grip, str) else (grip,)

    @property
    def shape(self) -> ConvexBody:
        """Body and surface of a rolling closure."""
        radius = self.radius or 0.0
        tyre = radius if self.axis is None else self.tyre or 0.0
        axle = tuple(unit_axis(self.axis).tolist()) if self.axis else None
        rest = self.semi_axes, self.centre or (0.0, 0.0, 0.0), self.surface or "plane", self.surface_radius or 0.0
        return ConvexBody(axle, radius - tyre, tyre, *rest)

    def agreeing(self) -> tuple[np.ndarray, np.ndarray]:
        """Unit axes of frames a and b that coincide where the closure is satisfied, (3, m) each; m may be 0."""
        if (direction := BETWEEN_FRAMES.get(self.kind, ("", ""))[1]) == "frame":
            return np.eye(3), np.eye(3)
        axis, second = (unit_axis(x)[:, None] for x in (self.axis or Z, self.other_axis))
        return (axis, second) if direction == "axis" else (axis[:, :0], second[:, :0])

    def flipped(self, relative: np.ndarray) -> bool:
        """True where rows vanish because the second frame is flipped; ``relative`` (3, 3) is its rotation.

        Products of perpendicular axes also vanish for a frame rotated by half a turn; for a full frame, also by a third
        of a turn about a space diagonal.
        """
        a, b = self.agreeing()
        return bool((a * (relative @ b)).sum() < (a.shape[1] - 1) / 2)

    @property
    def other_axis(self) -> Axis:
        """Axis in the second frame."""
        return self.second_axis or (X if self.kind == "universal" else self.axis or Z)
