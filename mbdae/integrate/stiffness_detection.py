"""Stiffness detection: steps limited by stability, where accuracy would allow longer ones."""

import warnings
from contextlib import suppress
from dataclasses import asdict, dataclass
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import StepError
from ..mechanism.formulations.index2 import Index2System
from ..methods import Tableau
from ..system import Array
from ..tolerances import TINY, VISIBLE
from .events.source import EventSource
from .steppers.adaptive import Adaptive

if TYPE_CHECKING:
    from .run_state import RunState
    from .step_map import StepMap

FIRST, MOST = 2000, 16000  # steps before the first check (shorter runs end soon), and between later ones
WINDOW = 50  # steps over which one polynomial approximates the velocities
NODES, BETWEEN = (0, 7, 25, 43, 50), (3, 14, 19, 31, 36, 47)  # of the window: interpolation and comparison points
ROUGH = 3.0  # times the tolerance: fast modes that remain excited at the stability limit
LONGER = 2.0  # step ratio that would be unstable
ITERATIONS = 12  # of the power method
WIDTH = 1e-7  # of 1 + |y|: size of the difference
FREE = 0.9  # of max_step: longer steps are limited by it


@dataclass
class Stiff:
    """Record of detected stiffness.

    Attributes:
        t: time in s.
        h: mean size of the previous steps in s.
        h_rho: h times the spectral radius of the mechanism's equations, solved for accelerations.
    """

    t: float
    h: float
    h_rho: float

    def __str__(self) -> str:
        steps = f"stiff: at t = {self.t:.6g} s stability keeps steps to {self.h:.2g} s (h*rho = {self.h_rho:.2g})"
        return f'{steps}, the motion is smooth over {WINDOW} of them: try -m radau5 (method="radau5")'


class StiffnessDetector(EventSource):
    """Checks at intervals whether stability limits the controlled steps of a half-explicit method.

    Two conditions must hold. One polynomial of degree 4 approximates the velocities of the last fifty steps to three
    times the tolerance, so accuracy does not require them, as it would for vibrations of the motion. And steps twice as
    long would be unstable: |R(2 h lam)| > 1 with the method's stability function R and the largest eigenvalue lam of
    y' = f(t, y, z(t, y)), where z satisfies the hidden constraint. The power method computes lam, only where the motion
    is smooth. (Hairer, Wanner II, IV.2, compare two stages at one time, which few half-explicit methods have.)

    Args:
        system: the run's workspace.
        tableau: a half-explicit method.
        control: step-size control.
    """

    def __init__(self, system: Index2System, tableau: Tableau, control: Adaptive) -> None:
        self.system, self.tableau, self.control = system, tableau, control
        self.next = self.pause = FIRST  # the next node to check, and the interval to the one after
        self.found: Stiff | None = None

    @classmethod
    def of(cls, run: "RunState") -> "StiffnessDetector | None":
        if not isinstance(run.system, Index2System) or not run.control or not isinstance(run.tableau, Tableau):
            return None
        return cls(run.system, run.tableau, run.control)

    def warning(self) -> str:
        return str(self.found or "")

    def statistics(self, run: "RunState") -> dict[str, Any]:
        return {"stiff": asdict(self.found)} if self.found else {}

    def restart(self, run: "RunState", switched: bool) -> None:
        """Restart the window after a jump."""
        self.next = max(self.next, len(run.ts) - 1 + WINDOW)

    def first(self, step: "StepMap") -> None:
        """Check the steps since the last check; the first stiff one causes a warning."""
        self.check(step.run)

    def end(self, run: "RunState") -> None:
        """Check the steps of an interval."""
        self.check(run)

    def check(self, run: "RunState") -> None:
        """Warn at the first stiff window."""
        while not self.found and self.next < len(run.ts):
            n = self.next
            self.next, self.pause = n + self.pause, min(2 * self.pause, MOST)
            with suppress(StepError):
                self.found = self._judge(run, n)
            if self.found:
                warnings.warn(str(self.found), stacklevel=7)

    def _judge(self, run: "RunState", n: int) -> Stiff | None:
        """Return the stiffness of the steps before node n, if any."""
        h = (run.ts[n] - run.ts[n - WINDOW]) / WINDOW
        if abs(h) > FREE * self.control.largest or not self._smooth(run, n):
            return None
        lam = _largest_eigenvalue(run.record().system, run.ts[n], run.ys[n])
        z = abs(h) * complex(-abs(lam.real), lam.imag)  # a smooth motion decays, whatever the rounding
        if not _growth(self.tableau, LONGER * z) > 1:
            return None
        return Stiff(float(run.ts[n]), float(abs(h)), float(abs(z)))

    def _smooth(self, run: "RunState", n: int) -> bool:
        """Return whether one polynomial of degree 4 approximates velocities and states before node n closely."""
        t, nq, nv, ns = run.ts[n - WINDOW : n + 1], self.system.nq, self.system.nv, self.system.ns
        v = run.ys[n - WINDOW : n + 1][:, nq : nq + nv + ns]
        weights = _lagrange([t[i] for i in NODES], [t[i] for i in BETWEEN])
        atol = self.control.atol[nv : 2 * nv + ns] if self.control.atol.ndim else self.control.atol
        gap = (v[list(BETWEEN)] - weights @ v[list(NODES)]) / (
            atol + self.control.rtol * np.abs(v[-1]) + TINY
        )
        return bool(np.vdot(gap, gap) <= ROUGH**2 * gap.size)


def _lagrange(nodes: list[float], times: list[float]) -> Array:
    """Return the weights (times, nodes) of Lagrange interpolation from nodes to other times."""
    return np.array([[prod((t - a) / (b - a) for a in nodes if a != b) for b in nodes] for t in times])


def _growth(tableau: Tableau, z: complex) -> float:
    """Return |R(z)|, R(z) = 1 + z b^T (I - z A)^-1 (1, .., 1), of the method or of the two half steps it takes."""
    a = tableau.arrays
    z = z if tableau.b_embedded else z / 2
    return float(abs(1 + z * (a.b @ np.linalg.solve(np.eye(len(a.b)) - z * a.A, np.ones(len(a.b))))))


def _largest_eigenvalue(system: Index2System, t: float, y: Array) -> complex:
    """Return the largest eigenvalue of y' = f(t, y, z(t, y)) by the power method, one of two if they are a pair.

    Of three iterates x_2 = a x_1 + b x_0 is fitted, and lam^2 = a lam + b.

    Raises:
        StepError: if y' cannot be computed.
    """
    F = system.derivative(t, y)[0]
    size = WIDTH * (1 + float(np.linalg.norm(y[:-1])))
    x = np.random.default_rng(0).normal(size=system.ny)
    iterates: list[tuple[Array, Array]] = []
    for _ in range(ITERATIONS):
        x[-1] = 0.0  # the work has no effect
        x *= size / np.linalg.norm(x)
        derivative = system.derivative(t, system.add(y, x))[0] - F
        derivative[-1] = 0.0
        if not derivative.any():
            return 0j
        iterates = [*iterates[-1:], (x, derivative)]
        x = derivative.copy()
    (x0, derivative0), (x1, derivative1) = iterates
    a, b = np.linalg.lstsq(np.column_stack([x1, x0]), derivative1, rcond=VISIBLE)[0]
    roots = np.roots([1.0, -a, -b * np.linalg.norm(derivative0) / size])
    return complex(max(roots, key=abs))
