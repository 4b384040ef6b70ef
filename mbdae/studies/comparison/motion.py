"""One motion that several methods compute, and how far each of them is from a reference."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from ...errors import InputError, StepError
from ...integrate.binding import bind
from ...integrate.solve import solve
from ...mechanism import Mechanism
from ...mechanism.formulations.index1 import Index1System
from ...solution.solution import Solution
from ...system import Array
from ..drift.drift import drift
from ..variant import Variant
from .comparison import Point

EPS = float(np.finfo(float).eps)
TIGHTEST, LOOSEST = 1e-13, 1e-6  # tolerances of a reference


class Samples(NamedTuple):
    """q (m, nq), v (m, nv), lam (m, ng) at the common times."""

    q: Array
    v: Array
    lam: Array


@dataclass(frozen=True)
class Trial:
    """A run to be made: a method, and its tolerance or number of fixed steps."""

    variant: Variant
    rtol: float | None = None
    n: int | None = None

    @property
    def label(self) -> tuple[str, float | None, int | None]:
        """As `mbdae.studies.comparison.comparison.Point.label`."""
        return str(self.variant), self.rtol, self.n

    def __str__(self) -> str:
        return f"{self.variant}, " + (f"rtol {self.rtol:g}" if self.n is None else f"{self.n} steps")


@dataclass(frozen=True)
class Motion:
    """A mechanism, a start, a time span, and the common times of the samples.

    Attributes:
        mechanism: what moves.
        q: start configuration (nq,).
        v: start velocity (nv,).
        t_span: start and end in s.
        times: common times in s, without the start, (m,).
        max_steps: a run that takes more is given up.
        backend: of all runs, see `mbdae.solve`.
        because: what keeps them from the compiled core, in words; "" where nothing does.
    """

    mechanism: Mechanism
    q: Array
    v: Array
    t_span: tuple[float, float]
    times: Array
    max_steps: int
    backend: str = "auto"
    because: str = ""

    def solve(self, trial: Trial, stop: Callable[[], bool] | None = None) -> Solution:
        """Run a method.

        Raises:
            KeyboardInterrupt: when the user stops it, or ``stop()`` says so.
        """

        def check(done: float) -> None:
            if stop and stop():
                raise KeyboardInterrupt

        t0, t1 = self.t_span
        free = {"rtol": trial.rtol, "max_steps": self.max_steps}
        control = free if trial.n is None else {"step": abs(t1 - t0) / trial.n}
        options = {**trial.variant.arguments(), **control, "backend": self.backend}
        tell = check if stop else None
        sol = solve(self.mechanism, self.t_span, self.q, self.v, progress=tell, **options)  # type: ignore[arg-type]
        if sol.status == "interrupted":
            raise KeyboardInterrupt
        return sol

    def sample(self, sol: Solution) -> Samples:
        """The state and the hidden-constraint multipliers at the common times.

        A run is carried on from the step before each of them by the underlying ordinary differential equation, solved
        to rounding: what is measured is the error of its steps, and not that of an interpolation. Behind a singular
        configuration, which that equation does not pass, it is interpolated. Each time has the mode of its step.
        """
        m, (system, _) = self.mechanism, bind(self.mechanism, None, "index1", None, self.backend)
        assert isinstance(system, Index1System)
        points, lam = [], np.full((len(self.times), m.ng), np.nan)
        for k, (t, node) in enumerate(zip(self.times, sol.before(self.times), strict=True)):
            if sol.modes:
                system.enter(sol.mode(int(node)))
            points.append(_carried(system, sol, int(node), t))
            with suppress(StepError):  # there is none in a singular configuration
                lam[k] = system.derivative(t, points[-1])[1]
        y = np.array(points)
        return Samples(y[:, : m.nq], y[:, m.nq : m.nq + m.nv], lam)

    def difference(self, a: Samples, b: Samples) -> Array:
        """Largest differences of q, v and lam at each of the times, (m, 3)."""
        manifold = self.mechanism.manifold
        dq = [np.abs(manifold.difference(y, x)).max() for x, y in zip(a.q, b.q, strict=True)]
        dv, dlam = (np.abs(x - y).max(axis=1, initial=0.0) for x, y in ((a.v, b.v), (a.lam, b.lam)))
        return np.column_stack([dq, dv, dlam])

    def measure(self, trial: Trial, sol: Solution, reference: Samples) -> Point:
        """The row of a run, without times."""
        counts = {name: sol.stats[name] for name in ("steps", "rejected", "f", "M", "G", "solves", "factorizations")}
        row = Point(*trial.label, sol.status, **counts)
        if not sol.ended:
            return row
        errors, kept = self.difference(self.sample(sol), reference), drift(sol)
        if not np.isfinite(errors).all():
            return row
        names = ("q", "v", "lam")
        found: dict[str, Any] = {f"error_{x}": float(e) for x, e in zip(names, errors.max(axis=0), strict=True)}
        found |= {f"end_{x}": float(e) for x, e in zip(names, errors[-1], strict=True)}
        return replace(row, **found, g=kept.g_max, Gv=kept.Gv_max, energy=kept.energy_relative)

    def tightest(self, variant: Variant, rtol: float) -> tuple[Trial, Samples]:
        """The run of a reference: at ``rtol``, or at the next power of ten that the method can meet.

        Where loops have drifted open before a singular configuration it is run again with positions kept.

        Raises:
            InputError: if it meets none.
        """
        while rtol <= LOOSEST:
            trial = Trial(variant, rtol)
            sol = replace(self, max_steps=100 * self.max_steps, backend="auto").solve(trial)
            if sol.success:
                return trial, self.sample(sol)
            if sol.status == "rank" and variant.formulation == "index2" and not variant.project:
                return self.tightest(replace(variant, project=True), rtol)
            rtol *= 10
        raise InputError(f"no reference for {self.mechanism.title!r}: {variant} ends with {sol.status}, {sol.message}")

    def reference(self, names: Sequence[Variant], rtol: float) -> tuple[list[Trial], Samples, Array]:
        """Two tight runs of different families: what they are, samples of the first, and how far the second differs.

        The difference, (3,) for q, v and lam, is at least the rounding of the samples.
        """
        (first, samples), (second, others) = (self.tightest(v, rtol) for v in names)
        rounding = np.array([EPS * (1.0 + np.abs(x).max(initial=0.0)) for x in samples])
        return [first, second], samples, np.maximum(self.difference(samples, others).max(axis=0), rounding)


def _carried(system: Index1System, sol: Solution, i: int, t: float) -> Array:
    """The point of a run at time t, from its last step end i before t."""
    ts, ys, _ = sol.nodes
    if abs(t - ts[i]) <= 16 * np.spacing(abs(t)):
        return ys[i]
    if any(abs(x.t - ts[i]) <= abs(t - ts[i]) and (x.t - ts[i]) * (t - ts[i]) >= 0 for x in sol.singular):
        return sol.point(t)
    atol = 1e-14 * (1.0 + np.abs(ys[i]))
    carried = solve_ivp(lambda s, y: system.rate(s, y)[0], (ts[i], t), ys[i], "DOP853", rtol=1e-12, atol=atol)
    return system.normal(carried.y[:, -1])
