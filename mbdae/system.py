"""Interface between problems and methods: all that a method may access of a problem.

A problem is an index-2 differential-algebraic equation in Hessenberg form on a manifold,

    y' = f(t, y, z),   0 = g(t, y),   g_y f_z nonsingular,

with y a point (an array of numbers, some of which may be quaternions) and tangent vectors of length ny. A mechanism is
one: y = (q, v, s, w), s the states of forces, w the work, z = lam (Hairer, Lubich, Roche 1989, eqs. (1.7) to (1.9)).
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from types import ModuleType
from typing import Any, NamedTuple, Protocol

import numpy as np

from .errors import InputError, StepError

Array = np.ndarray


@dataclass
class Counts:
    """Counters of the work done so far.

    They count evaluations of f, of the mass matrix M and of the constraint Jacobian G; solved stage systems; all
    factorizations; projections of embedded solutions, and of states at the ends of steps; Newton iterations.
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
        """Return the counts by name."""
        return dict(vars(self))

    def add(self, *counts: int) -> None:
        """Add counts, in the order of the fields."""
        sums = {name: x + n for (name, x), n in zip(vars(self).items(), counts, strict=True)}
        vars(self).update(sums)


class State(NamedTuple):
    """State of a one-step method: the point y (n,), and the carry, such as the derivative of an explicit first stage.

    ``compensation`` (ny,) is the accumulated rounding error of the increments, which the next step adds (compensated
    summation, Hairer, Lubich, Wanner, Geometric Numerical Integration, VIII.5): many small steps lose few digits.
    """

    y: Array
    carry: Any = None
    compensation: Array | None = None


class Step(NamedTuple):
    """Result of one step: the new state, the z of the method (nz,), error vectors (k, ny), one per embedded formula."""

    state: State
    z: Array
    errors: Array


Solver = Callable[[Array, Array], tuple[Array, Array]]
"""Solves a linear system: right-hand sides (ny,) and (m,) -> unknowns (ny,) and (m,), m the number of unknown z."""


class Linearization(Protocol):
    """Partial derivatives of E x' = E f(t, x, z), 0 = g(t, x) at a point, with a matrix E of the problem."""

    def apply_E(self, e: Array) -> Array:
        """Return E e, (ny,), of e (ny,)."""

    def factorize(self, mu: complex) -> Solver:
        """Return the solver (r, c) -> (dk, dz) of (E - mu (E f)_x) dk - (E f)_z dz = r, mu g_x dk = c."""

    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """Return E (ny, ny), (E f)_x (ny, ny), (E f)_z (ny, m) and g_x (m, ny)."""


class Chart(Protocol):
    """A problem in tangent coordinates x (ny,) at the start of a step, y = y_n (+) x (n,); one chart per step.

    x' is (ny,); the z of a stage is (m,), one unknown for each row in use.
    """

    def first(self, carry: Any) -> tuple[Array, Array]:
        """Return (x', z) of the explicit first stage, at x = 0."""

    def stage(self, t: float, x: Array, t_hat: float, xhat: Array, factor: float) -> tuple[Array, Array]:
        """Return (x', z) at (t, y_n (+) x), with z such that g(t_hat, y_n (+) (xhat + factor x')) = 0."""

    def point(self, x: Array) -> Array:
        """Return y_n (+) x, (n,)."""

    def all_multipliers(self, z: Array) -> Array:
        """Return all multipliers (nz,) for the unknowns z (m,) of the last stage."""

    def project(self, e: Array) -> Array:
        """Project a small tangent vector e (ny,) at the last stage's point onto the tangent of 0 = g along f_z."""

    @property
    def unknowns(self) -> Any:
        """Identifier of the unknowns z: values (m,) of another step can be reused if their identifiers are equal."""

    def start(self) -> tuple[Array, Array]:
        """Return x' (ny,) at x = 0 and the unknowns z (m,) from the hidden constraint."""

    def residual(self, t: float, x: Array, dx: Array, z: Array) -> tuple[Array, Array]:
        """Return E (f(t, x, z) - x'), (ny,), and -g(t, x), (m,), at a stage of an implicit method."""

    def linearize(self, x: Array, dx: Array, z: Array) -> Linearization:
        """Return the partial derivatives at (x, x', z)."""

    def end(self, t: float, x: Array, dx: Array | None, z: Array) -> tuple[Array, Array]:
        """Return y_n (+) x (n,), the end of a step, and all multipliers z there, (nz,).

        If the step ends at a stage, both are consistent with its x'; else dx is None, and x and z are not corrected.
        """


