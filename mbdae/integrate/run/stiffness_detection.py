"""Stiffness detection: steps that are limited by stability, where accuracy would allow longer steps."""

import warnings
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...data_types import JsonObject
from ...errors import StepError
from ...mechanism.formulations.index2 import Index2System
from ...methods import Tableau
from ...methods.stage_arrays import lagrange
from ...system import Array
from ...tolerances import TINY, VISIBLE
from ..events.source import EventSource
from ..steppers.adaptive import Adaptive

if TYPE_CHECKING:
    from .run_state import RunState
    from .step_map import StepMap

FIRST_CHECK, MAX_PAUSE = 2000, 16000  # steps before the first check; largest number of steps between checks
WINDOW = 50  # steps over which one polynomial approximates the velocities
NODES, COMPARED = (0, 7, 25, 43, 50), (3, 14, 19, 31, 36, 47)  # interpolation nodes and comparison points of a window
MAX_RESIDUAL = 3.0  # times the tolerance: amplitude of fast modes excited at the stability limit
STEP_RATIO = 2.0  # ratio of a hypothetical longer step that must be unstable
ITERATIONS = 12  # iterations of the power method
WIDTH = 1e-7  # fraction of 1 + |y|: norm of the perturbation of y
MAX_SIZE = 0.9  # fraction of max_step: longer steps are limited by max_step, not by stability or accuracy


@dataclass
class Stiffness:
    """Detected stiffness.

    Attributes:
        t: time in s.
        h: mean size of the previous steps in s.
        h_rho: h times the spectral radius of the equations of motion, solved for accelerations.
    """

    t: float
    h: float
    h_rho: float

    def __str__(self) -> str:
        steps = f"stiff: at t = {self.t:.6g} s stability limits steps to {self.h:.2g} s (h*rho = {self.h_rho:.2g})"
        return f'{steps}, the motion is smooth over {WINDOW} of them: try -m radau9 (method="radau9")'


class StiffnessDetector(EventSource):
    """Periodic check whether stability limits the controlled steps of a half-explicit method.

    A run is stiff under two conditions. First, a polynomial of degree 4 approximates the velocities of the last fifty
    steps to three times the tolerance, so accuracy does not require such short steps, as it would for vibrations.
    Second, steps of twice the size would be unstable: |R(2 h lam)| > 1, with the stability function R of the method and
    the largest eigenvalue lam of y' = f(t, y, z(t, y)), where z satisfies the hidden constraint. The power method
    computes lam only where the motion is smooth. (The test of Hairer, Wanner II, IV.2, needs two stages at the same
    time, which few half-explicit methods have.)

    Args:
        system: the workspace of the run.
        tableau: a half-explicit method.
        control: step-size control.
    """

    def __init__(self, system: Index2System, tableau: Tableau, control: Adaptive) -> None:
        self.system, self.tableau, self.control = system, tableau, control
        self.next = self.pause = FIRST_CHECK  # next node to check, and number of nodes to the check after it
        self.stiffness: Stiffness | None = None

    @classmethod
    def from_run(cls, run: "RunState") -> "StiffnessDetector | None":
        if not run.mechanism_system or not (control := run.control) or not isinstance(run.tableau, Tableau):
            return None
        return cls(run.mechanism_system, run.tableau, control)

    def warning(self) -> str:
        return str(self.stiffness or "")

    def statistics(self, run: "RunState") -> JsonObject:
        return {"stiff": asdict(self.stiffness)} if self.stiffness else {}

    def after_discontinuity(self, run: "RunState", node: int, mode_changed: bool) -> None:
        """Start the window after the discontinuity."""
        self.next = max(self.next, node + WINDOW)

    def first_event(self, step: "StepMap") -> None:
        """Check the steps since the last check; warn at the first stiff window."""
        self.check(step.run, len(step.run.ts) - 1)

    def end_interval(self, run: "RunState", node: int) -> None:
        """Check the steps at the end of a smooth interval."""
        self.check(run, node)

    def check(self, run: "RunState", node: int) -> None:
        """Warn at the first stiff window up to a node."""
        while not self.stiffness and self.next <= node:
            n = self.next
            self.next, self.pause = n + self.pause, min(2 * self.pause, MAX_PAUSE)
            with suppress(StepError):
                self.stiffness = self._check_window(run, n)
            if self.stiffness:
                warnings.warn(str(self.stiffness), stacklevel=7)

    def _check_window(self, run: "RunState", n: int) -> Stiffness | None:
        """Return the stiffness of the steps before node n; None if they are not stiff."""
        h = (run.ts[n] - run.ts[n - WINDOW]) / WINDOW
        if abs(h) > MAX_SIZE * self.control.max_step or not self._smooth(run, n):
            return None
        lam = _largest_eigenvalue(run.partial_solution().system, run.ts[n], run.ys[n])
        z = abs(h) * complex(-abs(lam.real), lam.imag)  # a smooth motion decays: a positive real part is rounding
        if not _stability_function(self.tableau, STEP_RATIO * z) > 1:
            return None
        return Stiffness(float(run.ts[n]), float(abs(h)), float(abs(z)))

    def _smooth(self, run: "RunState", n: int) -> bool:
        """Return whether one polynomial of degree 4 approximates velocities and states before node n closely."""
        t, nq, nv, ns = np.array(run.ts[n - WINDOW : n + 1]), self.system.nq, self.system.nv, self.system.ns
        v = run.ys[n - WINDOW : n + 1][:, nq : nq + nv + ns]
        weights = lagrange(t[list(NODES)], t[list(COMPARED)])
        atol = self.control.atol[nv : 2 * nv + ns] if self.control.atol.ndim else self.control.atol
        residual = (v[list(COMPARED)] - weights @ v[list(NODES)]) / (atol + self.control.rtol * np.abs(v[-1]) + TINY)
        return bool(np.vdot(residual, residual) <= MAX_RESIDUAL**2 * residual.size)


def _stability_function(tableau: Tableau, z: complex) -> float:
    """Return |R(z)|, R(z) = 1 + z b^T (I - z A)^-1 (1, .., 1), of a step, or of one of its two half steps."""
    a = tableau.arrays
    z = z if tableau.b_embedded else z / 2
    return float(abs(1 + z * (a.b @ np.linalg.solve(np.eye(len(a.b)) - z * a.A, np.ones(len(a.b))))))


def _largest_eigenvalue(system: Index2System, t: float, y: Array) -> complex:
    """Return the largest eigenvalue of y' = f(t, y, z(t, y)) by the power method; one of a complex pair.

    The relation x_2 = a x_1 + b x_0 is fitted to three iterates, and lam^2 = a lam + b.

    Raises:
        StepError: if y' cannot be computed.
    """
    F = system.derivative(t, y)[0]
    norm = WIDTH * (1 + float(np.linalg.norm(y[:-1])))
    x = np.random.default_rng(0).normal(size=system.ny)
    iterates: list[tuple[Array, Array]] = []
    for _ in range(ITERATIONS):
        x[-1] = 0.0  # the work component has no effect
        x *= norm / np.linalg.norm(x)
        derivative = system.derivative(t, system.add(y, x))[0] - F
        derivative[-1] = 0.0
        if not derivative.any():
            return 0j
        iterates = [*iterates[-1:], (x, derivative)]
        x = derivative.copy()
    (x0, derivative0), (x1, derivative1) = iterates
    a, b = np.linalg.lstsq(np.column_stack([x1, x0]), derivative1, rcond=VISIBLE)[0]
    roots = np.roots([1.0, -a, -b * np.linalg.norm(derivative0) / norm])
    return complex(max(roots, key=abs))
