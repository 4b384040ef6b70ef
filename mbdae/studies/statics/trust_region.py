"""Search for an equilibrium by a trust region in free motions, without a potential.

y = (H + sigma Z^T Z)^-1 rho with the least sigma >= 0 for which the matrix is positive definite and |Z y| stays within
the radius; a step is taken when the trapezoidal work (f + f_new) . x / 2, x = q_new (-) q, exceeds a tenth of the work
predicted by the partials. That serves controllers, constant torques and follower forces as well as springs.
Source: Conn, Gould, Toint, Trust-Region Methods (2000), chapter 7, for the step.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ... import tolerances as tol
from ...errors import StepError
from ...mechanism.equilibrium.spectrum import CERTAIN, curvature, scale_of, spectrum
from ...mechanism.tree.joints import translation_components
from ...system import Array

if TYPE_CHECKING:
    from ...mechanism.equilibrium.equilibrium_equations import ForceBalance, Statics

START, MAX_RADIUS, MIN_RADIUS = 0.3, 1.5, tol.SOLUTION_ROUNDING  # trust radius in rad, or in units of translations
TRANSLATION_UNIT = 5.0  # unit of translations in characteristic lengths: forces are more nonlinear in rotations
ACCEPTED, GOOD = 0.1, 0.7  # fractions of the predicted work above which a step is accepted, and the radius grows
NEAR_BALANCE = tol.INTERPOLATION  # fraction of the terms of forces: residual from which Newton's method converges
NEWTON_STEP = tol.THREE_DIGITS  # largest length of Newton's step at an equilibrium
FLAT = tol.RANK  # smallest sigma without stiffness, relative to the force over the radius
SYMMETRIC = tol.SAME_STATE  # largest asymmetry of H for forces with a potential, over its terms
RELAXATIONS, SHORT = 3, 0.5  # number of steps that relax stiff springs, and their largest length relative to the step
HALVED = 0.5  # largest ratio of |rho| after and before a Newton step near equilibrium
HALVINGS, REDUCTION = 4, 0.9  # number of lengths of a step to an equilibrium of any kind; largest ratio of |rho|
MAX_ITERATIONS = 100


@dataclass
class TrustRegion:
    """A search from one configuration.

    Attributes:
        statics: equations of equilibrium.
        best: the best point so far.
        radius: trust radius.
        iterations: number of trial steps.
    """

    statics: "Statics"
    best: "ForceBalance"
    radius: float = START
    iterations: int = 0

    @property
    def residual(self) -> float:
        """Largest rho relative to its terms, and to its change over 1 rad or characteristic length."""
        return self.statics.residual(self.best)

    def length(self, balance: "ForceBalance", y: Array) -> float:
        """Return the length of a motion y, in rad or units of translations."""
        return float(np.abs(balance.free.Z @ y / self.units).max(initial=0.0))

    @cached_property
    def units(self) -> Array:
        """Units of the lengths of motions, (nv,): 1 rad, and `TRANSLATION_UNIT` characteristic lengths."""
        return self.statics.sizes.l * np.where(translation_components(self.statics.mech.model), TRANSLATION_UNIT, 1.0)

    def run(self, find: str) -> bool:
        """Iterate until forces balance, in a minimum unless ``find`` is any; return whether they balance."""
        self.best = self.statics.point(self.statics.project(self.best.q, self.best.s), self.best.s)
        while self.iterations < MAX_ITERATIONS and self.radius > MIN_RADIUS:
            if self.residual <= NEAR_BALANCE:
                self.polish()
            if self.is_balanced():
                direction = self.divergent_direction()
                if find == "any" or direction is None or not self.leave_saddle(direction):
                    return True
            elif not (self.newton() if find == "any" else self.descend()):
                break
        self.polish()
        return self.residual <= tol.HALF_DIGITS

    def is_balanced(self) -> bool:
        """Return whether forces balance to rounding, or nearly so and Newton's step is short."""
        residual = self.residual
        is_near = residual <= tol.ITERATION_ROUNDING and self.length(self.best, newton_step(self.best)) <= NEWTON_STEP
        return is_near or residual <= CERTAIN * tol.EPS

    def divergent_direction(self) -> Array | None:
        """Return the direction y (k,) of the largest aperiodic divergence; None if there is none."""
        H, noise = self.best.H, self.best.noise
        if symmetric(H, noise):
            found = curvature(H, noise)
            return found.vectors[:, 0] if found.negative else None
        roots = spectrum(-H, noise)  # complex pairs flutter, which is accepted
        growth = np.where(roots.growing & (roots.values.imag == 0), roots.values.real, 0.0)
        return roots.vectors[:, growth.argmax()].real if growth.any() else None

    def polish(self) -> None:
        """Take Newton steps as long as they are short and halve rho."""
        while self.iterations < MAX_ITERATIONS and self.residual > tol.BELOW_ROUNDING:
            y = newton_step(self.best)
            trial = self.displace(y) if 0 < self.length(self.best, y) < START else None
            if trial is None or not np.linalg.norm(trial.rho) < HALVED * np.linalg.norm(self.best.rho):
                return
            self.best = trial

    def descend(self) -> bool:
        """Take one descent step; return False if none is found."""
        rho, H = self.best.rho, self.best.H
        while self.radius > MIN_RADIUS and self.iterations < MAX_ITERATIONS:
            y = step(self.best.free.Z / self.units[:, None], H, self.best.noise, rho, self.radius)
            trial = self.relax(self.displace(y), self.length(self.best, y))
            predicted = float(rho @ y - y @ H @ y / 2)
            done = self.work(trial) if trial else -np.inf
            if trial and done > ACCEPTED * predicted:
                if done > GOOD * predicted:
                    self.radius = min(MAX_RADIUS, 2 * self.radius)
                self.best = trial
                return True
            self.radius = min(self.radius, self.length(self.best, y)) / 3
        return False

    def relax(self, trial: "ForceBalance | None", length: float) -> "ForceBalance | None":
        """Relax stiff springs, which a step of this length along a curved manifold has stretched, by Newton steps."""
        for _ in range(RELAXATIONS):
            if trial is None or np.linalg.norm(trial.rho) <= np.linalg.norm(self.best.rho):
                break
            found = curvature(trial.H, trial.noise)
            d = np.divide(found.vectors.T @ trial.rho, found.values, out=np.zeros(len(trial.H)), where=found.signs > 0)
            sizes = np.abs(trial.free.Z @ found.vectors / self.units[:, None]).max(0)
            d[sizes * np.abs(d) > SHORT * length] = 0.0
            nearer = self.at(trial, found.vectors @ d)
            if nearer is None or not np.linalg.norm(nearer.rho) < np.linalg.norm(trial.rho):
                break
            trial = nearer
        return trial

    def newton(self) -> bool:
        """Take one step that reduces rho, to an equilibrium of any kind; else a descent step."""
        rho, y = self.best.rho, newton_step(self.best)
        y *= min(1.0, MAX_RADIUS / max(tol.TINY, self.length(self.best, y)))
        for _ in range(HALVINGS):
            trial = self.displace(y)
            if trial and np.linalg.norm(trial.rho) < REDUCTION * np.linalg.norm(rho):
                self.best = trial
                return True
            y /= 2
        return self.descend()

    def leave_saddle(self, direction: Array) -> bool:
        """Leave a saddle or a maximum, to the side where forces do positive work."""
        length = self.length(self.best, direction)
        radius = max(self.radius, START)
        while radius > MIN_RADIUS:
            for sign in (1.0, -1.0):
                trial = self.displace(sign * radius / length * direction)
                if trial and self.work(trial) > 0:
                    self.best, self.radius = trial, radius
                    return True
            radius /= 3
        return False

    def work(self, trial: "ForceBalance") -> float:
        """Return the trapezoidal work of the forces to another point, in J."""
        x = self.statics.system.manifold.difference(self.best.q, trial.q)
        return float((self.best.f + trial.f) @ x / 2)

    def displace(self, y: Array) -> "ForceBalance | None":
        """Return the balance at q (+) Z y with closed loops; None if they cannot be closed. Count an iteration."""
        self.iterations += 1
        return self.at(self.best, y)

    def at(self, balance: "ForceBalance", y: Array) -> "ForceBalance | None":
        """Return the balance at a displacement y from any point; None if loops cannot be closed."""
        try:
            q = self.statics.system.manifold.integrate(balance.q, balance.free.Z @ y)
            return self.statics.point(self.statics.project(q, balance.s), balance.s)
        except StepError:
            return None


