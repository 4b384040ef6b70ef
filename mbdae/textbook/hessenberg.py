"""Textbook problems: index-2 equations in Hessenberg form, defined by two functions."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import isfinite
from typing import Any, ClassVar

import numpy as np

from ..arguments import as_numbers
from ..callbacks import FORCE, read_only, report
from ..errors import InputError, StepError
from ..hermite import powers, refine
from ..linear_solve import lapack
from ..system import Array, Counts, System
from ..tolerances import BELOW_ROUNDING, EVALUATION_ROUNDING, INPUT_DIGITS
from .chart import HessenbergChart
from .derivatives import jacobian, require_derivatives_of_g
from .index_check import require_index_2
from .newton import is_last, largest

Function = Callable[..., Array]
CACHE_SIZE = 8
START_TOLERANCE = INPUT_DIGITS  # fraction of 1 + |y|: largest |g| at the start


@dataclass(frozen=True)
class Hessenberg:
    """The problem y' = f(t, y, z), 0 = g(t, y), with g_y f_z nonsingular.

    Args:
        f: f(t, y, z) -> (ny,).
        g: g(t, y) -> (nz,).
        y0: consistent initial y, (ny,), g(t0, y0) = 0.
        z0: approximate initial z, (nz,), corrected by the hidden constraint g_t + g_y f = 0.
        g_y: g_y(t, y) -> (nz, ny); finite differences when left out.
        f_z: f_z(t, y, z) -> (ny, nz); finite differences when left out.
        g_t: g_t(t, y) -> (nz,); finite differences when left out.
        f_y: f_y(t, y, z) -> (ny, ny), for implicit methods; finite differences when left out.
        title: a name for tables.
        exact: t -> (y, z), the solution if known; order studies compare with it.
        name: name of a problem in `mbdae.textbook.problems`, under which runs are saved.
        duration: default end time of a run in s.

    Raises:
        InputError: at the start of a run, if a function fails or returns a wrong shape, y0 does not satisfy 0 = g, g_y
            or g_t are not derivatives of g, or g_y f_z is singular; the message names the components of z that are not
            determined.
    """

    f: Function
    g: Function
    y0: Sequence[float]
    z0: Sequence[float]
    g_y: Function | None = None
    f_z: Function | None = None
    g_t: Function | None = None
    title: str = "textbook problem"
    exact: Callable[[float], tuple[Array, Array]] | None = None
    f_y: Function | None = None
    name: str = ""
    duration: float = 1.0
    drivers: ClassVar[tuple[()]] = ()

    def system(self, formulation: str = "index2", baumgarte: tuple[float, float] | None = None) -> "HessenbergSystem":
        """Return a new workspace of the problem.

        Raises:
            InputError: for a formulation other than ``"index2"``: other formulations require mechanisms.
        """
        if formulation != "index2" or baumgarte is not None:
            raise InputError(f"a textbook problem has the formulation 'index2' only, got {formulation!r}")
        return self.bound()

    def bound(self) -> "HessenbergSystem":
        """Return a new workspace of the problem."""
        return HessenbergSystem(self)

    def point(
        self, q: Array | None = None, v: Array | None = None, t: float = 0.0, s: Array | None = None,
        tolerance: float = 0.0,
    ) -> Array:
        """Return the start y0 at time t, (ny,); ``tolerance`` applies to closures of mechanisms only.

        Raises:
            InputError: if q, v or s is given, and as `Hessenberg`.
            StepError: if f is not finite, or 0 = k of a `MixedHessenberg` has no solution.
        """
        if not (q is v is s is None):
            raise InputError("a textbook problem starts at y0: q, v and s are arguments for mechanisms")
        for name, value in (("y0", self.y0), ("z0", self.z0)):
            x = as_numbers(value)
            if x.ndim != 1 or not np.isfinite(x).all():
                raise InputError(f"{name} of {self.title!r} is a list of finite numbers, got {value!r:.60}")
        system, y = self.bound(), np.array(self.y0, float)
        try:
            residual = float(np.abs(system.g(t, y)).max(initial=0.0))
            if not residual <= START_TOLERANCE * (1 + np.abs(y).max()):
                raise InputError(f"y0 of {self.title!r} is not consistent: |g| = {residual:.3g} at t = {t:g}")
            system.require_start(t, y, np.array(self.z0, float))
        except StepError as e:
            raise InputError(str(e)) if e.status == "force" else e from e
        return y


class HessenbergSystem(System):
    """`mbdae.system.System` of a textbook problem; stages are solved for z by Newton's method."""

    def __init__(self, problem: Hessenberg) -> None:
        self.problem = problem
        self.ny, self.nz = len(problem.y0), len(problem.z0)
        self.counts = Counts()
        self.error_components = slice(None)
        y, z = np.array(problem.y0, float), np.array(problem.z0, float)
        self._roots: dict[bytes, Array] = {y.tobytes(): z}  # z at the last points, as initial values of Newton's method

    def require_start(self, t: float, y: Array, z: Array) -> None:
        """Check the shapes of the values of functions, the derivatives of g, and the index 2, at the start of a run.

        Raises:
            InputError, StepError: as `Hessenberg.point`.
        """
        title, _ = self.problem.title, self.evaluate(t, y, z)
        if not self.nz:
            raise InputError(f"{title!r} has no z: a problem of index 2 has at least one constraint 0 = g")
        if self.problem.g_y or self.problem.g_t:
            require_derivatives_of_g(self, t, y)
        require_index_2(title, self.g_y(t, y), self.f_z(t, y, z))

    @property
    def features(self) -> dict[str, str]:
        """See `mbdae.system.System`."""
        return {"textbook": f"{self.problem.title!r}"}

    def new_workspace(self) -> "HessenbergSystem":
        """Return another workspace of the problem, with separate counters."""
        return self.problem.bound()

    def chart(self, t: float, y: Array) -> HessenbergChart:
        """Return the chart of a step from (t, y), with the stored z at y."""
        return HessenbergChart(self, t, y, self.initial_z(y))

    def initial_z(self, y: Array) -> Array:
        """Return the stored z at y, else the last stored z: a rejected step must not change the root."""
        return self._roots.get(y.tobytes(), next(reversed(self._roots.values())))

    def store_z(self, y: Array, z: Array) -> None:
        """Store z at y; only the last `CACHE_SIZE` points are stored."""
        self._roots.pop(y.tobytes(), None)
        self._roots[y.tobytes()] = z
        if len(self._roots) > CACHE_SIZE:
            del self._roots[next(iter(self._roots))]

    def derivative(self, t: float, y: Array, guess: Array | None = None) -> tuple[Array, Array]:
        """Return y' = f(t, y, z) and z from g_t + g_y f(t, y, z) = 0, by Newton's method from a guess or the last z."""
        g_y, g_t = self.g_y(t, y), self.g_t(t, y)

        def root(start: Array) -> Array:
            return self.solve(t, y, lambda F: g_t + g_y @ F, lambda F: g_y, 1.0, start)

        z = None
        if guess is not None and np.isfinite(guess).all():
            with suppress(StepError):
                z = root(np.array(guess, float))
        z = root(self.initial_z(y)) if z is None else z
        self.store_z(y, z)
        return self.f(t, y, z), z

    def carry(self, F: Array, z: Array) -> tuple[Array, Array]:
        """Return (y', z), the carry of a method with an explicit first stage."""
        return F, z

    def add(self, y: Array, x: Array) -> Array:
        """Return y + x, (ny,)."""
        return y + x

    def rounding_loss(self, y0: Array, x: Array, y1: Array) -> Array:
        """Return x - (y1 - y0), (ny,)."""
        return x - (y1 - y0)

    def difference(self, y0: Array, y1: Array) -> Array:
        """Return y1 - y0, (ny,)."""
        return y1 - y0

    def use_rows(self, rows: tuple[int, ...], frozen: bool = True) -> None:
        """Do nothing: all constraints are always in use."""

    def component_magnitudes(self, y: Array) -> Array:
        """Return |y|, (ny,)."""
        return np.abs(y)

    def noise(self, y: Array, relative: float) -> Array:
        """Return zeros (ny,): error estimates have no cancellation."""
        return np.zeros(len(y))

    def interpolant(
        self, t: float, h: float, ends: tuple[Array, Array], rates: tuple[Array, Array], order: int
    ) -> Callable[[float], Array]:
        """Return cubic Hermite interpolation, order 3, refined by collocation of y' for higher orders."""

        def rate(theta: float, c: Array) -> Array:
            return h * self.derivative(t + theta * h, powers(theta, len(c) - 1) @ c)[0]

        c = refine([ends, (h * rates[0], h * rates[1])], rate, max(0, order - 3))
        return lambda theta: powers(theta, len(c) - 1) @ c

    def multiplier_gain(self, t: float, y: Array, z: Array) -> float:
        """Return the norm of (g_y f_z)^-1: the change of z per unit residual of g_y y'."""
        return float(np.linalg.norm(np.linalg.inv(self.g_y(t, y) @ self.f_z(t, y, z)), 2))

    def evaluate(self, t: float, y: Array, z: Array) -> Array:
        """Evaluate f, (ny,)."""
        return self.value("f", (self.ny,), t, y, z)

    def value(self, name: str, shape: tuple[int, ...], *at: Any) -> Array:
        """Return the value of a function of the problem, copied: it may return the same array at each call.

        Raises:
            StepError: if it fails, or returns another shape.
        """
        t, *arrays = at
        try:
            out = np.array(getattr(self.problem, name)(t, *map(read_only, arrays)), float)
        except Exception as e:
            report(e, f"{name} of {self.problem.title!r}", f"t = {t:.17g}", FORCE)
        if out.shape != shape:
            shapes = f"the shape {out.shape}, expected {shape}"
            raise StepError("force", f"{name} of {self.problem.title!r} returns {shapes}")
        return out

    def f(self, t: float, y: Array, z: Array) -> Array:
        """Evaluate and count f."""
        self.counts.f += 1
        F = self.evaluate(t, y, z)
        if not isfinite(F.dot(F)) and not np.isfinite(F).all():  # the square, which may overflow, is cheaper
            raise StepError("nonfinite", f"f of {self.problem.title!r} is not finite at t = {t:.17g}")
        return F

    def solve(self, t: float, y: Array, residual: Function, derivative: Function, factor: float, start: Array) -> Array:
        """Solve 0 = residual(f(t, y, z)) for z by Newton's method to rounding, with derivative = d residual/dF."""
        y, z, last = read_only(y), start.copy(), np.inf  # one view for all calls
        for _ in range(30):
            z_view = read_only(z)
            F = self.f(t, y, z_view)
            r, r_F = residual(F), derivative(F)
            self.counts.solves += 1
            self.counts.factorizations += 1
            *_, dz, info = lapack().dgesv(factor * r_F.dot(self.f_z(t, y, z_view)), r)
            if info:
                break
            z = z - dz
            size, rounding = largest(dz), BELOW_ROUNDING * largest(z)
            if size <= 4 * rounding or is_last(size, last, rounding):
                return z
            if size >= 0.5 * last and largest(r) <= EVALUATION_ROUNDING * (1 + np.abs(r_F).max() * largest(y)):
                return z
            last = size
        raise StepError("newton", f"Newton's method for z does not converge at t = {t:.17g} in {self.problem.title!r}")

    def g(self, t: float, y: Array) -> Array:
        """Evaluate g, (nz,)."""
        return self.value("g", (self.nz,), t, y)

    def g_y(self, t: float, y: Array) -> Array:
        """Evaluate and count g_y, (nz, ny)."""
        self.counts.G += 1
        return self.value("g_y", (self.nz, self.ny), t, y) if self.problem.g_y else jacobian(lambda u: self.g(t, u), y)

    def g_t(self, t: float, y: Array) -> Array:
        """Evaluate g_t, (nz,)."""
        if self.problem.g_t:
            return self.value("g_t", (self.nz,), t, y)
        return jacobian(lambda s: self.g(s[0], y), np.array([t]))[:, 0]

    def hidden(self, t: float, y: Array, z: Array) -> Array:
        """Evaluate the residual of the hidden constraint, g_t + g_y f(t, y, z), (nz,)."""
        return self.g_t(t, y) + self.g_y(t, y) @ self.f(t, y, z)

    def f_y(self, t: float, y: Array, z: Array) -> Array:
        """Evaluate f_y, (ny, ny)."""
        if self.problem.f_y:
            return self.value("f_y", (self.ny, self.ny), t, y, z)
        return jacobian(lambda u: self.evaluate(t, u, z), y)

    def f_z(self, t: float, y: Array, z: Array) -> Array:
        """Evaluate f_z, (ny, nz)."""
        if self.problem.f_z:
            return self.value("f_z", (self.ny, self.nz), t, y, z)
        return jacobian(lambda u: self.evaluate(t, y, u), z)
