"""The way to an equilibrium: a trust region in free motions that needs no potential.

y = (H + sigma Z^T Z)^-1 rho with the least sigma >= 0 for which that is positive definite and |Z y| stays within the
radius; a step is taken when the trapezoidal work (f + f_new) . x / 2, x = q_new (-) q, exceeds a tenth of what the
partials promise: that serves controllers, constant torques and follower forces as well as gravity and springs.
Source: Conn, Gould, Toint, Trust-Region Methods (2000), chapter 7, for the step.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ... import tolerances as tol
from ...errors import StepError
from ...mechanism.formulations.spectrum import CERTAIN, curvature, scale_of, spectrum
from ...mechanism.joints import lengths
from ...system import Array

if TYPE_CHECKING:
    from ...mechanism.formulations.equilibrium_equations import ForceBalance, Statics

START, LARGEST, LEAST = 0.3, 1.5, tol.SOLUTION_ROUNDING  # rad or slides: radii of trust
SLIDES = 5.0  # characteristic lengths: forces bend more where a mechanism turns by 1 rad than where it slides by 1
TAKEN, GOOD = 0.1, 0.7  # of the work promised
NEARLY = tol.INTERPOLATION  # of the terms of forces: from there on Newton steps go on to rounding
SHORT_OF = tol.THREE_DIGITS  # rad or slides: Newton's step at an equilibrium
FLAT = tol.RANK  # of what a step would be without stiffness: sigma where there is neither stiffness nor a limit
SYMMETRIC = tol.SAME_STATE  # of the terms of H: if it differs from its transpose by less, forces have a potential
RELAXED, SHORT = 3, 0.5  # steps that let stiff springs rest, and their length as a share of the step before
HALVED = 0.5  # of rho: the most that a step to rounding may leave
HALVINGS, ENOUGH = 4, 0.9  # of a step to an equilibrium of any kind, and what it may leave of rho
ITERATIONS = 100


@dataclass
class TrustRegion:
    """A search from one configuration.

    Attributes:
        statics: the balance.
        here: the best point.
        radius: of trust.
        iterations: steps tried.
    """

    statics: "Statics"
    here: "ForceBalance"
    radius: float = START
    iterations: int = 0

    @property
    def residual(self) -> float:
        """The largest share that rho is of the terms it is summed from, and of what 1 rad or length would change."""
        return self.statics.residual(self.here)

    def length(self, here: "ForceBalance", y: Array) -> float:
        """How long a motion y is, in rad or slides."""
        return float(np.abs(here.free.Z @ y / self.units).max(initial=0.0))

    @cached_property
    def units(self) -> Array:
        """By which lengths of motions are measured, (nv,): 1 rad, and `SLIDES` characteristic lengths."""
        return self.statics.sizes.l * np.where(lengths(self.statics.mech.model), SLIDES, 1.0)

    def run(self, find: str) -> bool:
        """Go on until forces balance, in a minimum unless any equilibrium will do; return whether they do."""
        self.here = self.statics.point(self.statics.close(self.here.q, self.here.s), self.here.s)
        while self.iterations < ITERATIONS and self.radius > LEAST:
            if self.residual <= NEARLY:
                self.polish()
            if self.at_rest():
                low = self.lowest()
                if find == "any" or low is None or not self.leave_saddle(low):
                    return True
            elif not (self.newton() if find == "any" else self.descend()):
                break
        self.polish()
        return self.residual <= tol.HALF_DIGITS

    def at_rest(self) -> bool:
        """Whether forces balance to rounding, or nearly so and the way to where they do is short."""
        share = self.residual
        near = share <= tol.ITERATION_ROUNDING and self.length(self.here, newton_step(self.here)) <= SHORT_OF
        return near or share <= CERTAIN * tol.EPS

    def lowest(self) -> Array | None:
        """The direction y (k,) in which forces push straight away the most; None where they do not."""
        H, noise = self.here.H, self.here.noise
        if symmetric(H, noise):
            found = curvature(H, noise)
            return found.vectors[:, 0] if found.negative else None
        roots = spectrum(-H, noise)  # pairs turn: they flutter, and stay
        pushed = np.where(roots.growing & (roots.values.imag == 0), roots.values.real, 0.0)
        return roots.vectors[:, pushed.argmax()].real if pushed.any() else None

    def polish(self) -> None:
        """Newton's steps as long as they are short and halve rho."""
        while self.iterations < ITERATIONS and self.residual > tol.BELOW_ROUNDING:
            y = newton_step(self.here)
            there = self.displaced(y) if 0 < self.length(self.here, y) < START else None
            if there is None or not np.linalg.norm(there.rho) < HALVED * np.linalg.norm(self.here.rho):
                return
            self.here = there

    def descend(self) -> bool:
        """One step downhill; False where none is found."""
        rho, H = self.here.rho, self.here.H
        while self.radius > LEAST and self.iterations < ITERATIONS:
            y = step(self.here.free.Z / self.units[:, None], H, self.here.noise, rho, self.radius)
            there = self.relaxed(self.displaced(y), self.length(self.here, y))
            promised = float(rho @ y - y @ H @ y / 2)
            done = self.work(there) if there else -np.inf
            if there and done > TAKEN * promised:
                if done > GOOD * promised:
                    self.radius = min(LARGEST, 2 * self.radius)
                self.here = there
                return True
            self.radius = min(self.radius, self.length(self.here, y)) / 3
        return False

    def relaxed(self, there: "ForceBalance | None", length: float) -> "ForceBalance | None":
        """Let stiff springs, which a step of this length stretched across a bend, find their rest: Newton's steps."""
        for _ in range(RELAXED):
            if there is None or np.linalg.norm(there.rho) <= np.linalg.norm(self.here.rho):
                break
            bent = curvature(there.H, there.noise)
            d = np.divide(bent.vectors.T @ there.rho, bent.values, out=np.zeros(len(there.H)), where=bent.signs > 0)
            ways = np.abs(there.free.Z @ bent.vectors / self.units[:, None]).max(0)
            d[ways * np.abs(d) > SHORT * length] = 0.0
            nearer = self.at(there, bent.vectors @ d)
            if nearer is None or not np.linalg.norm(nearer.rho) < np.linalg.norm(there.rho):
                break
            there = nearer
        return there

    def newton(self) -> bool:
        """One step that makes rho less, towards an equilibrium of any kind; a step downhill where none does."""
        rho, y = self.here.rho, newton_step(self.here)
        y *= min(1.0, LARGEST / max(tol.TINY, self.length(self.here, y)))
        for _ in range(HALVINGS):
            there = self.displaced(y)
            if there and np.linalg.norm(there.rho) < ENOUGH * np.linalg.norm(rho):
                self.here = there
                return True
            y /= 2
        return self.descend()

    def leave_saddle(self, low: Array) -> bool:
        """Step off a saddle or a maximum, to the side where forces do work."""
        reach = self.length(self.here, low)
        radius = max(self.radius, START)
        while radius > LEAST:
            for sign in (1.0, -1.0):
                there = self.displaced(sign * radius / reach * low)
                if there and self.work(there) > 0:
                    self.here, self.radius = there, radius
                    return True
            radius /= 3
        return False

    def work(self, there: "ForceBalance") -> float:
        """The work of the forces on the way to another point, in J."""
        x = self.statics.system.manifold.difference(self.here.q, there.q)
        return float((self.here.f + there.f) @ x / 2)

    def displaced(self, y: Array) -> "ForceBalance | None":
        """The balance at q (+) Z y, closed; None where loops cannot be closed."""
        self.iterations += 1
        return self.at(self.here, y)

    def at(self, here: "ForceBalance", y: Array) -> "ForceBalance | None":
        """The same for any point."""
        try:
            q = self.statics.system.manifold.integrate(here.q, here.free.Z @ y)
            return self.statics.point(self.statics.close(q, here.s), here.s)
        except StepError:
            return None


