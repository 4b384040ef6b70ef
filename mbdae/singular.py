"""A run's watch for singular configurations between its steps."""

from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

import numpy as np
from scipy.optimize import minimize_scalar

from .errors import StepError
from .mechanism import Compiled
from .mechanism.descriptor import Descriptor
from .mechanism.singular import Singular, ratio, singular
from .rows import Rows
from .solution import Solution
from .system import Array

SUSPECT = 0.6  # of the largest ratio so far: minima above are no singular configurations, stages come near enough
SMALL, NOTCH = 0.1, 0.7  # of the largest ratio, of the larger neighbour: it falls to zero linearly, over a step or two
LOW = 0.02  # likewise: steps below are near a singular configuration
JUMP, STEEPEST = 0.1, 3.0  # of |v|, and of |v'| at both ends: what v may change by there
OVERDUE = 3.0  # times the way in: who is not out by then has turned
CLOSED = 1e-12  # m or rad: loops open by less, and branches apart by its root, are as good as kept closed
SAMPLES = 5  # of each step
SHARP = 1e-10  # of a step: how sharply a minimum is found
ENDED = 1e-6  # of the largest ratio: velocities at an end as near as that have lost six digits
LANDED = 1e-3  # of the ratio a step before: so near to a singular configuration is in it
SAME = 1e-6  # s: minima this near to each other are one


class Run(Protocol):
    """What the watch sees of a run."""

    system: Any
    ts: list[float]
    ys: Rows
    zs: Rows

    def record(self) -> Solution:
        """The run so far."""


def _suspicious(before: Any, here: Any, after: Any, largest: Any) -> Any:
    """Say whether the ratio may vanish around a step: where it is smallest, and small or at the bottom of a notch."""
    lowest = (here < before) & (here <= after) & (here < SUSPECT * largest)
    return lowest & ((here < SMALL * largest) | (here < NOTCH * np.maximum(before, after)))


