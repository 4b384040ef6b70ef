"""Interface between problems and methods: all that a method may use of a problem.

A problem is an index-2 differential-algebraic equation in Hessenberg form on a manifold,

    y' = f(t, y, z),   0 = g(t, y),   g_y f_z regular,

with y a point (an array of numbers, some of which may be quaternions) and tangent vectors of length ny. A mechanism is
one such problem: y = (q, v, w) with the work w, z = lam (Hairer, Lubich, Roche 1989, eqs. (1.7) to (1.9)).
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from types import ModuleType
from typing import Any, NamedTuple, Protocol

import numpy as np

from .errors import StepError

Array = np.ndarray


@dataclass
class Counts:
    """Work done so far: evaluations of f, mass matrices M and constraint Jacobians G; solved stage systems.

    Further factorizations of any kind, projections of embedded solutions, and of states at the ends of steps.
    """

    f: int = 0
    M: int = 0
    G: int = 0
    solves: int = 0
    factorizations: int = 0
    projections: int = 0
    state_projections: int = 0
    newton: int = 0

    def to_dict(self) -> dict[str, int]:
        """The counts by name."""
        return dict(vars(self))


class State(NamedTuple):
    """State of a one-step method: the point y (n,), and the carry, such as the derivative of an explicit first stage.

    ``compensation`` (ny,) is the rounding error of the increments so far; the next step adds it (compensated summation,
    Hairer, Lubich, Wanner, Geometric Numerical Integration, VIII.5), so that many small steps lose few digits.
    """

    y: Array
    carry: Any = None
    compensation: Array | None = None


class Step(NamedTuple):
    """Result of one step: the new state, the method's z (nz,), error vectors (k, ny), one per embedded formula."""

    state: State
    z: Array
    errors: Array


Solver = Callable[[Array, Array], tuple[Array, Array]]
"""Solves a linear system: right sides (ny,) and (m,) -> unknowns (ny,) and (m,), m the number of unknown z."""


class Linearization(Protocol):
    """Partial derivatives of E x' = E f(t, x, z), 0 = g(t, x) at a point, with a chosen matrix E; arrays only."""

    def weigh(self, e: Array) -> Array:
        """Return E e, (ny,), of e (ny,)."""

    def factorize(self, mu: complex) -> Solver:
        """Return the solver (r, c) -> (dk, dz) of (E - mu (E f)_x) dk - (E f)_z dz = r, mu g_x dk = c."""


class Chart(Protocol):
    """A problem in tangent coordinates x (ny,) at the start of a step, y = y_n (+) x (n,); one chart per step.

    x' is (ny,), z as a stage returns it (m,): the unknowns, one for each row in use.
    """

    def first(self, carry: Any) -> tuple[Array, Array]:
        """Return (x', z) of the explicit first stage, at x = 0."""

    def stage(self, t: float, x: Array, that: float, xhat: Array, factor: float) -> tuple[Array, Array]:
        """Return (x', z) at (t, y_n (+) x), with z such that g(that, y_n (+) (xhat + factor x')) = 0."""

    def point(self, x: Array) -> Array:
        """Return y_n (+) x, (n,)."""

    def all_multipliers(self, z: Array) -> Array:
        """Return z of the last stage, (m,), in full, (nz,)."""

    def project(self, e: Array) -> Array:
        """Project a small tangent vector e (ny,) at the last stage's point onto the tangent of 0 = g along f_z."""

    @property
    def unknowns(self) -> Any:
        """Identifies the unknown z: values (m,) of other steps can be reused while it is unchanged."""

    def start(self) -> tuple[Array, Array]:
        """Return x' (ny,) at x = 0 and the unknown z (m,) from the hidden constraint."""

    def residual(self, t: float, x: Array, dx: Array, z: Array) -> tuple[Array, Array]:
        """Return E (f(t, x, z) - x'), (ny,), and -g(t, x), (m,), at a stage of an implicit method."""

    def linearize(self, x: Array, dx: Array, z: Array) -> Linearization:
        """Return the partial derivatives at (x, x', z)."""

    def end(self, t: float, x: Array, dx: Array, z: Array) -> tuple[Array, Array]:
        """Return y_n (+) x (n,), the end of a step, and all multipliers z there, (nz,), consistent with x'."""