class VariationalStep(Protocol):
    """A step of a variational integrator, of size h from t, with unknowns x (nv,), q_1 = q_0 (+) x, and lam (m,)."""

    t: float
    h: float

    def first_guess(self) -> tuple[Array, Array]:
        """Return the initial x and multipliers of Newton's method."""

    def correction(self, x: Array, lam: Array) -> tuple[Array, Array]:
        """Return the Newton corrections of x and of the multipliers."""

    def measure(self, dx: Array, x: Array) -> tuple[float, float]:
        """Return the largest components of dx and of q_0, both relative to the largest component of x."""

    def end(self, x: Array, lam: Array) -> tuple[Array, Array]:
        """Return the displacement of y, (ny,), and the multipliers at the end of the step, (nz,)."""


class System(Protocol):
    """A problem bound to a workspace of one run (not to be shared between threads).

    The default implementations are those of a problem without row selection, jumps and compiled core.

    Attributes:
        ny: length of tangent vectors; a point y has n components, more than ny if it contains quaternions.
        nz: number of constraints.
        counts: the work done so far.
        error_components: the components of a tangent vector that enter error norms.
        native: the compiled core, if it computes points and steps.
        accuracy: tolerance of Newton's iteration, relative to the size of y, in controlled steps of collocation
            methods; 0 iterates to rounding.
    """

    ny: int
    nz: int
    counts: Counts
    error_components: slice
    native: ModuleType | None = None
    accuracy: float = 0.0

    def new_workspace(self) -> "System":
        """Return another workspace of the problem, with the same back end and separate counters."""

    def order_of(self, tableau: Any) -> int:
        """Return the order of y that a method claims for this kind of problem."""
        return tableau.order

    def split(self, y: Array) -> tuple[Array, ...]:
        """Return the parts of a point that users see: y itself, or q and v of a mechanism."""
        return (y,)

    def chart(self, t: float, y: Array) -> Chart:
        """Return the chart of a step from (t, y)."""

    @property
    def features(self) -> dict[str, str]:
        """Features that some methods exclude (``excludes``), by kind, with the names of the elements that have them."""
        return {}

    def variational_step(self, t: float, h: float, y: Array) -> VariationalStep:
        """Return a step of a variational integrator from (t, y); the problem has no `features` that it excludes."""
        raise InputError("this problem has features that variational integrators exclude")

    def newmark_step(self, t: float, h: float, y: Array, stabilized: bool) -> Any:
        """Return a step of a Newmark-type method from (t, y); the mechanism has no `features` that it excludes."""
        raise InputError("this problem has no second-order form")

    def derivative(self, t: float, y: Array, guess: Array | None = None) -> tuple[Array, Array]:
        """Return y' (ny,) and z (nz,) from g_t + g_y f(t, y, z) = 0; of several z, the one closest to the guess."""

    def derivatives(self, t: Array, y: Array, guess: Array) -> tuple[Array, Array]:
        """Return y' (n, ny) and z (n, nz) at points (n, ...), see `derivative`; NaN where they cannot be computed."""
        F, z = np.full((len(t), self.ny), np.nan), np.full((len(t), self.nz), np.nan)
        for i in range(len(t)):
            with suppress(StepError):
                F[i], z[i] = self.derivative(t[i], y[i], guess[i])
        return F, z

    def compiled_step(self, method: Any, t: float, h: float, state: State, controlled: bool = False) -> Step | None:
        """Return a step of the compiled core; None if `mbdae.methods` must compute the stages.

        With step-size control, collocation methods estimate the error, and fail early if the iteration converges
        slowly; other methods estimate the error in any case.
        """
        return None

    def carry(self, F: Array, z: Array) -> Any:
        """Return the carry of a method with an explicit first stage, from a derivative at the new point."""

    def add(self, y: Array, x: Array) -> Array:
        """Return y (+) x, (n,)."""

    def rounding_loss(self, y0: Array, x: Array, y1: Array) -> Array:
        """Return the rounding error of y1 = y0 (+) x in the tangent, (ny,); zero for rotations."""

    def difference(self, y0: Array, y1: Array) -> Array:
        """Return y1 (-) y0 in the tangent at y0, (ny,)."""

    def project_state(self, t: float, y: Array, tight: bool = False) -> Array:
        """Return y (n,) projected onto constraints that methods do not enforce (positions); to rounding, if tight."""
        return y

    def start(self, t: float, y: Array, project: bool) -> tuple[Array, Array, Array]:
        """Select the rows in use at the start of a run, on the constraints close to y; return y, y' and z there.

        Args:
            t: time.
            y: the point; it may violate the constraints by the accuracy of its numbers.
            project: whether y is projected onto the constraints.
        """
        with suppress(StepError):
            projected = self.project_state(t, y)
            self.update_independent_rows(t, State(projected))
            self.counts.state_projections = 0  # only those of steps are counted
            y = projected if project else y
        return (y := self.update_independent_rows(t, State(y)).y), *self.derivative(t, y)

    def first_step(self, t: float, y: Array, F: Array, **given: Any) -> float | None:
        """Return a first step size in s from the compiled core; None where Python estimates it."""
        return None

    @property
    def in_use(self) -> tuple[int, ...]:
        """The constraint rows in use, if some are redundant."""
        return ()

    def use_rows(self, rows: tuple[int, ...], frozen: bool = True) -> None:
        """Use these rows until `update_independent_rows` selects others.

        Args:
            rows: indices of the rows.
            frozen: whether they are kept even if they become ill-conditioned; otherwise better rows replace them.
        """

    def update_independent_rows(self, t: float, state: State) -> State:
        """Select the rows in use for the next step, and return the state projected onto them."""
        return state

    def breakpoint(self, t: float, sign: float) -> float:
        """Return the next time after t, in the direction of sign, at which f or y may jump, or sign * inf.

        Exactly at that time, f has its value after the jump (for increasing t).
        """
        return sign * np.inf

    def jump(self, t: float, y: Array, late: float = np.inf) -> Array:
        """Return y (n,) after the jumps at time t, or up to ``late`` roundings before t."""
        return y

    def component_magnitudes(self, y: Array) -> Array:
        """Return |y| by tangent components, (ny,), for relative tolerances; 1 for rotations."""

    def characteristic_magnitudes(self, y: Array) -> Array:
        """Return `component_magnitudes` plus characteristic lengths and the largest speed, (ny,)."""
        return 1 + self.component_magnitudes(y)

    def noise(self, y: Array, relative: float) -> Array:
        """Return the rounding error of an error estimate at y, (ny,).

        Args:
            y: the point, (n,).
            relative: rounding error relative to |v|, `mbdae.methods.tableau.Tableau.noise`.
        """

    def multiplier_gain(self, t: float, y: Array, z: Array) -> float:
        """Return the norm of (g_y f_z)^-1, the amplification of rounding from g to z."""

    def interpolant(
        self, t: float, h: float, ends: tuple[Array, Array], rates: tuple[Array, Array], order: int
    ) -> Callable[[float], Array]:
        """Return theta -> y (n,) on a step, of the required order, from y (n,) and y' (ny,) at both ends."""
