"""Plane curves c(s), s in rad or m, for cams and slots, as data in files.

Contacts with them, x a point and n a direction in their plane:

    nearest point    0 = (x - c).c',   s' = x'.c'/D,   D = c'.c' - (x - c).c''
    support point    0 = c'.n where c.n is largest,   s' = -c'.n'/(c''.n)

Both are computed from a table of samples and Newton's method at each call, and so depend on the position only.

Source: J. Angeles, C. S. Lopez-Cajun, Optimization of Cam Mechanisms (1991), chapter 2.
"""

from functools import cached_property
from typing import Annotated, Literal, NamedTuple, Union

import numpy as np
from pydantic import Field, model_validator

from ...data_types import CoreData
from ...errors import StepError
from ...system import Array
from ...tolerances import BELOW_ROUNDING, RANK
from ..checked_table import Table
from ..key_units import Unit
from ..tagged_union import TaggedByKind
from .motion_laws import DEGREE, spline

SAMPLES = 8  # per polynomial, or per half period of the highest harmonic
MIN_SAMPLES = 64
ITERATIONS = 12  # iterations of Newton's method, each of which doubles the number of correct digits
CENTRE_TOLERANCE = RANK  # fraction of c'.c': below, the point is close to the centre of curvature
Point = tuple[float, float]


class ProfilePoint(NamedTuple):
    """c and its first two derivatives at s, (2,) each."""

    s: complex
    c: Array
    d: Array
    dd: Array


class PlaneCurve:
    """Curve that consists of polynomials between s_0, s_1, ..., or of harmonics, a_0 + sum_k a_k cos k s + b_k sin k s.

    Args:
        starts: s_0, s_1, ..., s_n; 0 and 2 pi for harmonics.
        coefficients: polynomials (n, degree + 1, 2), highest power first; or harmonics a_0, a_1, b_1, a_2, ...,
            (m, 2).
        closed: whether the curve is closed.
    """

    def __init__(self, starts: Array, coefficients: Array, *, closed: bool) -> None:
        self.starts, self.coefficients, self.closed = starts, coefficients, closed
        self.harmonic = coefficients.ndim == 2
        if self.harmonic:
            k, (a, b) = np.arange(1, len(coefficients) // 2 + 1)[:, None], (coefficients[1::2], coefficients[2::2])
            rates = np.hstack([a, k * b, -k * k * a]), np.hstack([b, -k * a, -k * k * b])
            self.orders, self.amplitudes = k[:, 0], np.vstack(rates)  # orders; and amplitudes of c - a_0, c' and c''
        self.first, self.length = float(starts[0]), float(starts[-1] - starts[0])
        n = max(MIN_SAMPLES, SAMPLES * len(coefficients))
        self.samples = self.first + self.length * np.arange(n + (not closed)) / n
        sampled = [self.at(s) for s in self.samples]
        self.points = np.array([p.c for p in sampled])
        cross_products = [p.d[0] * p.dd[1] - p.d[1] * p.dd[0] for p in sampled]
        following = np.roll(self.points, -1, axis=0)
        area = float((self.points[:, 0] * following[:, 1] - self.points[:, 1] * following[:, 0]).sum())
        self.side = 1.0 if area > 0 or not closed else -1.0  # outward side with respect to the direction of the curve
        self.curvatures = self.side * np.array(cross_products) / np.array([(p.d @ p.d) ** 1.5 for p in sampled])

    def at(self, s: complex) -> ProfilePoint:
        """Return the point of the curve at s; supports complex steps."""
        if self.closed:
            s = s - self.length * np.floor((np.real(s) - self.first) / self.length)
        if self.harmonic:
            angles = self.orders * s
            x = np.concatenate([np.cos(angles), np.sin(angles)]).dot(self.amplitudes)
            return ProfilePoint(s, self.coefficients[0] + x[:2], x[2:4], x[4:])
        i = min(max(int(np.searchsorted(self.starts, np.real(s), "right")) - 1, 0), len(self.coefficients) - 1)
        x, c, d, dd = s - self.starts[i], 0.0, 0.0, 0.0
        for row in self.coefficients[i]:
            c, d, dd = c * x + row, d * x + c, dd * x + 2 * d
        return ProfilePoint(s, np.asarray(c), np.asarray(d), np.asarray(dd))

    def nearest(self, x: Array) -> ProfilePoint:
        """Return the point nearest to x (2,).

        Raises:
            StepError: if it is not unique, or at an end of an open curve.
        """
        offsets = self.points - np.real(x)
        s: complex = self.samples[np.einsum("ij,ij->i", offsets, offsets).argmin()]
        for _ in range(ITERATIONS):
            _, c, d, dd = self.at(s)
            derivative = d.dot(d) - (x - c).dot(dd)
            regular = np.real(derivative) > CENTRE_TOLERANCE * np.real(d.dot(d))
            step = (x - c).dot(d) / derivative if regular else 0.0
            s = s + step
            if abs(step) <= BELOW_ROUNDING * self.length and not np.iscomplexobj(x):
                break
        out, tol = self.at(s), CENTRE_TOLERANCE
        if not np.real(out.d.dot(out.d) - (x - out.c).dot(out.dd)) > tol * np.real(out.d.dot(out.d)):
            raise StepError("singular", "the contact is at a centre of curvature of the profile: undercut")
        if not self.closed and not -tol <= (np.real(out.s) - self.first) / self.length <= 1 + tol:
            raise StepError("singular", "the pin leaves the slot at its end")
        return out

    def support(self, n: Array) -> ProfilePoint:
        """Return the point that is farthest along a direction n (2,).

        Raises:
            StepError: if it is not unique, for a face parallel to the plane of the profile.
        """
        s: complex = self.samples[self.points.dot(np.real(n)).argmax()]
        for _ in range(ITERATIONS):
            _, _, d, dd = self.at(s)
            second = dd.dot(n)
            step = d.dot(n) / second if np.real(second) < 0 else 0.0
            s = s - step
            if abs(step) <= BELOW_ROUNDING * self.length and not np.iscomplexobj(n):
                break
        out = self.at(s)
        if not np.real(out.dd.dot(n)) < 0:
            raise StepError("singular", "the flat face does not touch the profile at a single point")
        return out

    def require_regular(self, radius: float | None) -> None:
        """Reject a roller of a radius in m, or a flat face for None, that cannot touch the curve everywhere.

        Raises:
            ValueError: for an open curve; otherwise names the point where the curve is concave.
        """
        worst = int(self.curvatures.argmin())
        at, curvature = tuple(round(float(c), 6) for c in self.points[worst]), float(self.curvatures[worst])
        if not self.closed:
            raise ValueError("the profile of a cam is closed")
        if radius is None and curvature <= 0:
            raise ValueError(f"the profile is not convex at {at}: a flat face does not touch it there")
        if radius is not None and curvature * radius <= -1:
            raise ValueError(f"undercut: the profile is concave at {at} with a radius of {-1 / curvature:.3g} m")

    def core_data(self) -> CoreData:
        """Return the core data."""
        kind = {"harmonic": self.harmonic, "closed": self.closed, "side": self.side}
        sizes = {"starts": self.starts.tolist(), "coefficients": self.coefficients.ravel().tolist()}
        search = {"iterations": ITERATIONS, "rounding": BELOW_ROUNDING, "tolerance": CENTRE_TOLERANCE}
        return {**kind, **sizes, **search, "degree": DEGREE, "samples": self.samples.tolist()}


class PointProfile(Table):
    """A smooth curve through points: a spline of degree 7 in the arclength of their polygon.

    Attributes:
        points: pairs (x, y) in m; a closed curve does not repeat its first point.
        closed: whether the curve returns from the last point to the first; if false, it has natural ends.
    """

    kind: Literal["points"] = "points"
    points: Annotated[tuple[Point, ...], Unit("m")] = Field(min_length=4)
    closed: bool = True

    @model_validator(mode="after")
    def _require_distinct_points(self) -> "PointProfile":
        if not (np.linalg.norm(np.diff(self._polygon, axis=0), axis=1) > 0).all():
            raise ValueError("consecutive points must be different")
        return self

    @property
    def _polygon(self) -> Array:
        return np.array([*self.points, self.points[0]] if self.closed else self.points)

    @cached_property
    def path(self) -> PlaneCurve:
        """The curve."""
        vertices = self._polygon
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(vertices, axis=0), axis=1))])
        return PlaneCurve(s, spline(s, vertices, periodic=self.closed), closed=self.closed)


