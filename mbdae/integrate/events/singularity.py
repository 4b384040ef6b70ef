"""Monitor rank loss of the constraints: detect, cross by extrapolation, verify that the branch is kept."""

from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import StepError
from ...mechanism.formulations.index2 import Index2System
from ...system import Array
from ...tolerances import NEGLIGIBLE, VISIBLE
from .passages import MONITORED_RATIO, Passages
from .singularity_crossing import KNOWN, SingularityCrossing, cross_singularity
from .source import EventError

if TYPE_CHECKING:
    from ..run_state import RunState
    from ..step_map import StepMap
    from ..steppers.adaptive import Adaptive

SUSPICIOUS_RATIO = 0.6  # of the largest ratio so far: minima above are regular, since stages come close enough
SMALL, NOTCH = 0.1, 0.7  # of the largest ratio, of the larger neighbour: the fall to zero takes one or two steps
AHEAD = 20.0  # steps: a ratio that would take longer to vanish is small for other reasons
CROSSING_RATIO = 0.1  # of the largest ratio: below, a crossing is tried
NEXT = 0.5 * KNOWN  # approximately: below, the position of a singular configuration is uncertain
APPROACH = 0.5  # of the way to the singular configuration: the longest step
NEARER = 0.75  # of the way of the previous attempt: start of the next one
MET, PATIENCE = 0.5, 2  # of the last error: attempts without this reduction are limited by step errors
TRUSTED = 1e3  # times the tolerance: largest error that may be attributed to the steps
MOVED = 100.0  # times the tolerance: largest distance of the end of a crossing from the closures
SINGULAR_RATIO = NEGLIGIBLE  # of the ratio one step before: below, the configuration is singular
BACK = 0.02  # of the ratio at the start of an interval: largest change over a linear backward step


def _suspicious(before: Any, here: Any, after: Any, largest: Any) -> Any:
    """Return whether the ratio may vanish around a step: a minimum that is small or a notch."""
    lowest = (here < before) & (here <= after) & (here < SUSPICIOUS_RATIO * largest)
    return lowest & ((here < SMALL * largest) | (here < NOTCH * np.maximum(before, after)))


def _falls(before: Any, here: Any) -> Any:
    """Return whether the ratio, extrapolated from the last step, vanishes within `AHEAD` steps."""
    return AHEAD * (before - here) > here