def newton_step(here: "ForceBalance") -> Array:
    """The step y (k,) with H y = rho, of least size along directions in which no stiffness is known."""
    d = scale_of(here.noise)
    return np.linalg.lstsq(here.H / np.outer(d, d), here.rho / d, rcond=CERTAIN * tol.EPS)[0] / d


def symmetric(X: Array, e: Array) -> bool:
    """Whether X (k, k), known to e (k, k), is its own transpose as far as partials are known."""
    return bool((np.abs(X - X.T) <= SYMMETRIC / tol.EPS * (e + e.T) / 2).all())


def symmetric_part(H: Array) -> tuple[Array, Array]:
    """Eigenvalues in rising order (k,) and eigenvectors (k, k) of the symmetric part."""
    return np.linalg.eigh((H + H.T) / 2) if len(H) else (np.empty(0), H)


def step(Z: Array, H: Array, noise: Array, rho: Array, radius: float) -> Array:
    """Return y = (H + sigma Z^T Z)^-1 rho with |Z y| <= radius, the least sigma that leaves a positive definite matrix.

    Steps are short in coordinates, and not in a metric in which those of light bodies would count for nothing.
    """
    Z, R = np.linalg.qr(Z)
    back = np.linalg.inv(R)
    size = np.abs(back)
    return back @ shortened(Z, back.T @ H @ back, size.T @ noise @ size, back.T @ rho, radius)


def shortened(Z: Array, H: Array, noise: Array, rho: Array, radius: float) -> Array:
    """The same for orthonormal columns of Z: y = (H + sigma)^-1 rho."""
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
        if w[0] < -unknown[0]:  # the hard case: the rest of the radius along the lowest direction
            e = Q[:, 0] * (1.0 if c[0] >= 0 else -1.0)
            y = y + e * (radius - np.abs(Z @ y).max()) / np.abs(Z @ e).max()
        return y
    high = max(low, np.linalg.norm(rho) * np.abs(Z).max() / radius * len(rho), size)
    return at(_bisected(length, radius, low, high))


def _bisected(length: Callable[[float], float], radius: float, low: float, high: float) -> float:
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
