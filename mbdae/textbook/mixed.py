"""Problems of mixed index 1 and 2, with algebraic variables u of index 1 besides the multipliers.

    y' = f(t, y, z, u),   0 = k(t, y, z, u),   0 = g(t, y),   k_u and g_y (f_z - f_u k_u^-1 k_z) nonsingular

At each stage of a method 0 = k is solved for u. The stages are those for y' = f(t, y, z, u(t, y, z)), 0 = g(t, y), so
that the orders of index 2 hold. Source: Hairer, Lubich, Roche, Lecture Notes in Mathematics 1409 (1989), chapter 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np

from ..callbacks import read_only
from ..errors import StepError
from ..linear_solve import lapack
from ..system import Array
from ..tolerances import BELOW_ROUNDING, ROUNDING, SEARCH_TOLERANCE
from .derivatives import jacobian
from .hessenberg import Function, Hessenberg, HessenbergSystem
from .index_check import require_index_1
from .newton import is_last, largest

ITERATIONS = 30


@dataclass(frozen=True, kw_only=True)
class MixedHessenberg(Hessenberg):
    """The problem y' = f(t, y, z, u), 0 = k(t, y, z, u), 0 = g(t, y).

    The matrices k_u and g_y (f_z - f_u k_u^-1 k_z) are nonsingular.

    Args:
        f, g, y0, z0, g_y, g_t, title, exact, name, duration: see `Hessenberg`.
        k: k(t, y, z, u) -> (nu,).
        u0: approximate initial u, (nu,).
        f_y, f_z, f_u: partial derivatives of f(t, y, z, u); finite differences when left out.
        k_y, k_z, k_u: partial derivatives of k(t, y, z, u).

    Raises:
        InputError: as for `Hessenberg`, and for a singular k_u at the start; the message names the components of u that
            are not determined.
    """

    k: Function
    u0: Sequence[float]
    f_u: Function | None = None
    k_y: Function | None = None
    k_z: Function | None = None
    k_u: Function | None = None

    def bound(self) -> "MixedSystem":
        return MixedSystem(self)

    def local(self, t: Array, y: Array, z: Array) -> Array:
        """Return u (n, nu) at successive points of a solution: t (n,), y (n, ny), z (n, nz).

        Raises:
            StepError: where 0 = k has no solution close to the previous one.
        """
        system = MixedSystem(self)
        return np.array([system.local(*point) for point in zip(np.asarray(t).tolist(), y, z, strict=True)])


class MixedSystem(HessenbergSystem):
    """`mbdae.system.System` of a problem of mixed index, with u(t, y, z) by Newton's method from the last u."""

    problem: MixedHessenberg

    def __init__(self, problem: MixedHessenberg) -> None:
        super().__init__(problem)
        self._u, self._at = np.array(problem.u0, float), (np.nan, b"", b"")

    def require_start(self, t: float, y: Array, z: Array) -> None:
        """Check the shapes of the values of functions, and the indices 1 of u and 2 of z, at the start of a run."""
        at = (t, y, z, self._u)
        self.value("k", self._u.shape, *at)
        require_index_1(self.problem.title, self._partials("k", 3, at))
        super().require_start(t, y, z)

    def _partials(self, function: str, argument: int, at: tuple[float, Array, Array, Array]) -> Array:
        """Return the partial derivatives of f or k with respect to argument 1, 2 or 3: y, z or u."""
        rows, name = self.ny if function == "f" else len(self._u), f"{function}_{'tyzu'[argument]}"
        if getattr(self.problem, name):
            return self.value(name, (rows, len(at[argument])), *at)  # type: ignore[arg-type]

        def function_of_argument(x: Array) -> Array:
            return self.value(function, (rows,), *at[:argument], x, *at[argument + 1 :])

        return jacobian(function_of_argument, at[argument])  # type: ignore[arg-type]

    def local(self, t: float, y: Array, z: Array) -> Array:
        """Return u(t, y, z), (nu,), to rounding.

        Raises:
            StepError: if Newton's method does not converge, or k_u is singular.
        """
        at = t, y.tobytes(), z.tobytes()
        if at == self._at:
            return self._u
        y, z, u, last = read_only(y), read_only(z), self._u, np.inf  # one view for all calls
        for _ in range(ITERATIONS):
            k = self.value("k", u.shape, t, y, z, u)
            *_, du, info = lapack().dgesv(self._partials("k", 3, (t, y, z, u)), k)
            size = largest(du)
            if info or not isfinite(size):
                break
            u = read_only(u - du)
            magnitude = largest(u)
            stalls = last <= 2 * size and size <= SEARCH_TOLERANCE * (1 + magnitude)
            if size <= ROUNDING * magnitude or is_last(size, last, BELOW_ROUNDING * magnitude) or stalls:
                self._u, self._at = u, at
                return u
            last = size
        name = f"0 = k of {self.problem.title!r}"
        raise StepError("newton", f"Newton's method for u does not converge at t = {t:.17g} in {name}")

    def evaluate(self, t: float, y: Array, z: Array) -> Array:
        """Evaluate f(t, y, z, u(t, y, z)), (ny,)."""
        return self.value("f", (self.ny,), t, y, z, self.local(t, y, z))

    def f_y(self, t: float, y: Array, z: Array) -> Array:
        """Evaluate f_y - f_u k_u^-1 k_y, (ny, ny)."""
        return self._total(1, t, y, z)

    def f_z(self, t: float, y: Array, z: Array) -> Array:
        """Evaluate f_z - f_u k_u^-1 k_z, (ny, nz)."""
        return self._total(2, t, y, z)

    def _total(self, argument: int, t: float, y: Array, z: Array) -> Array:
        y, z = read_only(y), read_only(z)
        at = t, y, z, self.local(t, y, z)
        *_, du, info = lapack().dgesv(self._partials("k", 3, at), self._partials("k", argument, at))
        if info:
            raise StepError("singular", f"k_u of {self.problem.title!r} is singular at t = {t:.17g}")
        return self._partials("f", argument, at) - self._partials("f", 3, at).dot(du)