def newton_step(balance: "ForceBalance") -> Array:
    """Return the step y (k,) with H y = rho, of minimum norm along directions of unknown stiffness."""
    d = scale_of(balance.noise)
    return np.linalg.lstsq(balance.H / np.outer(d, d), balance.rho / d, rcond=CERTAIN * tol.EPS)[0] / d


def symmetric(X: Array, e: Array) -> bool:
    """Return whether X (k, k) with errors e (k, k) is symmetric up to the accuracy of partials."""
    return bool((np.abs(X - X.T) <= SYMMETRIC / tol.EPS * (e + e.T) / 2).all())


def symmetric_part(H: Array) -> tuple[Array, Array]:
    """Return eigenvalues in ascending order (k,) and eigenvectors (k, k) of the symmetric part."""
    return np.linalg.eigh((H + H.T) / 2) if len(H) else (np.empty(0), H)


def step(Z: Array, H: Array, noise: Array, rho: Array, radius: float) -> Array:
    """Return y = (H + sigma Z^T Z)^-1 rho with |Z y| <= radius, the smallest sigma with a positive definite matrix.

    Lengths are measured in coordinates, since a mass metric would neglect light bodies.
    """
    Z, R = np.linalg.qr(Z)
    R_inverse = np.linalg.inv(R)
    size = np.abs(R_inverse)
    H, noise = R_inverse.T @ H @ R_inverse, size.T @ noise @ size
    return R_inverse @ constrained_step(Z, H, noise, R_inverse.T @ rho, radius)


