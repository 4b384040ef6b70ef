"""Measurement of observed orders.

The error is the largest over the nodes of the coarsest run, at least five. Errors count above 100 times the
uncertainty of the reference plus the rounding floor; the floor of the method's multipliers is eps / (h min |ahat_ii|),
or of the order of eps / h^2 for forms of index 3 (Bottasso, Bauchau, Cardona, SIAM J. Sci. Comput. 29 (2007)), separate
from that of q and v. The reference is computed by two other methods, and their difference is its uncertainty. The steps
are halved; if four refinements are too few to judge, coarser steps are added, down to five, and then steps between
halvings: a method of order 8 has two or three halvings between long steps and rounding.
`mbdae.studies.order.rates` describes how a slope is fitted and judged.
"""

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TypeVar

import numpy as np

from ...errors import InputError
from ...integrate.solve import solve
from ...mechanism import Mechanism
from ...methods import Method
from ...methods import method as find_method
from ...solution.solution import Problem, Solution, uninterrupted
from ...system import Array
from ...tolerances import EPS, SOLUTION_ROUNDING
from .rates import FLOOR_RATIO, REFINEMENTS, count_above_floors, fit, is_complete
from .result import ObservedOrder

MIN_OUTPUTS = 5
SUBDIVISIONS = 2, 4  # numbers of intervals into which a halving is divided by additional steps
LARGEST_RUN = 120_000  # largest number of solves in one run of the study
Progress = Callable[[str], None]
Result = TypeVar("Result")