class SingularityMonitor(Passages):
    """Monitors, step by step, how close the rows of the closures are to dependence.

    The indicator is the pivot ratio of the stage solves, at no cost. Where it becomes small, a run with step-size
    control closes its loops, approaches in steps that halve the distance, and crosses by `singularity_crossing`. Where
    it has a minimum between other steps, the smallest pivot is minimised on the dense output, and any singularity found
    is recorded.

    Branches that intersect in a singular configuration have different tangent spaces: afterwards the run must move in
    the previous one, up to its previous rate of rotation.

    Args:
        system: the run's workspace.
        kept: whether the method enforces positions of closures, by projection or a multiplier.
        control: step-size control of a run that may cross; None for others.
        closing: whether loops must be closed where the ratio is small; a multiplier does so by itself.
    """

    def __init__(self, system: Index2System, kept: bool, control: "Adaptive | None", closing: bool) -> None:
        super().__init__(system, kept, control is not None)
        self.control, self.closing, self.newest = control, closing, 1.0
        self._forget(0)

    @classmethod
    def of(cls, run: "RunState") -> "SingularityMonitor | None":
        if not isinstance(run.system, Index2System) or not run.system.ng:
            return None
        formulation = run.options.formulation
        return cls(run.system, run.project or formulation == "ggl", run.control, formulation == "index2")

    def results(self, run: "RunState") -> dict[str, Any]:
        return {"singular": self.found}

    def restart(self, run: "RunState", switched: bool) -> None:
        """Discard the history where forces jump; in another mode, reject fixed steps next to a singular configuration.

        The result of steps that begin there is rounding.

        Raises:
            StepError: with the time.
        """
        self._forget(len(run.ts) - 1)
        t = run.t
        if switched and self.control is None and self.next_to(t, run.ys[-1]):
            raise StepError("rank", f"no step of fixed size begins next to a singular configuration, at t = {t:.17g}")

    def _forget(self, first: int) -> None:
        self.entered: int | None = None  # the node at which steps came near a singular configuration
        self.tried, self.stalled = (np.inf, np.inf), 0  # way and error of the last rejected crossing
        self._begin(first)

    def _begin(self, first: int) -> None:
        """Restart the ratios of steps from node ``first``."""
        self.origin, self.ratios = first, [np.inf]

    def truncated(self, run: "RunState") -> None:
        """Discard singular configurations after the last node."""
        self.found = [x for x in self.found if (x.t - run.t) * run.sign <= 0]

    def begin_step(self) -> None:
        """Discard pivot ratios of solves outside the next step."""
        self.system.least_pivot_ratio = 1.0

    def reject_singular_step(self, t: float, y: Array) -> None:
        """Reject a fixed step that has a stage in a singular configuration, or ends there at (t, y).

        The result of such a stage is rounding, and no step can begin there.

        Raises:
            StepError: with the end time of the step.
        """
        nearest = min(float(np.sqrt(self.system.least_pivot_ratio)), self.ratios[-1])
        limit = SINGULAR_RATIO * min(self.largest, self.ratios[-1])
        if nearest < limit or (nearest < SUSPICIOUS_RATIO * self.largest and self._ratio(t, y) < limit):
            raise StepError("rank", f"a step leads into a singular configuration, until t = {t:.17g}")

    def next_to(self, t: float, y: Array) -> bool:
        """Return whether a point is closer to a singular configuration than its position is known."""
        return self._ratio(t, y) < NEXT * self.largest

    def limits(self) -> tuple[float, float, float, float, float, float]:
        """Return the largest ratio, the last one, the suspicious, singular and monitored ratios, and `AHEAD`."""
        return self.largest, self.ratios[-1], SUSPICIOUS_RATIO, SINGULAR_RATIO, MONITORED_RATIO, AHEAD

    def quiet(self, least_pivot_ratio: Array) -> int:
        """Skip regular steps, given their smallest pivot ratios; return how many."""
        new = np.sqrt(least_pivot_ratio)
        if self.entered is not None or not len(new):
            return 0
        largest = np.maximum(np.maximum.accumulate(new), self.largest)
        every = np.concatenate([[0.0], self.ratios[-2:], new])  # before the first step there is none to inspect
        earlier, before = every[-len(new) - 2 : -2], every[-len(new) - 1 : -1]
        loud = _suspicious(earlier, before, new, largest) | ((new < MONITORED_RATIO * largest) & _falls(before, new))
        n = int(loud.argmax()) if loud.any() else len(new)
        self.ratios += new[:n].tolist()
        self.largest = float(largest[n - 1]) if n else self.largest
        return n

    def note(self) -> None:
        """Record the pivot ratio of the step just taken: other solves may follow before it is inspected."""
        self.newest = float(np.sqrt(self.system.least_pivot_ratio))

    def first(self, step: "StepMap") -> None:
        """Inspect a step, unless that was done; close the loops near a singular configuration."""
        run = step.run
        if self.origin + len(self.ratios) < len(run.ts) and self.inspect(run, run.time_left() == 0, step.ends):
            run.close()

    def inspect(self, run: "RunState", last: bool, ends: bool = False) -> bool:
        """Inspect the step before the one just taken, and this one if it is the last; return whether to close loops.

        Args:
            run: the run.
            last: whether the span ends here.
            ends: whether its mode ends here.

        Raises:
            EventError: for a singular configuration that the run cannot cross, or crossed onto another branch.
        """
        self.ratios.append(self.newest)
        self.largest = max(self.largest, self.ratios[-1])
        self._inspect_step(run, len(self.ratios) - 2)
        if last:
            self._inspect_end(run)
        near = self._is_near(run)
        if near and self.entered is None:
            self.entered = len(run.ts) - 2
        if self.entered is not None and (last or not near):
            self._leave(run)
        return bool(near and self.control and self.closing and not ends)

    def _inspect_end(self, run: "RunState") -> None:
        """Inspect the last step; reject one that ends in a singular configuration."""
        near = self.ratios[-1] < SUSPICIOUS_RATIO * self.largest
        if near and self._ratio(run.ts[-1], run.ys[-1]) < VISIBLE * self.largest:
            text = f"at t = {run.ts[-1]:.17g} the run ends in a singular configuration, where rounding decides"
            text = f"{text} velocities and multipliers: the step before is the last"
            raise EventError("rank", text, len(run.ts) - 2)
        self.ratios.append(np.inf)
        self._inspect_step(run, len(self.ratios) - 2)

    def _is_near(self, run: "RunState") -> bool:
        """Return whether the ratio at the last node is small, and falls to zero soon or did so before."""
        before, here = self.ratios[-2:]
        falls = _falls(before, here) or (self.entered is not None and here >= before)
        if not (here < MONITORED_RATIO * self.largest and falls):
            return False
        return self._ratio(run.ts[-1], run.ys[-1]) < MONITORED_RATIO * self.largest

    def end(self, run: "RunState") -> None:
        """Inspect the last step before an impact or a jump.

        Raises:
            EventError: as in `inspect`.
        """
        self.ratios.append(np.inf)
        self._inspect_step(run, len(self.ratios) - 2)
        if self.entered is not None:
            self._leave(run)

    def _leave(self, run: "RunState") -> None:
        """Continue regularly, on the branch of the node at which steps came near a singular configuration."""
        self.compare(run, self.entered or 0, len(run.ts) - 1)
        self.entered, self.tried, self.stalled = None, (np.inf, np.inf), 0
        if self.control:
            self.control.cap = np.inf

    def replace_step(self, run: "RunState") -> bool:
        """If a singular configuration is near, shorten the next step, or cross it, and then return True."""
        begins = len(run.ts) - 1 == self.origin
        if self.control is None or (self.entered is None and not begins):
            return False
        self.control.cap = np.inf
        here, way = self._ahead(run, begins)
        if not np.isfinite(way):
            return False
        if self.entered is None:
            self.entered = self.origin
        self.control.cap = APPROACH * way
        if here > CROSSING_RATIO * self.largest or way > NEARER * self.tried[0]:
            return False
        found = self._attempt(run, way)
        if found is None:
            return False
        self.found.append(found.passed)
        self.path = found.path
        run.append_node(found.t, found.y, found.t == run.t1)
        self.control.cap, self.control.h = np.inf, APPROACH * way
        self.tried, self.stalled = (np.inf, np.inf), 0
        self._begin(len(run.ts) - 1)
        if self._ratio(found.t, found.y) >= (MONITORED_RATIO if run.time_left() else SINGULAR_RATIO) * self.largest:
            self.compare(run, self.entered, len(run.ts) - 1)
            self.entered = None
        return True

    def _attempt(self, run: "RunState", way: float) -> SingularityCrossing | None:
        """Return the crossing of a singular configuration about ``way`` seconds ahead, if it is accurate."""
        assert self.control
        found = None
        with suppress(StepError):
            found = cross_singularity(self.workspace, run, way, self.origin)
        if found is None:
            self.tried = way, np.inf
            return None
        error, move = (self.control.measure(run, found.y, x) for x in (found.error, found.move))
        self.stalled = self.stalled + 1 if error >= MET * self.tried[1] else 0
        accurate = error <= 1 or (self.stalled >= PATIENCE and error <= TRUSTED)
        if not accurate or move > MOVED * max(1.0, error):
            self.tried = way, error
            return None
        return found

    def _ahead(self, run: "RunState", begins: bool) -> tuple[float, float]:
        """Return the ratio at the last node, and its extrapolated time to zero; inf if it does not fall.

        At the start of a smooth interval, the ratio slightly before, by its initial velocity, replaces the previous
        step.
        """
        here = self._ratio(run.t, run.ys[-1])
        if not begins:
            dt, before = abs(run.t - run.ts[-2]), self._ratio(run.ts[-2], run.ys[-2])
        else:
            dt, before = float((self.control and self.control.h) or 0.0), np.inf
            if not (dt and here < MONITORED_RATIO * self.largest):
                return here, np.inf
            while abs(before - here) > BACK * here:
                dt /= 2
                before = self._ratio(run.t - run.sign * dt, run.system.add(run.ys[-1], -run.sign * dt * run.F))
        return here, here * dt / (before - here) if here < before else np.inf

    def beside(self, t: float, y: Array) -> bool:
        """Return whether a point is next to a singular configuration, where the end of a step is unreliable."""
        return self._ratio(t, y) < CROSSING_RATIO * self.largest

    def along(self, h: float, theta: float) -> Array:
        """Return the point after a share of the last crossing of size h."""
        return self.path(theta * h)

    def _inspect_step(self, run: "RunState", k: int) -> None:
        """Inspect step k, counted from 1, whose ratio has index k."""
        before, here, after = self.ratios[max(0, k - 1) : k + 2] if k else (0.0, 1.0, 0.0)
        if not _suspicious(before, here, after, self.largest):
            return
        nodes = range(max(0, k - 2), min(k + 2, len(run.ts) - self.origin))
        self.search(run, [self.origin + i for i in nodes])
