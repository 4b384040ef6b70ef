"""A run's watch for stiffness: steps that stability keeps short, where the motion would allow long ones."""

import warnings
from contextlib import suppress
from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING

import numpy as np

from ..errors import StepError
from ..mechanism.formulations.index2 import Index2System
from ..methods import Tableau
from ..system import Array
from .steppers.adaptive import SMALLEST_SCALE, Adaptive

if TYPE_CHECKING:
    from .run import RunState

FIRST, MOST = 2000, 16000  # steps before the first look (shorter runs are soon over), and between later ones
WINDOW = 50  # steps in which one polynomial follows the velocities
NODES, BETWEEN = (0, 7, 25, 43, 50), (3, 14, 19, 31, 36, 47)  # of the window: where it interpolates, and is compared
ROUGH = 3.0  # times the tolerance: fast parts that steps at the limit of stability leave alive
LONGER = 2.0  # times as long: steps that would be unstable
ITERATIONS = 12  # of the power method
SMALL = 1e-7  # of 1 + |y|: the difference it takes
FREE = 0.9  # of max_step: longer steps are kept short by that


@dataclass
class Stiff:
    """Where a run was found stiff.

    Attributes:
        t: time in s.
        h: mean size of the steps before in s.
        h_rho: h times the spectral radius of the mechanism's equations, solved for accelerations.
    """

    t: float
    h: float
    h_rho: float

    def __str__(self) -> str:
        steps = f"stiff: at t = {self.t:.6g} s stability keeps steps to {self.h:.2g} s (h*rho = {self.h_rho:.2g})"
        return f'{steps}, the motion is smooth over {WINDOW} of them: try -m radau5 (method="radau5")'


class StiffnessDetector:
    """Looks now and then whether stability limits the steps of a half-explicit method under step-size control.

    It does where two things come together. One polynomial of degree 4 follows the velocities of the last fifty steps
    to three times the tolerance, so accuracy does not ask for them; vibrations that the motion has do. And steps twice
    as long would be unstable: |R(2 h lam)| > 1 with the method's stability function R and the largest eigenvalue
    lam of y' = f(t, y, z(t, y)), where z meets the hidden constraint. The power method finds lam, only where the motion
    is smooth. (Hairer, Wanner II, IV.2, compare two stages at one time, which few half-explicit methods have.)

    Args:
        system: the run's workspace.
        tableau: a half-explicit method.
        control: of the steps.
    """

    def __init__(self, system: Index2System, tableau: Tableau, control: Adaptive) -> None:
        self.system, self.tableau, self.control = system, tableau, control
        self.next = self.pause = FIRST  # the node to look at, and the steps to the one after
        self.found: Stiff | None = None

    def restart(self, first: int) -> None:
        """Steps begin anew at node ``first``, behind a jump: no window reaches across."""
        self.next = max(self.next, first + WINDOW)

    def look(self, run: "RunState") -> None:
        """Look at the steps since the last look; the first one that is found stiff is a warning."""
        while not self.found and self.next < len(run.ts):
            n = self.next
            self.next, self.pause = n + self.pause, min(2 * self.pause, MOST)
            with suppress(StepError):
                self.found = self._judge(run, n)
            if self.found:
                warnings.warn(str(self.found), stacklevel=5)

    def _judge(self, run: "RunState", n: int) -> Stiff | None:
        """Return what is stiff about the steps before node n."""
        h = (run.ts[n] - run.ts[n - WINDOW]) / WINDOW
        if abs(h) > FREE * self.control.largest or not self._smooth(run, n):
            return None
        lam = _largest_eigenvalue(run.record().system, run.ts[n], run.ys[n])
        z = abs(h) * complex(-abs(lam.real), lam.imag)  # a motion that is smooth decays, whatever rounding says
        if not _growth(self.tableau, LONGER * z) > 1:
            return None
        return Stiff(float(run.ts[n]), float(abs(h)), float(abs(z)))

    def _smooth(self, run: "RunState", n: int) -> bool:
        """Say whether one polynomial of degree 4 follows velocities and states before node n closely."""
        t, nq, nv, ns = run.ts[n - WINDOW : n + 1], self.system.nq, self.system.nv, self.system.ns
        v = run.ys[n - WINDOW : n + 1][:, nq : nq + nv + ns]
        weights = _lagrange([t[i] for i in NODES], [t[i] for i in BETWEEN])
        atol = self.control.atol[nv : 2 * nv + ns] if self.control.atol.ndim else self.control.atol
        gap = (v[list(BETWEEN)] - weights @ v[list(NODES)]) / (
            atol + self.control.rtol * np.abs(v[-1]) + SMALLEST_SCALE
        )
        return bool(np.vdot(gap, gap) <= ROUGH**2 * gap.size)


def _lagrange(nodes: list[float], times: list[float]) -> Array:
    """Return the weights (times, nodes) of values at the nodes in the interpolation polynomial at other times."""
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
        StepError: for a point where y' cannot be found.
    """
    F = system.derivative(t, y)[0]
    size = SMALL * (1 + float(np.linalg.norm(y[:-1])))
    x = np.random.default_rng(0).normal(size=system.ny)
    iterates: list[tuple[Array, Array]] = []
    for _ in range(ITERATIONS):
        x[-1] = 0.0  # the work changes nothing
        x *= size / np.linalg.norm(x)
        slope = system.derivative(t, system.add(y, x))[0] - F
        slope[-1] = 0.0
        if not slope.any():
            return 0j
        iterates = [*iterates[-1:], (x, slope)]
        x = slope.copy()
    (x0, slope0), (x1, slope1) = iterates
    a, b = np.linalg.lstsq(np.column_stack([x1, x0]), slope1, rcond=1e-6)[0]
    roots = np.roots([1.0, -a, -b * np.linalg.norm(slope0) / size])
    return complex(max(roots, key=abs))
