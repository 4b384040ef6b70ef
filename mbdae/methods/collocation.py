"""One step of a collocation method on an index-2 problem: all stages at once, by a simplified Newton iteration.

In the coordinates x of a step, y = y_n (+) x, with K_i = x'_i at the stages,

    E (K_i - f(t_i, X_i, Z_i)) = 0,   0 = g(t_i, X_i),   X_i = h sum_j a_ij K_j,
    y_1 = y_n (+) h sum_i b_i K_i,   z_1 = R(infinity) z_n + sum_ij b_i omega_ij Z_j,   omega = A^-1;

if b is the last row of A, as in Radau IIA, y_1 = y_n (+) X_s and z_1 = Z_s. Other methods do not satisfy 0 = g(y_1).

E is a matrix chosen by the problem (the mass matrix of a mechanism), so that a residual needs no solve. With the
partial derivatives evaluated at one point for all stages, an iteration reads

    (I (x) E) dK - h (A (x) (E f)_x) dK - (I (x) (E f)_z) dZ = R,    h (A (x) g_x) dK = C,

and A = T diag(mu) T^-1 splits it into real and complex systems, each of the size of one stage.

Sources: Hairer, Lubich, Roche, Lecture Notes in Mathematics 1409 (1989), chapter 7; Hairer, Wanner, Solving
Ordinary Differential Equations II, sections IV.8 and VII.4; Butcher, BIT 16 (1976) for the transformation.
"""

from contextlib import suppress
from math import isfinite, sqrt
from typing import Any, NamedTuple

import numpy as np

from ..errors import StepError
from ..system import Array, Chart, Linearization, Solver, State, Step, System
from ..tolerances import BELOW_ROUNDING, ITERATION_ROUNDING, NEGLIGIBLE
from .stage_arrays import StageArrays, lagrange

MAX_FURTHER_ITERATIONS = 8  # after a change as small as rounding errors
FIRST_ITERATIONS = 3  # the same if the first change is that small, so that the rate is unknown
EXPECTED_RATE = 0.1  # initial estimate of the rate; above REUSE_RATE, so that partials of unknown rate are not reused
REUSE_RATE = 0.03  # convergence rate below which partial derivatives and factors are reused for the same h
ANDERSON_DEPTH = 10  # changes that are combined if the simplified Newton iteration does not converge
TINY = float(np.finfo(float).tiny)  # avoids division by zero
MAX_FIRST_CHANGE = 0.5  # fraction of the size of y and its displacement: for larger changes the guess is useless


class StageMemory(NamedTuple):
    """Data kept for the next step: stages for its initial guess, partial derivatives, and their convergence rate."""

    unknowns: Any
    h: float
    K: Array
    Z: Array
    partials: Linearization
    solvers: list[Solver]
    rate: float
    z: Array | None = None  # at the end of the step, unless it is the last stage


def collocation_step(
    system: System, a: StageArrays, t: float, h: float, state: State, max_iterations: int, estimate: bool
) -> Step:
    """Advance (t, y) to t + h.

    The carry of the state is the `StageMemory` of the previous step; any other value is ignored.

    The equations are solved to rounding, so that no tolerance limits the order of a method or G v = 0; under step-size
    control, to the accuracy required by the run (`mbdae.system.System`). Partial derivatives are evaluated at the
    predicted stage in the middle of the step, which halves the distance to the other stages; they and their factors
    are reused while h is constant and the iteration converges fast. When h changes, new partial derivatives cost less
    than the iterations that they save.

    Args:
        system: the problem.
        a: coefficients.
        t: time.
        h: step size.
        state: y and the carry.
        max_iterations: largest number of iterations.
        estimate: whether to compute an error estimate.

    Raises:
        StepError: if the iteration does not converge, or if the problem raises it.
    """
    chart = system.chart(t, state.y)
    memory = state.carry if isinstance(state.carry, StageMemory) else None
    if memory and (memory.unknowns != chart.unknowns or len(memory.K) != len(a.c)):
        memory = None
    F, K, Z, z_n = _guess(system, chart, a, h, memory)
    accuracy = system.accuracy if estimate else 0.0
    stages = _Stages(system, chart, a, t, h, system.component_magnitudes(state.y), max_iterations, accuracy)
    result = None
    if memory is not None and memory.h == h and memory.rate < REUSE_RATE:
        with suppress(StepError):
            result = stages.solve(K, Z, memory.partials, memory.solvers)
    if result is None:
        # the caller may retry with a shorter step
        result = stages.simplified_newton(K, Z) if estimate else stages.solve_with_fallback(K, Z)
    x = h * (a.b @ result.K) + (0.0 if state.compensation is None else state.compensation)
    if a.ends_at_stage:
        y, multipliers = chart.end(t + h, x, result.K[-1], result.Z[-1])
    else:
        z_1 = a.R_infinity * z_n + a.z_weights @ result.Z
        result = result._replace(z=z_1)
        y, multipliers = chart.end(t + h, x, None, z_1)
    errors = _errors(a, F, result) if estimate else np.empty((0, system.ny))
    return Step(State(y, result, system.rounding_loss(state.y, x, y)), multipliers, errors)


