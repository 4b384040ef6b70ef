"""Baseline: scipy's solvers for the index-1 formulation of a mechanism.

The time loop is the same as for the methods of mbdae; scipy's solvers choose their steps. On manifolds they integrate
the raw coordinates (components of quaternions, cosines and sines).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ...errors import InputError, StepError
from ...mechanism.formulations.index1 import Index1System
from ...methods import EXPLICIT, METHODS, MethodLike
from ...methods import method as named_method
from ...system import Array, State, Step, System
from .adaptive import Adaptive

if TYPE_CHECKING:
    from scipy.integrate import OdeSolver

    from ..run_state import RunState

UNCONTROLLED = 1e30  # absolute tolerance of the work, whose error is not controlled


@dataclass(frozen=True)
class ScipySolver:
    """A method of scipy.

    Attributes:
        name: name of its solver in scipy.integrate.
        order: its order.
        implicit: whether it is implicit.
    """

    name: str
    order: int
    implicit: bool

    excludes: ClassVar[Mapping[str, str]] = {}
    in_core = True  # the compiled core evaluates its equations
    error_power = 1  # positive: it controls its step sizes

    @property
    def solver(self) -> "type[OdeSolver]":
        """Solver class, imported on demand: scipy.integrate is slow to import, and rarely needed."""
        solver: type[OdeSolver] = getattr(import_module("scipy.integrate"), self.name)
        return solver

    @property
    def order_linear(self) -> int:
        """Order on mechanisms."""
        return self.order


SCIPY: dict[str, ScipySolver] = {
    b.name: b
    for b in (
        ScipySolver("RK45", 5, False),
        ScipySolver("DOP853", 8, False),
        ScipySolver("Radau", 5, True),
        ScipySolver("LSODA", 5, True),  # of variable order
    )
}


def find_method(formulation: str, method: MethodLike) -> Any:
    """Return the method of a given name for a formulation: a `Method`, an `ExplicitMethod` or a `ScipySolver`.

    Raises:
        InputError: for a method of another formulation; the message lists the valid methods.
        UnknownNameError: for an unknown method.
    """
    if formulation == "index1":
        if not isinstance(method, str) or method not in (*EXPLICIT, *SCIPY):
            names = f"{', '.join(EXPLICIT)} and scipy's methods {', '.join(SCIPY)}"
            raise InputError(f"formulation 'index1' takes {names}, got {method!r}")
        return EXPLICIT.get(method) or SCIPY[method]
    if isinstance(method, str) and method in (*EXPLICIT, *SCIPY):
        raise InputError(
            f"method {method!r} belongs to formulation 'index1'; formulation {formulation!r} takes {', '.join(METHODS)}"
        )
    return named_method(method)


class Scipy(Adaptive):
    """A solver of scipy, with its own step-size control and its definition of rtol and atol.

    Rejected steps are counted for RK45 and DOP853; Radau and LSODA do not report them (None).

    Args:
        baseline: the solver.
        system: the mechanism in the index-1 formulation.
        step: a fixed step, which scipy's solvers do not support: rejected.
        rtol: relative tolerance.
        atol: absolute tolerance, a number or one for each component of (q, v).
        first_step: first step in s; None for the estimate of the solver.
        max_step: largest step in s.

    Raises:
        InputError: for a fixed step; for an implicit solver or several atol on a manifold.
    """

    any_size = False

    def __init__(
        self,
        baseline: ScipySolver,
        system: System,
        step: float | None,
        rtol: float,
        atol: float | Array | None,
        first_step: float | None,
        max_step: float,
    ) -> None:
        super().__init__(baseline.order + 1, rtol, atol, first_step, max_step)
        if step is not None:
            raise InputError("formulation 'index1' controls the step size: set rtol and atol instead of a step")
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
                    "formulation 'index1' takes one number as atol for quaternions and unbounded revolute joints"
                )
        self.baseline: ScipySolver = baseline
        self.system: Index1System = system
        self.solver: Any = None
        self.backend = "native" if system.native else "python"
        self._last: tuple[float, Array, Array] | None = None

    @property
    def control(self) -> None:
        return None

    def _rate(self, t: float, y: Array) -> Array:
        F, z = self.system.rate(t, y)
        self._last = t, y.copy(), z
        return F

    def _start(self, run: "RunState") -> None:
        s = self.system
        self._scale(run, run.state.y)  # rejects an atol of the wrong shape
        atol = np.append(np.broadcast_to(self.atol, s.nq + s.nv + s.ns), UNCONTROLLED)
        first_step = None if self.h is None else min(self.h, run.time_to_interval_end())
        settings = {"rtol": self.rtol, "atol": atol, "max_step": self.max_step, "first_step": first_step}
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
        return Step(State(self.system.normal(y)), z, np.zeros((0, self.system.ny)))

    def error(self, run: "RunState", step: Step) -> float:
        """Return 0: the solver has accepted its step."""
        return 0.0

    def restart(self) -> None:
        """Start a new solver after a jump."""
        self.solver = self.h = None

    def may_retry(self, run: "RunState", h: float, reason: StepError) -> bool:
        """Return False: the solver chooses its steps."""
        return False

    def accept_or_reject(self, run: "RunState", h: float, error: float) -> bool:
        """Return True: the solver has accepted its step."""
        return True