class SingularWatch:
    """Follows how far the rows of the closures are from depending on each other, step by step.

    The solves of the stages tell: the ratio of their pivots, for nothing. Where it is smallest from step to step, the
    smallest pivot is minimised on the dense output, and the configuration found there is looked at.

    Branches that meet there have velocities of their own: a run that keeps positions passes when its velocity is the
    same before and after, as far as accelerations outside explain.

    Args:
        system: the run's workspace.
        kept: the method keeps positions of closures, by projection or a multiplier: a run can pass.
    """

    def __init__(self, system: Descriptor, kept: bool) -> None:
        self.system, self.kept = system, kept
        self._own: Descriptor | None = None
        self.found: list[Singular] = []
        self.restart(0)

    @property
    def own(self) -> Descriptor:
        """A workspace of the watch's own, made when there is something to look at: what it computes is not counted."""
        if self._own is None:
            native = self.system.native if isinstance(self.system, Compiled) else None
            self._own = self.system.mechanism.system(native=native)
        self._own.rank = self.system.rank
        return self._own

    def _ratio(self, t: float, y: Array) -> float:
        """See `mbdae.mechanism.singular.ratio`; the core does not count it."""
        return ratio(self.system if isinstance(self.system, Compiled) else self.own, t, y)

    def restart(self, first: int) -> None:
        """Steps begin anew at node ``first``, behind a jump."""
        self.first, self.ratios, self.largest = first, [np.inf], 0.0
        self.entered: int | None = None  # the node where steps came near a singular configuration

    def begin_step(self) -> None:
        """Forget what solves outside of the next step tell; the rank is that of the run."""
        self.system.weakest = 1.0

    def refuse_landing(self, t: float, y: Array) -> None:
        """Refuse a step that has a stage in a singular configuration, or ends there at (t, y).

        Rounding says where such a stage leads, and no step can begin there.

        Raises:
            StepError: with the time where the step ends.
        """
        nearest = float(np.sqrt(self.system.weakest))
        limit = LANDED * min(self.largest, self.ratios[-1])
        if nearest < limit or (nearest < SUSPECT * self.largest and self._ratio(t, y) < limit):
            raise StepError("rank", f"a step leads into a singular configuration, until t = {t:.17g}")

    def limits(self) -> tuple[float, float, float, float]:
        """Return the largest ratio and the last one, and `SUSPECT` and `LANDED`: see `refuse_landing`."""
        return self.largest, self.ratios[-1], SUSPECT, LANDED

    def quiet(self, weakest: Array) -> int:
        """Pass over steps with nothing to look at, given their smallest ratios of pivots; return how many."""
        new = np.sqrt(weakest)
        if self.entered is not None or not len(new):
            return 0
        largest = np.maximum(np.maximum.accumulate(new), self.largest)
        every = np.concatenate([[0.0], self.ratios[-2:], new])  # before the first step there is none to look at
        loud = _suspicious(every[-len(new) - 2 : -2], every[-len(new) - 1 : -1], new, largest) | (new < LOW * largest)
        n = int(loud.argmax()) if loud.any() else len(new)
        self.ratios += new[:n].tolist()
        self.largest = float(largest[n - 1]) if n else self.largest
        return n

    def step(self, run: Run, last: bool) -> None:
        """Look back at the step before the one just taken, and at this one if it is the last.

        Raises:
            StepError: for a singular configuration that the run cannot pass, or passed onto another branch; nodes
                behind it are taken off.
        """
        self.ratios.append(float(np.sqrt(self.system.weakest)))
        self.largest = max(self.largest, self.ratios[-1])
        self._look(run, len(self.ratios) - 2)
        if last:
            if self._ratio(run.ts[-1], run.ys[-1]) < ENDED * self.largest:
                text = f"at t = {run.ts[-1]:.17g} the run ends in a singular configuration, where rounding decides"
                self._end(run, len(run.ts) - 2, f"{text} velocities and multipliers: the step before is the last")
            self.ratios.append(np.inf)
            self._look(run, len(self.ratios) - 2)
        near = self.ratios[-1] < LOW * self.largest
        if near and self.entered is None:
            self.entered = len(run.ts) - 2
        elif self.entered is not None:
            self._leave(run, self.entered, near)

    def _leave(self, run: Run, a: int, near: bool) -> None:
        """Compare velocities when steps lead away from a singular configuration, or stay near it for too long."""
        b = len(run.ts) - (1 if near else 2)
        start, way = run.ts[a], run.ts[b] - run.ts[a]
        passed = next((x for x in self.found if (x.t - start) * way > 0), None)
        if passed and not (near and abs(way) <= (1 + OVERDUE) * abs(passed.t - start)):
            self._compare(run, passed, a, b, near)
            self.entered = None
        elif not near:
            self.entered = None

    def _compare(self, run: Run, passed: Singular, a: int, b: int, near: bool) -> None:
        """Compare velocities at nodes a and b, before and after a singular configuration; near: b is so, too."""
        v = [self.own.split(run.ys[i])[1] for i in (a, b)]
        slopes = [self._acceleration(run.ts[i], run.ys[i]) for i in ((a,) if near else (a, b))]
        steepest = STEEPEST * max(np.linalg.norm(x) for x in slopes) * abs(run.ts[b] - run.ts[a])
        jump, size = np.linalg.norm(v[1] - v[0]), max(np.linalg.norm(x) for x in v)
        if jump > JUMP * size + steepest:
            text = f"{passed}: there the run went over to another branch, its velocity changed by {jump:.2g}"
            self._end(run, a, f"{text}; take a larger rtol, or an explicit method")

    def _acceleration(self, t: float, y: Array) -> Array:
        return self.own.derivative(t, y)[0][self.own.nv : 2 * self.own.nv]

    def _end(self, run: Run, i: int, message: str) -> None:
        del run.ts[i + 1 :], run.ys[i + 1 :], run.zs[i + 1 :]
        raise StepError("rank", message)

    def _look(self, run: Run, k: int) -> None:
        """Look around step k, counted from 1, whose ratio is in place k."""
        before, here, after = self.ratios[max(0, k - 1) : k + 2] if k else (0.0, 1.0, 0.0)
        if not _suspicious(before, here, after, self.largest):
            return
        nodes = range(max(0, k - 2), min(k + 2, len(run.ts) - self.first))
        self._search(run, [self.first + i for i in nodes])

    def _search(self, run: Run, nodes: list[int]) -> None:
        """Minimise over u, node i and the share of the step behind it that has passed."""
        paths = {i: self._path(run, i) for i in nodes[:-1]}

        def at(u: float) -> tuple[float, Array]:
            i = min(int(u), nodes[-2])
            return paths[i](u - i)

        samples = np.linspace(nodes[0], nodes[-1], SAMPLES * len(paths) + 1)
        padded = np.array([np.inf, *(ratio(self.own, *at(u)) for u in samples), np.inf])
        lowest = np.flatnonzero((padded[1:-1] < padded[:-2]) & (padded[1:-1] <= padded[2:]))
        for k in lowest.tolist():
            bounds = float(samples[max(0, k - 1)]), float(samples[min(k + 1, len(samples) - 1)])
            best = minimize_scalar(
                lambda u: ratio(self.own, *at(u)), bounds=bounds, method="bounded", options={"xatol": SHARP}
            )
            self._judge(run, nodes, int(best.x), *at(float(best.x)))

    def _judge(self, run: Run, nodes: list[int], i: int, t: float, y: Array) -> None:
        """Keep what was found on step i, and end the run there if it cannot pass."""
        gap = max(np.abs(self.own.residual(run.ts[n], *self.own.split(run.ys[n]))[0]).max() for n in nodes)
        found = singular(self.own, t, y, (run.ts[nodes[0]], run.ys[nodes[0]]), self.largest, gap)
        if found is None or any(abs(found.t - other.t) <= SAME * (1 + abs(t)) for other in self.found):
            return
        self.found.append(found)
        if not self.kept and gap > CLOSED:
            text = f"{found}: a singular configuration, behind which loops that have drifted open by {gap:.1e}"
            self._end(run, i, f"{text} may be on another branch; keep them closed by project=True or formulation 'ggl'")

    def _path(self, run: Run, i: int) -> Callable[[float], tuple[float, Array]]:
        """Theta -> time and point on step i; straight where an end of it is too singular for dense output."""
        t, h, y = run.ts[i], run.ts[i + 1] - run.ts[i], run.ys[i]
        move = self.own.difference(y, run.ys[i + 1])
        try:
            dense = run.record().dense(i)
        except StepError:
            dense = partial(self._straight, y, move)
        return lambda theta: (t + theta * h, dense(theta))

    def _straight(self, y: Array, move: Array, theta: float) -> Array:
        return self.own.add(y, theta * move)
