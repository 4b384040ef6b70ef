"""Location of singular configurations between the nodes of a run, and a check that the run stays on its branch."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ...discovery import lazy_import
from ...errors import StepError
from ...mechanism.formulations.index2 import Index2System
from ...mechanism.formulations.steps.row_selection import SmallestPivot
from ...mechanism.hybrid.switches import Mode
from ...mechanism.singularity import (
    Singular,
    pivot_limit_with_violation,
    singular,
    tangent_space_angle,
    tangent_space_rate,
)
from ...system import Array
from ...tolerances import COARSE, SEARCH_TOLERANCE, SOLUTION_ROUNDING
from .singularity_crossing import POSITION_ACCURACY, ContinuationPolynomial
from .source import EventError, EventSource

if TYPE_CHECKING:
    from ..._native import SingularityMonitor as CoreMonitor
    from ..run.run_state import RunState

minimize_scalar = lazy_import("scipy.optimize", "minimize_scalar")
Ratio = TypeVar("Ratio", float, Array)  # pivot ratio of one node, or of several

SUSPICIOUS_RATIO = 0.6  # fraction of the largest ratio so far: larger minima are regular
SMALL, NOTCH = 0.1, 0.7  # fraction of the largest ratio, or of a neighbour: smaller minima may contain a zero
MAX_STEPS_AHEAD = 20.0  # steps: a ratio that would need more steps to vanish is small for another reason
MONITORED_RATIO = 0.2  # fraction of the largest pivot ratio: at smaller ratios states are projected
ADJACENT_RATIO = 0.5 * POSITION_ACCURACY  # fraction of the largest ratio: smaller ones count as singular
CROSSING_RATIO = 0.1  # fraction of the largest ratio: at smaller ratios, a crossing is attempted
MAX_ANGLE, ROTATION_FACTOR = 0.2, 3.0  # largest angle between tangent spaces: rad, plus a multiple of the rotation
NEAR_FRACTIONS = 1 / 2.0 ** np.arange(6, 0, -1)  # fractions of the interval from a singularity to a node
SAMPLES = 5  # samples of each step
CONSTANT_RATIO = 0.999  # fraction of the largest sample: larger ratios count as constant


def may_vanish(before: Ratio, current: Ratio, after: Ratio, largest: Ratio) -> Ratio:
    """Return whether the ratio may vanish around a step: it has a minimum that is small or much below a neighbour.

    A neighbour of inf is beyond an end of a smooth interval.
    """
    minimum = (current < before) & (current <= after) & (current < SUSPICIOUS_RATIO * largest)
    below = ((current < NOTCH * before) & (before < np.inf)) | ((current < NOTCH * after) & (after < np.inf))
    return minimum & ((current < SMALL * largest) | below)


def falls_to_zero(before: Ratio, current: Ratio) -> Ratio:
    """Return whether the ratio, extrapolated from the last step, vanishes in `MAX_STEPS_AHEAD` steps; not from inf."""
    return (MAX_STEPS_AHEAD * (before - current) > current) & (before < np.inf)


def largest_in_new_mode(before: SmallestPivot, current: SmallestPivot, largest: float) -> float:
    """Return the largest pivot ratio assumed in a mode that a run enters for the first time, at most 1.

    Ratios of different modes are not comparable: the row of a contact in G M^-1/2 is small at any position if its body
    is heavy. But if the ratio had fallen to h times its largest value in the previous mode, and the smallest pivot p
    is the same, this pivot is still about to vanish, and the result is ratio / h. If another pivot is the smallest, the
    ratio is regular. In between,

        r = ratio / sqrt(1 - (1 - h^2) s),    s = (p_smaller / p_larger)^2,

    from the squares 1 / p^2, which add up where rows are independent.

    Args:
        before: the smallest pivot at the end of the previous mode.
        current: the smallest pivot at the same point in the new mode.
        largest: largest ratio in the previous mode.
    """
    smaller, larger = sorted((before.size, current.size))
    share = (smaller / larger) ** 2 if smaller < larger else 1.0
    regularity = (before.ratio / largest) ** 2 if before.ratio < largest else 1.0
    scale = float(np.sqrt(1 - share * (1 - regularity)))
    return current.ratio / scale if current.ratio < scale else 1.0


class SingularityLocation(EventSource):
    """Location of the singular configurations that a run crosses.

    Args:
        system: workspace of the run.
        enforces_g: whether the method enforces g = 0 of closures, by projection or a multiplier.
        controlled: whether the step size is controlled.

    Attributes:
        configurations: singular configurations crossed so far.
        largest: largest pivot ratio so far.
        mode_ratio: largest pivot ratio in the mode so far.
        ratio_by_mode: largest pivot ratio of each mode at its last exit.
        path: the last crossing.
    """

    path: ContinuationPolynomial

    def __init__(self, system: Index2System, enforces_g: bool, controlled: bool) -> None:
        self.system, self.enforces_g, self.controlled = system, enforces_g, controlled
        self._workspace: Index2System | None = None
        self.configurations: list[Singular] = []
        self.largest = self.mode_ratio = 0.0
        self.ratio_by_mode: dict[Mode, float] = {}

    @property
    def workspace(self) -> Index2System:
        """Separate workspace, created on demand: its work is not counted."""
        if self._workspace is None:
            self._workspace = self.system.new_workspace()
        self._workspace.enter(self.system.mode)
        if self._workspace.in_use != self.system.in_use:
            self._workspace.use_rows(self.system.in_use)
        return self._workspace

    def results(self, run: "RunState") -> dict[str, Any]:
        return {"singular": self.configurations}

    def discard_beyond_end(self, run: "RunState") -> None:
        """Discard singular configurations after the last node."""
        self.configurations = [x for x in self.configurations if (x.t - run.t) * run.sign <= 0]

    def release(self) -> None:
        """See `EventSource`."""
        if self._workspace:
            self.system.mechanism.workspaces.release(self._workspace)

    def _ratio(self, t: float, y: Array) -> float:
        """See `Index2System.pivot_ratio`; 1 if no row is in use."""
        return self._smallest_pivot(t, y).ratio

    def _smallest_pivot(self, t: float, y: Array) -> SmallestPivot:
        return self.workspace.smallest_pivot(t, y) if self.workspace.in_use else SmallestPivot()

    def _update(self, ratio: float) -> None:
        self.largest, self.mode_ratio = max(self.largest, ratio), max(self.mode_ratio, ratio)

    def from_core(self, monitor: "CoreMonitor") -> None:
        """Adopt the largest ratios of modes from the core."""
        self.mode_ratio = monitor.mode_ratio
        self.ratio_by_mode = {tuple(x): ratio for x, ratio in monitor.ratio_by_mode}

    def _change_mode(self, run: "RunState", node: int) -> None:
        """Continue with the largest ratio of the mode that begins at a node, if the mode is different."""
        left, entered = (mode for _, mode in run.mode_changes.modes[-2:])
        if left == entered:
            return
        self.ratio_by_mode[left] = self.mode_ratio
        if entered in self.ratio_by_mode:
            self.mode_ratio = self.ratio_by_mode[entered]
            return
        current, w = self._smallest_pivot(run.ts[node], run.ys[node]), self.workspace
        w.enter(left)
        w.use_rows(run.rows_at(node - 1))
        before = w.smallest_pivot(run.ts[node - 1], run.ys[node - 1]) if w.in_use else SmallestPivot()
        self.mode_ratio = largest_in_new_mode(before, current, self.mode_ratio)

    def is_adjacent(self, t: float, y: Array) -> bool:
        """Return whether the distance to a singular configuration is below the accuracy of its position."""
        return self._ratio(t, y) < ADJACENT_RATIO * self.largest

    def is_close(self, t: float, y: Array) -> bool:
        """Return whether a singular configuration is so close that the end of a step is inaccurate."""
        return self._ratio(t, y) < CROSSING_RATIO * self.mode_ratio

    def check_branch(self, run: "RunState", a: int, b: int) -> None:
        """Compare tangent spaces at nodes a and b, before and after a singular configuration.

        Raises:
            EventError: if the run left its branch.
        """
        dt = run.ts[b] - run.ts[a]
        between = (x for x in self.configurations if (x.t - run.ts[a]) * dt > 0 and (run.ts[b] - x.t) * dt > 0)
        crossing = next(between, None)
        if not crossing:
            return
        before, after = (self._end_of_neighbourhood(run, crossing.t, i, range(a, b)) for i in (a, b))
        angle = tangent_space_angle(self.workspace, before, after)
        dt = after[0] - before[0]
        expected = ROTATION_FACTOR * abs(dt) * tangent_space_rate(self.workspace, *before, dt)
        if angle > MAX_ANGLE + expected:
            text = f"{crossing}: the run left its branch there, the tangent space changed by {angle:.2g} rad"
            raise EventError("rank", f"{text}; take a smaller rtol, or project=True", a)

    def _end_of_neighbourhood(self, run: "RunState", t: float, node: int, steps: range) -> tuple[float, Array]:
        """Return the point between a singular configuration and a node where the pivot ratio is no longer small.

        This is the node if the ratio remains small. The node of a long step may be so far away that tangent spaces
        rotate more than their rate before the singularity predicts.
        """
        dt = run.ts[node] - t
        for fraction in NEAR_FRACTIONS:
            i = next(i for i in steps if (run.ts[i + 1] - t - fraction * dt) * run.sign >= 0)
            point = self._path(run, i)((t + fraction * dt - run.ts[i]) / (run.ts[i + 1] - run.ts[i]))
            if self._ratio(*point) >= MONITORED_RATIO * self.largest:
                return point
        return run.ts[node], run.ys[node]

    def crossing_point(self, h: float, theta: float) -> Array:
        """Return the point at theta on the last crossing, of size h."""
        return self.path(theta * h)

    def search(self, run: "RunState", nodes: list[int]) -> None:
        """Minimize the pivot ratio over u = i + theta, the point at the fraction theta of the step from node i."""
        if len(nodes) < 2:  # an interval that has just begun
            return
        paths = {i: self._path(run, i) for i in nodes[:-1]}

        def at(u: float) -> tuple[float, Array]:
            i = min(int(u), nodes[-2])
            return paths[i](u - i)

        samples = np.linspace(nodes[0], nodes[-1], SAMPLES * len(paths) + 1)
        padded = np.array([np.inf, *(self._ratio(*at(u)) for u in samples), np.inf])
        if padded.min() > CONSTANT_RATIO * padded[1:-1].max():  # at rest
            return
        lowest = np.flatnonzero((padded[1:-1] < padded[:-2]) & (padded[1:-1] <= padded[2:]))
        for k in lowest.tolist():
            bounds = float(samples[max(0, k - 1)]), float(samples[min(k + 1, len(samples) - 1)])
            best = minimize_scalar(
                lambda u: self._ratio(*at(u)), bounds=bounds, method="bounded", options={"xatol": SEARCH_TOLERANCE}
            )
            self._record(run, nodes, int(best.x), *at(float(best.x)))

    def _record(self, run: "RunState", nodes: list[int], i: int, t: float, y: Array) -> None:
        """Record the singularity found on step i; the run ends if it cannot cross it or is on another branch.

        Raises:
            EventError: with the reason.
        """
        violation = max(self._max_violation(run.ts[n], run.ys[n]) for n in nodes)
        limit = pivot_limit_with_violation(self.workspace, t, y, self.largest, violation)
        singularity = singular(self.workspace, t, y, (run.ts[nodes[0]], run.ys[nodes[0]]), limit)
        tolerance = COARSE * abs(run.ts[nodes[-1]] - run.ts[nodes[0]])
        if singularity is None or any(abs(singularity.t - other.t) <= tolerance for other in self.configurations):
            return
        self.configurations.append(singularity)
        if not self.controlled and not self.enforces_g and violation > SOLUTION_ROUNDING:
            text = f"{singularity}: a singular configuration, after which a motion with a violation of {violation:.1e}"
            text = f"{text} may be on another branch; avoid drift-off by project=True or formulation 'ggl'"
            raise EventError("rank", text, i)
        self.check_branch(run, nodes[0], nodes[-1])

    def _max_violation(self, t: float, y: Array) -> float:
        """Return the largest |g|, in rad or characteristic lengths."""
        g = self.workspace.residual(t, *self.workspace.split(y))[0]
        return float(np.abs(g / self.workspace.mechanism.row_scales).max())

    def _path(self, run: "RunState", i: int) -> Callable[[float], tuple[float, Array]]:
        """Return theta -> (time, point) on step i; linear if an end is too close to singular for dense output."""
        t, h, y = run.ts[i], run.ts[i + 1] - run.ts[i], run.ys[i]
        displacement = self.workspace.difference(y, run.ys[i + 1])
        try:
            dense = run.partial_solution().dense(i)
        except StepError:
            dense = partial(self._straight, y, displacement)
        return lambda theta: (t + theta * h, dense(theta))

    def _straight(self, y: Array, displacement: Array, theta: float) -> Array:
        return self.workspace.add(y, theta * displacement)