def _guess(
    system: System, chart: Chart, a: StageArrays, h: float, memory: StageMemory | None
) -> tuple[Array, Array, Array, Array]:
    """Return y'_n, the guess of K (s, ny) and Z (s, m), and z_n (m,).

    The stages of the previous step are extrapolated, unless that step ended off the constraint 0 = g, to which stages
    return discontinuously.
    """
    if memory and a.ends_at_stage:
        F = chart.first(system.carry(memory.K[-1], memory.Z[-1]))[0]
        extrapolation = lagrange(a.c, 1 + a.c * h / memory.h)
        return F, extrapolation @ memory.K, extrapolation @ memory.Z, memory.Z[-1]
    F, z = chart.start()
    s, z_n = len(a.c), z if memory is None or memory.z is None else memory.z
    return F, np.tile(F, (s, 1)), np.tile(z, (s, 1)), z_n


def _factorize(partials: Linearization, a: StageArrays, h: float) -> list[Solver]:
    return [partials.factorize(h * mode.value) for mode in a.modes]


def _errors(a: StageArrays, F: Array, stages: StageMemory) -> Array:
    """Return error estimates e, (1 or 2, ny), from F = y'_n and the collocation polynomial u.

        (E - h gamma (E f)_x) e - (E f)_z * = E h gamma (y'_n - u'(t_n)),   g_x e = 0.

    The right-hand side is that of an embedded formula of order s, since u' differs from y'_n by O(h^s) (Hairer, Wanner
    II, section IV.8); the system damps it in stiff directions and projects it onto 0 = g along f_z, so that an error of
    z in y'_n has no effect; the multiplier * is not used. A second estimate, for s >= 3, omits the first stage from u'
    and is one order lower.
    """
    h, zero = stages.h, np.zeros(stages.Z.shape[1])
    solve = stages.partials.factorize(h * a.gamma) if a.real is None else stages.solvers[a.real]
    defects = [h * a.gamma * (F - row @ stages.K) for row in a.start]
    return np.array([solve(stages.partials.apply_E(defect), zero)[0] for defect in defects])


def _remaining_iterations(size: float, rate: float) -> int:
    """Return the number of remaining iterations after a change of this size, to reach the tolerance."""
    if rate * size <= BELOW_ROUNDING:
        return 0
    return (
        MAX_FURTHER_ITERATIONS
        if rate >= 1
        else min(MAX_FURTHER_ITERATIONS, int(np.ceil(np.log(BELOW_ROUNDING / size) / np.log(rate))) - 1)
    )


def _remaining_error(size: float, rate: float) -> float:
    """Return the error that remains after a change of this size: the sum of a geometric series."""
    return rate * size / (1 - rate) if rate < 1 else np.inf


