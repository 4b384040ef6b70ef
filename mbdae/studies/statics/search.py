"""The way to an equilibrium: a trust region in free motions that needs no potential.

y = (H + sigma Z^T Z)^-1 rho with the least sigma >= 0 for which that is positive definite and |Z y| stays within the
radius; a step is taken when the trapezoidal work (f + f_new) . x / 2, x = q_new (-) q, exceeds a tenth of what the
slopes promise: that serves controllers, constant torques and follower forces as well as gravity and springs.
Source: Conn, Gould, Toint, Trust-Region Methods (2000), chapter 7, for the step.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...errors import StepError
from ...system import Array

if TYPE_CHECKING:
    from ...mechanism.formulations.balance import Balance, Statics

START, LARGEST, LEAST = 0.3, 1.5, 1e-12  # rad or m: radii of trust
TAKEN, GOOD = 0.1, 0.7  # of the work promised
NEARLY = 1e-5  # of the largest force met: from there on Newton steps go on to rounding
EXACT = 1e-17  # of the largest force met: nothing
ROUNDED = 1e-11  # of the largest force met: what stands for none
BENT = 1e-3  # rad or m: what so much of a motion changes of the forces counts as met, where a search begins at rest
BALANCED = 1e-8  # of the largest force met: what is left of it where rounding lets no step make it less
FLAT = 1e-9  # of the largest eigenvalue of H: a neutral direction
SYMMETRIC = 1e-7  # of the largest entry of H: what differs from its transpose by less has a potential
RELAXED, SHORT = 3, 0.5  # steps that let stiff springs rest, and their length as a share of the step before
HALVED = 0.5  # of rho: what a step to rounding must leave at most
HALVINGS, ENOUGH = 4, 0.9  # of a step to an equilibrium of any kind, and what it may leave of rho
ITERATIONS = 100


@dataclass
class Search:
    """A search from one configuration.

    Attributes:
        statics: the balance.
        here: the best point.
        scale: the largest force met, or that of a small motion.
        radius: of trust.
        iterations: steps tried.
    """

    statics: "Statics"
    here: "Balance"
    scale: float = 0.0
    radius: float = START
    iterations: int = 0

    @property
    def residual(self) -> float:
        """|rho| as a share of the largest force met."""
        return float(np.linalg.norm(self.here.rho)) / (self.scale or 1.0)

    @property
    def loose(self) -> bool:
        """Whether no motion is met by a force: H is rounding."""
        H, Z = self.here.H, self.here.free.Z
        return bool(np.abs(H).max(initial=0.0) <= ROUNDED * self.scale * np.abs(Z).max(initial=0.0))

    def run(self, find: str) -> bool:
        """Go on until forces balance, in a minimum unless any equilibrium will do; say whether they do."""
        self.here = self.statics.point(self.statics.close(self.here.q, self.here.s), self.here.s)
        stiff = np.abs(self.here.H).max(initial=0.0) / np.abs(self.here.free.Z).max(initial=1e-300)
        self.scale = max(self.scale, self.here.size, BENT * float(stiff))
        while self.iterations < ITERATIONS and self.radius > LEAST:
            if self.residual <= NEARLY:
                self.polish()
            if self.residual <= ROUNDED:
                low = self.lowest()
                if find == "any" or low is None or not self.leave(low):
                    return True
            elif not (self.newton() if find == "any" else self.descend()):
                break
        self.polish()
        return self.residual <= BALANCED

    def lowest(self) -> Array | None:
        """The unit direction y (k,) in which forces push straight away the most; None where they do not."""
        H = self.here.H
        if not len(H):
            return None
        w, Q = np.linalg.eig(H) if np.abs(H - H.T).max() > SYMMETRIC * np.abs(H).max() else symmetric(H)
        w = np.where(np.abs(w.imag) <= FLAT * np.abs(w).max(), w.real, np.inf)  # pairs turn: they flutter, and stay
        return Q[:, w.argmin()].real if w.min() < -FLAT * np.abs(H).max() and not self.loose else None

    def polish(self) -> None:
        """Newton's steps as long as they are short and halve rho."""
        while self.iterations < ITERATIONS and self.residual > EXACT and not self.loose:
            y = np.linalg.lstsq(self.here.H, self.here.rho, rcond=FLAT)[0]
            near = np.abs(self.here.free.Z @ y).max(initial=0.0) < START
            there = self.moved(y) if near else None
            if there is None or not np.linalg.norm(there.rho) < HALVED * np.linalg.norm(self.here.rho):
                return
            self.here = there

    def descend(self) -> bool:
        """One step downhill; False where none is found."""
        rho, H = self.here.rho, self.here.H
        while self.radius > LEAST and self.iterations < ITERATIONS:
            y = step(self.here.free.Z, H, rho, self.radius)
            there = self.relaxed(self.moved(y), float(np.abs(self.here.free.Z @ y).max()))
            promised = float(rho @ y - y @ H @ y / 2)
            done = self.work(there) if there else -np.inf
            if there and done > TAKEN * promised:
                if done > GOOD * promised:
                    self.radius = min(LARGEST, 2 * self.radius)
                self.here = there
                return True
            self.radius = min(self.radius, float(np.abs(self.here.free.Z @ y).max())) / 3
        return False

    def relaxed(self, there: "Balance | None", length: float) -> "Balance | None":
        """Let stiff springs, which a step of this length stretched across a bend, find their rest: Newton's steps."""
        for _ in range(RELAXED):
            if there is None or np.linalg.norm(there.rho) <= np.linalg.norm(self.here.rho):
                break
            w, Q = symmetric(there.H)
            d = np.divide(Q.T @ there.rho, w, out=np.zeros_like(w), where=w > FLAT * np.abs(w).max())
            d[np.abs(there.free.Z @ Q).max(0) * np.abs(d) > SHORT * length] = 0.0
            nearer = self.at(there, Q @ d)
            if nearer is None or not np.linalg.norm(nearer.rho) < np.linalg.norm(there.rho):
                break
            there = nearer
        return there

    def newton(self) -> bool:
        """One step that makes rho less, towards an equilibrium of any kind; a step downhill where none does."""
        rho, H = self.here.rho, self.here.H
        y = np.linalg.lstsq(H, rho, rcond=FLAT)[0]
        y *= min(1.0, LARGEST / max(1e-300, float(np.abs(self.here.free.Z @ y).max())))
        for _ in range(HALVINGS):
            there = self.moved(y)
            if there and np.linalg.norm(there.rho) < ENOUGH * np.linalg.norm(rho):
                self.here = there
                return True
            y /= 2
        return self.descend()

    def leave(self, low: Array) -> bool:
        """Step off a saddle or a maximum, to the side where forces do work."""
        reach = float(np.abs(self.here.free.Z @ low).max())
        radius = max(self.radius, START)
        while radius > LEAST:
            for sign in (1.0, -1.0):
                there = self.moved(sign * radius / reach * low)
                if there and self.work(there) > 0:
                    self.here, self.radius = there, radius
                    return True
            radius /= 3
        return False

    def work(self, there: "Balance") -> float:
        """The work of the forces on the way to another point, in J."""
        x = self.statics.system.manifold.difference(self.here.q, there.q)
        return float((self.here.f + there.f) @ x / 2)

    def moved(self, y: Array) -> "Balance | None":
        """The balance at q (+) Z y, closed; None where loops cannot be closed."""
        self.iterations += 1
        there = self.at(self.here, y)
        if there:
            self.scale = max(self.scale, there.size)
        return there

    def at(self, here: "Balance", y: Array) -> "Balance | None":
        """The same for any point."""
        try:
            q = self.statics.system.manifold.integrate(here.q, here.free.Z @ y)
            return self.statics.point(self.statics.close(q, here.s), here.s)
        except StepError:
            return None