def constrained_step(Z: Array, H: Array, noise: Array, rho: Array, radius: float) -> Array:
    """Return the step y = (H + sigma)^-1 rho of `step` for orthonormal columns of Z."""
    w, Q = symmetric_part(H)
    size = np.abs(w).max()
    unknown = CERTAIN * (np.abs(Q) * (noise @ np.abs(Q))).sum(0)
    if w[0] > unknown[0]:
        y = np.linalg.solve(H, rho)
        if np.abs(Z @ y).max() <= radius:
            return y
    c = Q.T @ rho
    flat = np.abs(w) <= unknown
    c[flat & (np.abs(c) <= FLAT * np.linalg.norm(rho))] = 0.0

    def at(sigma: float) -> Array:
        return Q @ np.divide(c, w + sigma, out=np.zeros_like(c), where=c != 0)

    low = max(0.0, -w[0]) + CERTAIN * tol.EPS * size + FLAT * np.linalg.norm(rho) * np.abs(Z).max() / radius
    if w[0] > unknown[0]:
        low = 0.0

    def length(sigma: float) -> float:
        return float(np.abs(Z @ at(sigma)).max())

    if length(low) <= radius:
        y = at(low)
        if w[0] < -unknown[0]:  # the hard case: extend to the radius along the lowest direction
            e = Q[:, 0] * (1.0 if c[0] >= 0 else -1.0)
            y = y + e * (radius - np.abs(Z @ y).max()) / np.abs(Z @ e).max()
        return y
    high = max(low, np.linalg.norm(rho) * np.abs(Z).max() / radius * len(rho), size)
    return at(_bisect(length, radius, low, high))


def _bisect(length: Callable[[float], float], radius: float, low: float, high: float) -> float:
    """Return sigma, to a tenth, with length(sigma) <= radius < length(low); ``high`` grows until it satisfies that."""
    while length(high) > radius:
        high *= 4
    for _ in range(60):
        middle = np.sqrt(low * high) if low > 0 else high / 16
        if length(middle) > radius:
            low = middle
        else:
            high = middle
        if high <= 1.1 * low:
            break
    return high