class _Stages:
    """The coupled stage equations of a step."""

    def __init__(
        self,
        system: System,
        chart: Chart,
        a: StageArrays,
        t: float,
        h: float,
        size: Array,
        max_iterations: int,
        accuracy: float = 0.0,
    ) -> None:
        self.chart, self.a, self.t, self.h, self.max_iterations = chart, a, t, h, max_iterations
        self.counts, self.error_components = system.counts, system.error_components
        self.size, self.accuracy = size, accuracy

    def solve(self, K: Array, Z: Array, partials: Linearization, solvers: list[Solver]) -> StageMemory:
        """Iterate from a guess of K (s, ny) and Z (s, m).

        Changes of X decrease by the factor ``rate`` (Hairer, Wanner II, section IV.8), measured over pairs of
        iterations: a correction of X violates G v = 0, which the second iteration corrects. Once a change is small, it
        determines the number of remaining iterations, before rounding dominates the measured rate.

        Raises:
            StepError: if the iteration diverges or is too slow.
        """
        scale, last, rate, remaining = self._scale(K), np.inf, EXPECTED_RATE, 0
        for k in range(self.max_iterations):
            dK, dZ = self._correction(K, Z, solvers)
            if not k:
                scale = np.maximum(scale, self._scale(dK))
            K, Z = K + dK, Z + dZ
            size = self._norm(dK, scale)
            self.counts.newton += 1
            if not isfinite(size):
                break
            if last <= ITERATION_ROUNDING:
                remaining -= 1
            elif not k:
                remaining = FIRST_ITERATIONS
            else:
                rate = size / last if k == 1 else sqrt(rate * size / last)
                remaining = _remaining_iterations(size, rate)
            exact = size <= ITERATION_ROUNDING and (remaining <= 0 or k == self.max_iterations - 1)
            if exact or (_remaining_error(size, rate) if k else size) <= self.accuracy:
                return StageMemory(self.chart.unknowns, self.h, K, Z, partials, solvers, rate)
            if k > 1 and last > ITERATION_ROUNDING and self._is_slow(size, rate, self.max_iterations - 1 - k):
                break
            last = size
        raise self._not_converged()

    def _is_slow(self, size: float, rate: float, remaining: int) -> bool:
        """Return whether the given number of further iterations is insufficient."""
        return rate >= 1 or rate**remaining * size > max(ITERATION_ROUNDING, self.accuracy)

    def simplified_newton(self, K: Array, Z: Array) -> StageMemory:
        """Iterate from a guess with the partial derivatives at its middle stage."""
        i, X = self.a.middle, self.h * (self.a.A @ K)
        partials = self.chart.linearize(X[i], K[i], Z[i])
        return self.solve(K, Z, partials, _factorize(partials, self.a, self.h))

    def solve_with_fallback(self, K: Array, Z: Array) -> StageMemory:
        """Iterate by `simplified_newton`; if that does not converge, by `anderson`."""
        try:
            return self.simplified_newton(K, Z)
        except StepError as failed:
            try:
                return self.anderson(K, Z)
            except StepError:
                raise failed from None

    def anderson(self, K: Array, Z: Array) -> StageMemory:
        """Iterate by Anderson acceleration: for large rotations in a step, where one set of partials is inaccurate.

        Each iterate is the combination of the last iterates with the smallest change, plus this change
        (H. F. Walker, P. Ni, SIAM J. Numer. Anal. 49 (2011) 1715). The next step computes new partials.

        Raises:
            StepError: if this does not converge either.
        """
        i, X, n = self.a.middle, self.h * (self.a.A @ K), K.size
        partials = self.chart.linearize(X[i], K[i], Z[i])
        solvers, scale, last = _factorize(partials, self.a, self.h), self._scale(K), np.inf
        weight = 1 / (1 + np.abs(np.concatenate([K.ravel(), Z.ravel()])))
        points, changes = np.empty((0, len(weight))), np.empty((0, len(weight)))
        for _ in range(self.max_iterations):
            dK, dZ = self._correction(K, Z, solvers)
            has_scale = scale.any()
            if not has_scale:  # at rest without forces the scale of the guess is zero
                scale = self._scale(dK)
            size = self._norm(dK, scale)
            self.counts.newton += 1
            if not size < (MAX_FIRST_CHANGE if has_scale else np.inf):
                break
            if size <= BELOW_ROUNDING or last <= size <= ITERATION_ROUNDING:
                return StageMemory(self.chart.unknowns, self.h, K + dK, Z + dZ, partials, solvers, np.inf)
            change = np.concatenate([dK.ravel(), dZ.ravel()])
            points = np.vstack([points, np.concatenate([K.ravel(), Z.ravel()])])[-ANDERSON_DEPTH - 1 :]
            changes, last = np.vstack([changes, change])[-ANDERSON_DEPTH - 1 :], size
            steps, differences = np.diff(points, axis=0), np.diff(changes, axis=0)
            coefficients = np.linalg.lstsq((differences * weight).T, change * weight)[0]
            point = points[-1] + change - coefficients @ (steps + differences)
            K, Z = point[:n].reshape(K.shape), point[n:].reshape(Z.shape)
        raise self._not_converged()

    def _not_converged(self) -> StepError:
        return StepError(
            "newton",
            f"the iteration of an implicit step at t = {self.t:.17g}, h = {self.h:.3g} does not converge: use shorter "
            "steps, or step-size control (rtol)",
        )

    def _displacements(self, K: Array) -> Array:
        """Return the error components of X = h A K, (s, .)."""
        return self.h * self.a.A.dot(K)[:, self.error_components]

    def _scale(self, K: Array) -> Array:
        """Return the size of y plus its change in the step, plus a thousandth of the largest component.

        The change is that of the initial guess; at rest without forces, where it is zero, that of the first correction.
        """
        scale = self.size[self.error_components] + np.abs(self._displacements(K)).max(axis=0)
        return scale + NEGLIGIBLE * scale.max(initial=0.0)

    def _norm(self, dK: Array, scale: Array) -> float:
        """Return the root mean square of the change of X by dK, (s, ny), relative to the scale."""
        X = (self._displacements(dK) / (scale + TINY)).ravel()
        return sqrt(X.dot(X) / len(X))

    def _correction(self, K: Array, Z: Array, solvers: list[Solver]) -> tuple[Array, Array]:
        a, X, times = self.a, self.h * self.a.A.dot(K), (self.t + self.a.c * self.h).tolist()
        residuals = [self.chart.residual(*point) for point in zip(times, X, K, Z, strict=True)]
        R, C = map(np.array, zip(*residuals, strict=True))
        dK, dZ = np.zeros(K.shape), np.zeros(Z.shape)
        for mode, solver in zip(a.modes, solvers, strict=True):
            dk, dz = solver(mode.row.dot(R), mode.row.dot(C))
            dK += (mode.column[:, None] * dk).real  # numpy.outer is slower on small arrays
            dZ += (mode.column[:, None] * dz).real
        return dK, dZ