def symmetric(H: Array) -> tuple[Array, Array]:
    """Eigenvalues in rising order (k,) and eigenvectors (k, k) of the symmetric part."""
    return np.linalg.eigh((H + H.T) / 2) if len(H) else (np.empty(0), H)


def step(Z: Array, H: Array, rho: Array, radius: float) -> Array:
    """Return y = (H + sigma Z^T Z)^-1 rho with |Z y| <= radius, the least sigma that leaves a positive definite matrix.

    Steps are short in coordinates, and not in a metric in which those of light bodies would count for nothing.
    """
    Z, R = np.linalg.qr(Z)
    back = np.linalg.inv(R)
    return back @ shortened(Z, back.T @ H @ back, back.T @ rho, radius)


def shortened(Z: Array, H: Array, rho: Array, radius: float) -> Array:
    """The same for orthonormal columns of Z: y = (H + sigma)^-1 rho."""
    w, Q = symmetric(H)
    size = np.abs(w).max()
    if w[0] > FLAT * size:
        y = np.linalg.solve(H, rho)
        if np.abs(Z @ y).max() <= radius:
            return y
    c = Q.T @ rho
    flat = np.abs(w) <= FLAT * size
    c[flat & (np.abs(c) <= FLAT * np.linalg.norm(rho))] = 0.0

    def at(sigma: float) -> Array:
        return Q @ np.divide(c, w + sigma, out=np.zeros_like(c), where=c != 0)

    low = max(0.0, -w[0]) + FLAT * (size + np.linalg.norm(rho) * np.abs(Z).max() / radius)
    if w[0] > FLAT * size:
        low = 0.0
    y = at(low)
    if np.abs(Z @ y).max() <= radius:
        if w[0] < -FLAT * size:  # the hard case: the rest of the radius along the lowest direction
            e = Q[:, 0] * (1.0 if c[0] >= 0 else -1.0)
            y = y + e * (radius - np.abs(Z @ y).max()) / np.abs(Z @ e).max()
        return y
    high = max(low, np.linalg.norm(rho) * np.abs(Z).max() / radius * len(rho), size)
    while np.abs(Z @ at(high)).max() > radius:
        high *= 4
    for _ in range(60):
        middle = np.sqrt(low * high) if low > 0 else high / 16
        if np.abs(Z @ at(middle)).max() > radius:
            low = middle
        else:
            high = middle
        if high <= 1.1 * low:
            break
    return at(high)
