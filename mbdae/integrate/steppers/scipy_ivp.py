"""Baseline: scipy's solvers for the index-1 formulation of a mechanism.

The time loop is the same as for the methods of mbdae, but scipy's solvers choose the steps. On manifolds they integrate
the raw coordinates (components of quaternions, cosines and sines).
"""

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, StepError
from ...mechanism.formulations.index1 import Index1System
from ...system import Array, Step, System
from .library_solver import UNCONTROLLED, LibrarySolver, LibraryStepper

if TYPE_CHECKING:
    from scipy.integrate import OdeSolver

    from ..run.run_state import RunState


@dataclass(frozen=True)
class ScipySolver(LibrarySolver):
    """A method of scipy.

    Attributes:
        name: name of its solver in scipy.integrate.
        order: its order.
        implicit: whether it is implicit.
    """

    implicit: bool

    @property
    def solver(self) -> "type[OdeSolver]":
        """Solver class, imported on demand: scipy.integrate is slow to import, and rarely needed."""
        solver: type[OdeSolver] = getattr(import_module("scipy.integrate"), self.name)
        return solver

    def stepper(self, system: System, *control: Any) -> "ScipyStepper":
        """See `LibrarySolver.stepper`."""
        return ScipyStepper(self, system, *control)


SCIPY: dict[str, ScipySolver] = {
    b.name: b
    for b in (
        ScipySolver("RK45", 5, False),
        ScipySolver("DOP853", 8, False),
        ScipySolver("Radau", 5, True),
        ScipySolver("LSODA", 5, True),  # its order varies
    )
}


class ScipyStepper(LibraryStepper):
    """A solver of scipy, with its own step-size control and its definition of rtol and atol.

    Rejected steps are counted for RK45 and DOP853; Radau and LSODA do not report them (None).

    Args:
        baseline: the solver.
        system: the mechanism in the index-1 formulation.
        *control: see `LibraryStepper`.

    Raises:
        InputError: for an implicit solver or several atol on a manifold.
    """

    def __init__(self, baseline: ScipySolver, system: System, *control: Any) -> None:
        super().__init__(baseline, system, *control)
        if not isinstance(system, Index1System):
            raise InputError("formulation 'index1' is for mechanisms")
        if not system.manifold.flat:
            explicit = ", ".join(b.name for b in SCIPY.values() if not b.implicit)
            if baseline.implicit:
                raise InputError(
                    f"method {baseline.name!r} does not support quaternions and unbounded revolute joints: "
                    f"formulation 'index1' takes {explicit} there"
                )
            if self.atol.ndim:
                raise InputError(
                    "formulation 'index1' needs one number as atol for quaternions and unbounded revolute joints"
                )
        self.baseline: ScipySolver = baseline
        self.system: Index1System = system
        self.backend = "native" if system.native else "python"
        self._last: tuple[float, Array, Array] | None = None

    def _rate(self, t: float, y: Array) -> Array:
        F, z = self.system.rate(t, y)
        self._last = t, y.copy(), z
        return F

    def _start(self, run: "RunState") -> None:
        s = self.system
        atol = np.append(np.broadcast_to(self.atol, s.nq + s.nv + s.ns), UNCONTROLLED)
        settings = {"rtol": self.rtol, "atol": atol, "max_step": self.max_step, "first_step": self.first_size(run)}
        self.solver = self.baseline.solver(self._rate, run.t, run.state.y, run.interval.stop, **settings)

    def propose(self, run: "RunState") -> tuple[float, float]:
        """Let the solver take a step; return its size and end time.

        Raises:
            StepError: if the solver fails.
        """
        if self.solver is None:
            self._start(run)
        before, solver = self.solver.nfev, self.solver
        message = solver.step()
        if solver.status == "failed":
            raise StepError("step_size", f"scipy's {self.baseline.name} stopped at t = {run.t:.17g}: {message}")
        if self.baseline.implicit:
            run.rejected = None
        elif run.rejected is not None:
            run.rejected += (solver.nfev - before) // solver.n_stages - 1
        t = run.interval.end if solver.status == "finished" else float(solver.t)
        return abs(t - run.t), t

    def take(self, run: "RunState", h: float) -> Step:
        """Return the current point of the solver, with the multipliers there."""
        y = self.solver.y
        if self._last is None or self._last[0] != self.solver.t or not np.array_equal(self._last[1], y):
            self._rate(self.solver.t, y)
        _, _, z = self._last or (0.0, y, y)
        return self.end_of_step(self.system.normalized(y), z)

    def restart(self) -> None:
        """Start a new solver after a jump."""
        self.solver = self.h = None