class CircleProfile(Table):
    """A circle.

    Attributes:
        radius: radius in m.
        centre: centre in m.
    """

    kind: Literal["circle"] = "circle"
    radius: Annotated[float, Unit("m")] = Field(gt=0)
    centre: Annotated[Point, Unit("m")] = (0.0, 0.0)

    @cached_property
    def path(self) -> PlaneCurve:
        """The curve."""
        coefficients = np.array([self.centre, (self.radius, 0.0), (0.0, self.radius)])
        return PlaneCurve(np.array([0.0, 2 * np.pi]), coefficients, closed=True)


class FourierProfile(Table):
    """A closed curve x = x_0 + x_1 cos s + x_2 sin s + x_3 cos 2s + x_4 sin 2s + ..., y similarly (an ellipse, ...).

    Attributes:
        x: 3, 5, 7, ... coefficients in m.
        y: the same number of coefficients in m.
    """

    kind: Literal["fourier"] = "fourier"
    x: Annotated[tuple[float, ...], Unit("m")] = Field(min_length=3)
    y: Annotated[tuple[float, ...], Unit("m")] = Field(min_length=3)

    @model_validator(mode="after")
    def _check_lengths(self) -> "FourierProfile":
        if len(self.x) != len(self.y) or len(self.x) % 2 == 0:
            raise ValueError("x and y must have the same number of coefficients, 3, 5, 7, ...")
        return self

    @cached_property
    def path(self) -> PlaneCurve:
        """The curve."""
        return PlaneCurve(np.array([0.0, 2 * np.pi]), np.array([self.x, self.y]).T, closed=True)


AnyProfile = PointProfile | CircleProfile | FourierProfile
Profile = Annotated[Union[PointProfile, CircleProfile, FourierProfile], TaggedByKind()]  # noqa: UP007