class System(Protocol):
    """A problem bound to a workspace of one solve (not to be shared between threads).

    Methods with a body apply to problems without row selection, jumps and compiled core.

    Attributes:
        ny: length of tangent vectors; a point y has n components, more than ny if it contains quaternions.
        nz: number of constraints.
        counts: the work done so far.
        measured: the components of a tangent vector with error control.
        native: the compiled core, if it computes points and steps.
        accuracy: of the size of y: Newton's iteration in controlled steps of collocation methods; 0: rounding.
    """

    ny: int
    nz: int
    counts: Counts
    measured: slice
    native: ModuleType | None = None
    accuracy: float = 0.0

    def new_workspace(self) -> "System":
        """Return another workspace of the problem, in the same back end, with separate counters."""

    def order_of(self, tableau: Any) -> int:
        """Return the order of y that a method claims on a problem like this."""
        return tableau.order

    def split(self, y: Array) -> tuple[Array, ...]:
        """Return the user's view of a point: y itself, or q and v of a mechanism."""
        return (y,)

    def chart(self, t: float, y: Array) -> Chart:
        """Open a step at (t, y)."""

    def derivative(self, t: float, y: Array, near: Array | None = None) -> tuple[Array, Array]:
        """Return y' (ny,) in the tangent at y (n,), z (nz,) from g_t + g_y f(t, y, z) = 0: the root near a guess."""

    def derivatives(self, t: Array, y: Array, near: Array) -> tuple[Array, Array]:
        """Return y' (n, ny) and z (n, nz) at points (n, ...), see `derivative`; nan where they cannot be computed."""
        F, z = np.full((len(t), self.ny), np.nan), np.full((len(t), self.nz), np.nan)
        for i in range(len(t)):
            with suppress(StepError):
                F[i], z[i] = self.derivative(t[i], y[i], near[i])
        return F, z

    def compiled_step(self, method: Any, t: float, h: float, state: State, controlled: bool = False) -> Step | None:
        """Return a step computed in one call; None if `mbdae.methods` must compute its stages.

        Controlled steps of collocation methods have an error estimate, and fail early; others always have one.
        """
        return None

    def carry(self, F: Array, z: Array) -> Any:
        """Return the carry of a method with an explicit first stage, from a derivative at the new point."""

    def add(self, y: Array, x: Array) -> Array:
        """Return y (+) x, (n,)."""

    def rounding_loss(self, y0: Array, x: Array, y1: Array) -> Array:
        """Return the rounding error of x (ny,) in y1 = y0 (+) x (n,), (ny,); zero where the tangent is curved."""

    def difference(self, y0: Array, y1: Array) -> Array:
        """Return y1 (-) y0 in the tangent at y0, (ny,)."""

    def restore(self, t: float, y: Array, tight: bool = False) -> Array:
        """Return y (n,) projected onto constraints that methods do not enforce, as positions; if tight, to rounding."""
        return y

    @property
    def in_use(self) -> tuple[int, ...]:
        """The constraint rows in use, if some are redundant."""
        return ()

    def use_rows(self, rows: tuple[int, ...], held: bool = True) -> None:
        """Use these rows from now on, until `update_independent_rows` selects others.

        Without ``held`` as many others also replace them where they become ill-conditioned.
        """

    def update_independent_rows(self, t: float, state: State) -> State:
        """Select the rows in use of the next step, and return the state projected onto them."""
        return state

    def breakpoint(self, t: float, sign: float) -> float:
        """Return the next time after t, in the direction of sign, at which f or y may jump; sign * inf if none.

        At exactly that time, f has its value after the jump (for increasing t).
        """
        return sign * np.inf

    def jump(self, t: float, y: Array) -> Array:
        """Return y (n,) just after time t: equal to y except for components that jump there."""
        return y

    def size(self, y: Array) -> Array:
        """Magnitude of each tangent component for relative tolerances, (ny,); 1 for rotations."""

    def magnitude(self, y: Array) -> Array:
        """`size`, and what it is measured by where y is near zero: characteristic lengths and the largest speed."""
        return 1 + self.size(y)

    def noise(self, y: Array, share: float) -> Array:
        """Return the rounding error of an error estimate at y, (ny,): `mbdae.methods.tableau.Tableau.noise` of v."""

    def multiplier_gain(self, t: float, y: Array, z: Array) -> float:
        """Return the norm of (g_y f_z)^-1, the amplification of rounding from g to z."""

    def interpolant(
        self, t: float, h: float, ends: tuple[Array, Array], rates: tuple[Array, Array], order: int
    ) -> Callable[[float], Array]:
        """Return theta -> y (n,) on a step, of the required order, from y (n,) and y' (ny,) at both ends."""