class Measurement:
    """Runs with fixed steps, errors at common times, references.

    Attributes:
        max_solves: largest number of solves in one run.
        add_coarser_steps: whether to add coarser steps if orders cannot be estimated otherwise.
    """

    max_solves = LARGEST_RUN
    add_coarser_steps = False

    def __init__(
        self,
        problem: Problem,
        T: float,
        steps: int,
        start: tuple[Array, Array] | None,
        progress: Progress,
        backend: str,
    ) -> None:
        self.problem, self.T, self.steps, self.progress, self.backend = problem, T, steps, progress, backend
        self.start = start or (None, None)
        self.mechanical = isinstance(problem, Mechanism)
        self.names: tuple[str, ...] = ("q", "v", "own lam", "lam") if self.mechanical else ("y", "own z", "z")
        self._finest_samples: dict[str, tuple[Array, ...]] = {}  # by method
        self.failures: dict[str, str] = {}  # by method, the reason of the last incomplete run
        self.system = problem.system()

    def run(self, method: Method, n: int) -> Solution | None:
        """Return a run of a method with n steps; None if it does not finish, see `ended`."""
        self.progress(f"{method.name}, {n} steps")
        sol = solve(self.problem, (0.0, self.T), *self.start, method=method, step=self.T / n, backend=self.backend)
        return self.completed(method, sol)

    def completed(self, method: Method, sol: Solution) -> Solution | None:
        """Return a completed run; None for an incomplete one, whose reason is stored."""
        if ended(sol) is None:
            self.failures[method.name] = sol.message
            return None
        return sol

    def sample(self, sol: Solution, stride: int = 1) -> tuple[Array, ...]:
        """Return the quantities at each of the common times, or every ``stride``-th, one row each; q as points."""
        at = self.common_nodes(sol, stride)
        hidden = np.array([sol.at(int(i)).derivative(sol.t[i], sol.y[i], sol.z_own[i])[1] for i in at])
        own = sol.z_own[at]
        if self.mechanical:
            return sol.q[at], sol.v[at], own, hidden
        return sol.y[at], own, hidden

    def common_nodes(self, sol: Solution, stride: int = 1) -> Array:
        """Return the nodes at the common times, or every ``stride``-th; after a jump, if there is one."""
        times = np.arange(stride, self.steps + 1, stride) * self.T / self.steps
        return np.searchsorted(sol.t, times * (1 + SOLUTION_ROUNDING), side="right") - 1

    def difference(self, a: tuple[Array, ...], b: tuple[Array, ...]) -> Array:
        """Return the largest difference of each quantity over the common times."""
        out = [float(np.abs(x - y).max(initial=0.0)) for x, y in zip(a, b, strict=True)]
        if isinstance(self.problem, Mechanism):
            manifold = self.problem.manifold
            out[0] = max(float(np.abs(manifold.difference(y, x)).max()) for x, y in zip(a[0], b[0], strict=True))
        return np.array(out)

    def reference(self, name: str) -> tuple[tuple[Array, ...], Array]:
        """Return samples of the reference for a method, and the uncertainty of each quantity."""
        exact = None if isinstance(self.problem, Mechanism) else self.problem.exact
        if exact is not None:
            values = [exact(t) for t in np.arange(1, self.steps + 1) * self.T / self.steps]
            y, z = np.array([v[0] for v in values]), np.array([v[1] for v in values])
            return (y, z, z), np.zeros(3)
        known, two = self._finest_samples, [r for r in ("pherk6", "herk5", "hedop5") if r != name][:2]
        for reference in two:
            if reference not in known:
                known[reference] = self._finest(find_method(reference))
        best, other = (self.error_reference(known[reference]) for reference in two)
        return best, self.difference(best, other)

    def error_reference(self, best: tuple[Array, ...]) -> tuple[Array, ...]:
        """Return the quantities to which errors refer: for the method's multipliers, those of the hidden constraint."""
        return *best[:-2], best[-1], best[-1]

    def _finest(self, method: Method) -> tuple[Array, ...]:
        """Refine until the differences of successive runs no longer decrease because of rounding."""
        if (coarse := self._samples_at_rounding(method)) is not None:
            return coarse
        n, last, last_difference = 16 * self.steps, None, np.inf
        while n * method.solves <= self.max_solves // 2:
            sol = self.run(method, n)
            if sol is not None:
                current = self.sample(sol)
                if last is not None:
                    change = float(self.difference(current, last)[0])
                    if change >= 0.5 * last_difference or change == 0:
                        return last
                    last_difference = change
                last = current
            n *= 2
        if last is None:
            raise InputError(
                f"no reference for {self.problem.title!r}: {method.name} fails at every step size up to T = {self.T}, "
                f"{self.failures.get(method.name, 'with too many solves')}"
            )
        return last

    def _samples_at_rounding(self, method: Method) -> tuple[Array, ...] | None:
        """Return samples of a run with few steps if doubling them changes these only by rounding, else None."""
        coarse, fine = (self.run(method, n) for n in (self.steps, 2 * self.steps))
        if coarse is None or fine is None:
            return None
        samples = self.sample(fine)
        sizes = np.array([float(np.abs(x).max(initial=0.0)) for x in samples])
        change = self.difference(self.sample(coarse), samples) > self.rounding(method, self.T / self.steps, sizes)
        state = [not name.startswith("own") for name in self.names]  # own multipliers converge with another order
        return None if change[state].any() else samples

    def floors(self, tableau: Method, n: int, reference: tuple[Array, ...], uncertainty: Array) -> Array:
        """Return 100 (uncertainty + rounding), one for each quantity."""
        sizes = np.array([float(np.abs(x).max(initial=0.0)) for x in reference])
        return FLOOR_RATIO * (uncertainty + self.rounding(tableau, self.T / n, sizes))

    def rounding(self, tableau: Method, h: float, sizes: Array) -> Array:
        """Return the rounding error of each quantity, of these sizes, with steps of h."""
        rounding = EPS * (1 + sizes) * np.sqrt(1 + tableau.roundings * self.T / h)
        rate = sizes[1] if self.mechanical else sizes[0]
        position_rate = (1 + sizes[0]) / (h * tableau.position_pivot)
        rounding[-2] = EPS * (self.gain * (rate / tableau.smallest_pivot + position_rate) / h + sizes[-2])
        return rounding

    @cached_property
    def gain(self) -> float:
        """Change of lam per unit residual of the hidden constraint, at the start; used for all methods."""
        start = self.problem.point(*self.start)
        return self.system.multiplier_gain(0.0, start, self.system.derivative(0.0, start)[1])

    def claims(self, tableau: Method) -> tuple[list[int], int]:
        """Return the claimed order of each quantity, and the number judged: without closures there is no lam."""
        order = self.system.order_of(tableau)
        found = [order] * (len(self.names) - 2) + [tableau.order_own, order]
        return found, len(found) if self.system.nz else len(found) - 2

    def judge(self, tableau: Method) -> tuple[ObservedOrder, ...]:
        """Halve the steps until orders can be estimated, or halving does not help; then add intermediate steps."""
        reference, uncertainty = self.reference(tableau.name)
        samples, stride = self._halve_steps(tableau, reference, uncertainty), 1
        orders = self._observed_orders(tableau, samples, reference, uncertainty)
        while self.add_coarser_steps and self.steps % (2 * stride) == 0 and self.steps // (2 * stride) >= MIN_OUTPUTS:
            if all(count_above_floors(s.errors, s.floors) > REFINEMENTS for s in orders):
                break
            stride *= 2
            reference, *previous = (tuple(x[1::2] for x in found) for found in (reference, *samples.values()))
            samples = dict(zip(samples, previous, strict=True))
            samples = self._add_runs(tableau, [self.steps // stride], stride, samples)
            orders = self._observed_orders(tableau, samples, reference, uncertainty)
        for intervals in SUBDIVISIONS:
            useful = max((count_above_floors(s.errors, s.floors) for s in orders if not s.is_conclusive), default=0)
            found = self.intermediate_steps([*samples][:useful], intervals, self.steps // stride)
            ns = [n for n in found if n not in samples]
            samples = self._add_runs(tableau, ns, stride, samples)
            orders = self._observed_orders(tableau, samples, reference, uncertainty) if ns else orders
        return orders

    def _halve_steps(
        self, tableau: Method, reference: tuple[Array, ...], uncertainty: Array
    ) -> dict[int, tuple[Array, ...]]:
        """Halve the steps until rates agree or errors are below their floors; return samples by number of steps."""
        samples: dict[int, tuple[Array, ...]] = {}
        n = self.steps
        while n * tableau.solves <= self.max_solves:
            if n in (samples := self._add_runs(tableau, [n], 1, samples)):
                orders = self._observed_orders(tableau, samples, reference, uncertainty)
                if all(is_complete(s.steps, s.errors, s.floors) for s in orders):
                    break
            n *= 2
        return samples

    def _add_runs(
        self, tableau: Method, ns: list[int], stride: int, samples: dict[int, tuple[Array, ...]]
    ) -> dict[int, tuple[Array, ...]]:
        """Return samples with those of further runs, coarse steps first; failed and too long runs add none."""
        runs = {n: self.run(tableau, n) for n in ns if n * tableau.solves <= self.max_solves}
        new = {n: self.sample(sol, stride) for n, sol in runs.items() if sol is not None}
        return dict(sorted((samples | new).items()))

    def intermediate_steps(self, ns: list[int], intervals: int, outputs: int) -> list[int]:
        """Return numbers of steps between each of ns and its double, even multiples of the number of common times.

        Errors of own multipliers alternate from step to step where R(inf) = -1.
        """
        m, even = intervals, 2 * intervals * outputs
        new = [n + n * i // m for n in ns for i in range(1, m) if n * (m + i) % even == 0]
        return [n for n in new if n not in ns]

    def _observed_orders(
        self,
        tableau: Method,
        samples: dict[int, tuple[Array, ...]],
        reference: tuple[Array, ...],
        uncertainty: Array,
    ) -> tuple[ObservedOrder, ...]:
        """Return the observed order of each judged quantity, from samples by number of steps."""
        claims, number = self.claims(tableau)
        errors = [self.difference(x, reference) for x in samples.values()]
        floors = [self.floors(tableau, n, reference, uncertainty) for n in samples]
        changes = [float(np.ptp(x, axis=0).max(initial=0.0)) for x in reference]
        return tuple(
            fit(
                q,
                claims[i],
                [*samples],
                [e[i] for e in errors],
                [f[i] for f in floors],
                u,
                changes[i],
                self.max_solves,
                self.failures.get(tableau.name, ""),
            )
            for i, (q, u) in enumerate(zip(self.names[:number], uncertainty.tolist()[:number], strict=True))
        )


def run_until_interrupted(
    methods: Mapping[str, Method], study: Callable[[Method], Result]
) -> tuple[dict[str, Result], tuple[str, ...]]:
    """Study methods one after another; return the results by method, and the remaining methods after Ctrl-C.

    Raises:
        KeyboardInterrupt: if none is finished.
    """
    out: dict[str, Result] = {}
    try:
        for name, method in methods.items():
            out[name] = study(method)
    except KeyboardInterrupt:
        if not out:
            raise
    return out, tuple(name for name in methods if name not in out)


def ended(sol: Solution) -> Solution | None:
    """Return a completed run, else None.

    Raises:
        KeyboardInterrupt: if the user stopped the run.
    """
    return sol if uninterrupted(sol).ended else None
