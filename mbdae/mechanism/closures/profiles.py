"""Plane curves c(s), s in rad or m, for cams and slots, as data of a file.

Contacts with them, x a point and n a direction in their plane:

    nearest point    0 = (x - c).c',   s' = x'.c'/D,   D = c'.c' - (x - c).c''
    support point    0 = c'.n where c.n is largest,   s' = -c'.n'/(c''.n)

Both are computed from a table of samples and Newton's method at each call, and so depend on the position only.

Source: J. Angeles, C. S. Lopez-Cajun, Optimization of Cam Mechanisms (1991), chapter 2.
"""

from functools import cached_property
from typing import Annotated, Any, Literal, NamedTuple, Union

import numpy as np
from pydantic import Field, model_validator

from ...errors import StepError
from ...system import Array
from ...tolerances import BELOW_ROUNDING, RANK
from ..checked_table import Table
from .motion_laws import DEGREE, spline

SAMPLES = 8  # of a polynomial or half a wave of the highest harmonic, and no fewer than:
LEAST = 64
ITERATIONS = 12  # of Newton's method, which doubles the digits of a sample
SHARP = RANK  # of c'.c': below, the nearest point is close to a centre of curvature
Point = tuple[float, float]


class ProfilePoint(NamedTuple):
    """c and its first two derivatives at s, (2,) each."""

    s: Any
    c: Array
    d: Array
    dd: Array


class PlaneCurve:
    """A curve of polynomials between s_0, s_1, ..., or of harmonics c = a_0 + sum_k a_k cos k s + b_k sin k s.

    Args:
        starts: s_0, s_1, ..., s_n; of harmonics 0 and 2 pi.
        numbers: polynomials, (n, degree + 1, 2), highest power first; or a_0, a_1, b_1, a_2, ... of harmonics, (m, 2).
        closed: whether it is closed.
    """

    def __init__(self, starts: Array, numbers: Array, *, closed: bool) -> None:
        self.starts, self.numbers, self.closed = starts, numbers, closed
        self.harmonic = numbers.ndim == 2
        self.orders = np.repeat(np.arange(1, len(numbers) // 2 + 1), 2)  # k of a_k, b_k
        self.signs = np.resize([1.0, -1.0], len(self.orders))
        self.first, self.length = float(starts[0]), float(starts[-1] - starts[0])
        n = max(LEAST, SAMPLES * len(numbers))
        self.samples = self.first + self.length * np.arange(n + (not closed)) / n
        places = [self.at(s) for s in self.samples]
        self.points = np.array([p.c for p in places])
        cross = [p.d[0] * p.dd[1] - p.d[1] * p.dd[0] for p in places]
        ahead = np.roll(self.points, -1, axis=0)
        area = float((self.points[:, 0] * ahead[:, 1] - self.points[:, 1] * ahead[:, 0]).sum())
        self.side = 1.0 if area > 0 or not closed else -1.0  # outward side with respect to the direction of the curve
        self.bends = self.side * np.array(cross) / np.array([(p.d @ p.d) ** 1.5 for p in places])

    def at(self, s: Any) -> ProfilePoint:
        """Evaluate the curve; supports complex steps."""
        if self.closed:
            s = s - self.length * np.floor((np.real(s) - self.first) / self.length)
        if self.harmonic:
            k, sign, a = self.orders, self.signs, self.numbers[1:]
            cos, sin = np.cos(k * s), np.sin(k * s)
            wave, other = np.where(sign > 0, (cos, sin), (sin, cos))
            return ProfilePoint(s, self.numbers[0] + wave.dot(a), (-sign * k * other).dot(a), (-k * k * wave).dot(a))
        i = min(max(int(np.searchsorted(self.starts, np.real(s), "right")) - 1, 0), len(self.numbers) - 1)
        x, c, d, dd = s - self.starts[i], 0.0, 0.0, 0.0
        for row in self.numbers[i]:
            c, d, dd = c * x + row, d * x + c, dd * x + 2 * d
        return ProfilePoint(s, np.asarray(c), np.asarray(d), np.asarray(dd))

    def nearest(self, x: Array) -> ProfilePoint:
        """Return the point nearest to x (2,).

        Raises:
            StepError: if it is not unique, or at an end of an open curve.
        """
        off = self.points - np.real(x)
        s: Any = self.samples[np.einsum("ij,ij->i", off, off).argmin()]
        for _ in range(ITERATIONS):
            _, c, d, dd = self.at(s)
            derivative = d.dot(d) - (x - c).dot(dd)
            step = (x - c).dot(d) / derivative if np.real(derivative) > SHARP * np.real(d.dot(d)) else 0.0
            s = s + step
            if abs(step) <= BELOW_ROUNDING * self.length and not np.iscomplexobj(x):
                break
        found = self.at(s)
        if not np.real(found.d.dot(found.d) - (x - found.c).dot(found.dd)) > SHARP * np.real(found.d.dot(found.d)):
            raise StepError("singular", "the contact is in a centre of curvature of the profile: undercut")
        if not self.closed and not -SHARP <= (np.real(found.s) - self.first) / self.length <= 1 + SHARP:
            raise StepError("singular", "the pin leaves the slot at its end")
        return found

    def support(self, n: Array) -> ProfilePoint:
        """Return the point that is farthest along a direction n (2,).

        Raises:
            StepError: if it is not unique, for a face parallel to the plane of the profile.
        """
        s: Any = self.samples[self.points.dot(np.real(n)).argmax()]
        for _ in range(ITERATIONS):
            _, _, d, dd = self.at(s)
            bend = dd.dot(n)
            step = d.dot(n) / bend if np.real(bend) < 0 else 0.0
            s = s - step
            if abs(step) <= BELOW_ROUNDING * self.length and not np.iscomplexobj(n):
                break
        found = self.at(s)
        if not np.real(found.dd.dot(n)) < 0:
            raise StepError("singular", "the flat face does not touch the profile in a point")
        return found

    def require_regular(self, radius: float | None) -> None:
        """Reject a roller of a radius in m, or a flat face for None, that cannot touch the curve everywhere.

        Raises:
            ValueError: names where the curve is concave.
        """
        worst = int(self.bends.argmin())
        at, bend = tuple(round(float(c), 6) for c in self.points[worst]), float(self.bends[worst])
        if not self.closed:
            raise ValueError("the profile of a cam is closed")
        if radius is None and bend <= 0:
            raise ValueError(f"the profile is not convex at {at}: a flat face does not touch it there")
        if radius is not None and bend * radius <= -1:
            raise ValueError(f"undercut: the profile is hollow at {at} with a radius of {-1 / bend:.3g} m")

    def core_data(self) -> dict[str, Any]:
        """Core data."""
        kind = {"harmonic": self.harmonic, "closed": self.closed, "side": self.side}
        sizes = {"starts": self.starts.tolist(), "coefficients": self.numbers.ravel().tolist()}
        search = {"iterations": ITERATIONS, "rounding": BELOW_ROUNDING, "tolerance": SHARP}
        return {**kind, **sizes, **search, "degree": DEGREE, "samples": self.samples.tolist()}


class PointProfile(Table):
    """A smooth curve through points: a spline of degree 7 over the length of their polygon.

    Attributes:
        points: pairs (x, y) in m; of a closed curve each of them once.
        closed: whether the last point is followed by the first; natural ends when false.
    """

    kind: Literal["points"] = "points"
    points: tuple[Point, ...] = Field(min_length=4)
    closed: bool = True

    @model_validator(mode="after")
    def _apart(self) -> "PointProfile":
        every = np.array([*self.points, self.points[0]] if self.closed else self.points)
        if not (np.linalg.norm(np.diff(every, axis=0), axis=1) > 0).all():
            raise ValueError("neighbours among the points must be apart")
        return self

    @cached_property
    def path(self) -> PlaneCurve:
        """The curve."""
        every = np.array([*self.points, self.points[0]] if self.closed else self.points)
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(every, axis=0), axis=1))])
        return PlaneCurve(s, spline(s, every, periodic=self.closed), closed=self.closed)


