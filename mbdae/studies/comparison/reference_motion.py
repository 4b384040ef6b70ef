"""A motion that several methods compute, and errors relative to a reference."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from ...errors import InputError, StepError
from ...integrate.run.run_setup import bind
from ...integrate.solve import solve
from ...mechanism import Mechanism
from ...mechanism.flexible.linear_range import beyond_linear
from ...mechanism.formulations.index1 import Index1System
from ...solution.solution import Problem, Solution, uninterrupted
from ...system import Array
from ...tolerances import EPS, EVALUATION_ROUNDING, SOLUTION_ROUNDING, SUM_ROUNDING, VISIBLE
from ..drift.drift import drift
from ..method_variant import Variant
from ..workers import Stop, stop_check
from .comparison import TEXTBOOK_QUANTITIES
from .run_result import COUNTS, RunResult

UNDETERMINED = "q, v or lam is undetermined at a common time"
TIGHTEST, LOOSEST = EVALUATION_ROUNDING, VISIBLE  # range of tolerances of a reference run
Samples = dict[str, Array]  # at the common times: q (m, nq), v (m, nv), lam (m, ng); y (m, ny), z (m, nz)


@dataclass(frozen=True)
class Trial:
    """Settings of one run: a method, and its tolerance or number of fixed steps."""

    variant: Variant
    rtol: float | None = None
    n: int | None = None

    @property
    def label(self) -> tuple[str, float | None, int | None]:
        """The key of the run, as `mbdae.studies.comparison.run_result.RunResult.label`."""
        return str(self.variant), self.rtol, self.n

    def __str__(self) -> str:
        return f"{self.variant}, " + (f"rtol {self.rtol:g}" if self.n is None else f"{self.n} steps")


@dataclass(frozen=True)
class ReferenceMotion:
    """A mechanism or textbook problem with a start, a time span, and the common times of the samples.

    Attributes:
        problem: the problem.
        start: configuration (nq,) and velocity (nv,) of a mechanism; empty for a textbook problem.
        t_span: start and end in s.
        times: common times in s, without the start, (m,).
        max_steps: runs with more steps are aborted.
        backend: back end of all runs, see `mbdae.solve`.
        python_reason: the reason why the runs cannot use the compiled core; "" if they can.
    """

    problem: Problem
    start: tuple[Array, ...]
    t_span: tuple[float, float]
    times: Array
    max_steps: int
    backend: str = "auto"
    python_reason: str = ""

    def solve(self, trial: Trial, stop: Stop | None = None) -> Solution:
        """Run a method.

        Raises:
            KeyboardInterrupt: if the user interrupts it, or ``stop()`` is true.
        """
        t0, t1 = self.t_span
        adaptive = {"rtol": trial.rtol, "max_steps": self.max_steps}
        control = adaptive if trial.n is None else {"step": abs(t1 - t0) / trial.n}
        options = {**trial.variant.arguments(), **control, "backend": self.backend}
        return uninterrupted(solve(self.problem, self.t_span, *self.start, progress=stop_check(stop), **options))  # type: ignore[arg-type]

    def sample(self, sol: Solution) -> Samples:
        """Return the state and the hidden-constraint multipliers at the common times.

        From the step before each time, the underlying ordinary differential equation is integrated to rounding: this
        measures the error of the steps, not that of interpolation. After a singular configuration, which that equation
        cannot cross, the run is interpolated. At each time the mode and the number of independent rows are those of the
        step, since constraint drift increases the numerical rank.
        """
        m = self.problem
        system: Any = bind(m, "index1" if isinstance(m, Mechanism) else "index2", None, self.backend)[0]
        points, z = [], np.full((len(self.times), system.nz), np.nan)
        for k, (t, node) in enumerate(zip(self.times, sol.before(self.times), strict=True)):
            points.append(_integrated_from_node(sol.prepared(system, int(node), frozen=False), sol, int(node), t))
            with suppress(StepError):  # lam is undetermined in a singular configuration
                z[k] = system.derivative(t, points[-1])[1]
        y = np.array(points)
        if isinstance(m, Mechanism):
            return {"q": y[:, : m.nq], "v": y[:, m.nq : m.nq + m.nv], "lam": z}
        return dict(zip(TEXTBOOK_QUANTITIES, (y, z), strict=True))

    def difference(self, a: Samples, b: Samples) -> Array:
        """Return the largest difference of each quantity at each time, (m, 3) or (m, 2)."""
        differences = {name: np.abs(a[name] - b[name]).max(axis=1, initial=0.0) for name in a}
        if isinstance(self.problem, Mechanism):
            pairs = zip(a["q"], b["q"], strict=True)
            differences["q"] = np.array([np.abs(self.problem.manifold.difference(y, x)).max() for x, y in pairs])
        return np.column_stack(list(differences.values()))

    def measure(self, trial: Trial, sol: Solution, reference: Samples) -> RunResult:
        """Return the result of a run, without times."""
        without_warnings = sol.status == "finished" and "stiff" not in sol.stats
        message = "" if without_warnings else sol.message
        row = RunResult(*trial.label, sol.status, **{name: sol.stats[name] for name in COUNTS}, message=message)
        if not sol.ended:
            return row
        errors, drifted = self.difference(self.sample(sol), reference), drift(sol)
        if not np.isfinite(errors).all():
            return replace(row, message=UNDETERMINED)
        largest, last = (dict(zip(reference, e.tolist(), strict=True)) for e in (errors.max(axis=0), errors[-1]))
        return replace(
            row, errors=largest, ends=last, g=drifted.g_max, Gv=drifted.Gv_max, energy=drifted.energy_relative
        )

    def tightest(self, variant: Variant, rtol: float) -> tuple[Trial, Samples]:
        """Return the reference run: at ``rtol``, or at the next power of ten that the method can satisfy.

        A run that stops at a singular configuration after constraint drift is repeated with projection.

        Raises:
            InputError: if the method can satisfy none of them.
        """
        while rtol <= LOOSEST:
            trial = Trial(variant, rtol)
            sol = replace(self, max_steps=100 * self.max_steps, backend="auto").solve(trial)
            if is_valid_reference(sol):
                return trial, self.sample(sol)
            if sol.status == "rank" and variant.formulation == "index2" and not variant.project:
                return self.tightest(replace(variant, project=True), rtol)
            rtol *= 10
        raise InputError(f"no reference for {self.problem.title!r}: {variant} ends with {sol.status}, {sol.message}")

    def reference(self, names: Sequence[Variant], rtol: float) -> tuple[tuple[str, str], Samples, dict[str, float]]:
        """Return the reference of errors: the exact solution if known, else two runs with tight tolerances.

        Returns:
            Descriptions of both runs; samples of the first; and for each quantity its difference from the second, at
            least the rounding of the samples.
        """
        samples, second_samples = self._exact(), None
        labels = ("the exact solution", "")
        if samples is None:
            (first, samples), (second, second_samples) = (self.tightest(v, rtol) for v in names)
            labels = (str(first), str(second))
        rounding = np.array([EPS * (1.0 + np.abs(x).max(initial=0.0)) for x in samples.values()])
        uncertainty = rounding
        if second_samples is not None:
            uncertainty = np.maximum(self.difference(samples, second_samples).max(axis=0), rounding)
        return labels, samples, dict(zip(samples, uncertainty.tolist(), strict=True))

    def _exact(self) -> Samples | None:
        """Return the exact solution, if it is known for this start."""
        exact = None if isinstance(self.problem, Mechanism) else self.problem.exact
        if exact is None:
            return None
        start = self.problem.point(t=self.t_span[0])
        if not np.allclose(exact(self.t_span[0])[0], start, rtol=SOLUTION_ROUNDING, atol=SOLUTION_ROUNDING):
            return None
        y, z = zip(*map(exact, self.times), strict=True)
        return dict(zip(TEXTBOOK_QUANTITIES, (np.array(y), np.array(z)), strict=True))


def is_valid_reference(sol: Solution) -> bool:
    """Return whether a run succeeded, or is doubtful only since deflections exceed the range of linear modes."""
    if sol.success or sol.status != "doubtful" or not isinstance(sol.problem, Mechanism):
        return bool(sol.success)
    return sol.message == beyond_linear(sol.mechanism.model, sol.nodes[1][:, : sol.mechanism.nq])


def _integrated_from_node(system: Any, sol: Solution, i: int, t: float) -> Array:
    """Return the point of a run at time t, integrated from its last node i before t."""
    ts, ys, zs = sol.nodes
    if abs(t - ts[i]) <= 16 * np.spacing(abs(t)):
        return ys[i]
    if any(abs(x.t - ts[i]) <= abs(t - ts[i]) and (x.t - ts[i]) * (t - ts[i]) >= 0 for x in sol.singular):
        return sol.point(t)
    atol = SUM_ROUNDING * (1.0 + np.abs(ys[i]))
    options = {"rtol": SOLUTION_ROUNDING, "atol": atol}
    if isinstance(system, Index1System):
        continued = solve_ivp(lambda s, y: system.rate(s, y)[0], (ts[i], t), ys[i], "DOP853", **options)
        return system.normalized(continued.y[:, -1])
    system.derivative(ts[i], ys[i], zs[i])  # select the root z of the run
    return solve_ivp(lambda s, y: system.derivative(s, y)[0], (ts[i], t), ys[i], "DOP853", **options).y[:, -1]