class CircleProfile(Table):
    """A circle.

    Attributes:
        radius: in m.
        centre: in m.
    """

    kind: Literal["circle"] = "circle"
    radius: float = Field(gt=0)
    centre: Point = (0.0, 0.0)

    @cached_property
    def path(self) -> PlaneCurve:
        """The curve."""
        numbers = np.array([self.centre, (self.radius, 0.0), (0.0, self.radius)])
        return PlaneCurve(np.array([0.0, 2 * np.pi]), numbers, closed=True)


class FourierProfile(Table):
    """A closed curve x = x_0 + x_1 cos s + x_2 sin s + x_3 cos 2s + x_4 sin 2s + ..., y similarly: ellipses and others.

    Attributes:
        x: coefficients in m, 3, 5, 7, ... of them.
        y: coefficients in m, as many.
    """

    kind: Literal["fourier"] = "fourier"
    x: tuple[float, ...] = Field(min_length=3)
    y: tuple[float, ...] = Field(min_length=3)

    @model_validator(mode="after")
    def _fits(self) -> "FourierProfile":
        if len(self.x) != len(self.y) or len(self.x) % 2 == 0:
            raise ValueError("x and y have equally many coefficients, 3, 5, 7, ...")
        return self

    @cached_property
    def path(self) -> PlaneCurve:
        """The curve."""
        return PlaneCurve(np.array([0.0, 2 * np.pi]), np.array([self.x, self.y]).T, closed=True)


AnyProfile = PointProfile | CircleProfile | FourierProfile
Profile = Annotated[Union[PointProfile, CircleProfile, FourierProfile], Field(discriminator="kind")]  # noqa: UP007
