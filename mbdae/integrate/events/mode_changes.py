"""Source of mode changes: guards are tracked from step to step, and the mode changes where a guard crosses zero."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ...data_types import JsonObject
from ...errors import InputError, StepError
from ...mechanism.closures.independent_rows import AMBIGUOUS_AFTER_START
from ...mechanism.formulations.friction_interface import smallest_slip
from ...mechanism.formulations.index2 import Index2System
from ...mechanism.hybrid.active_set import select_mode
from ...mechanism.hybrid.impact import Impact, resolve_impact
from ...mechanism.hybrid.kinds.unilateral import closed_contacts, penetration_message
from ...mechanism.hybrid.mode_point import AllRows, ModePoint
from ...mechanism.hybrid.switch import Guard
from ...mechanism.hybrid.switches import describe_mode, unswitched_rows
from ...system import Array
from .chattering import Chattering
from .core_modes import CoreTransition, core_switches
from .guard_location import TrackedGuard, first_guard_root
from .multiplier_resolution import (
    QUARTERS,
    SAFETY,
    SHRINK,
    PointAt,
    interpolated_points,
    multipliers_after_short_step,
    resolution_error,
    resolving_samples,
    shortest_step,
)
from .singularity_crossing import POSITION_ACCURACY
from .source import EventError, EventSource, Occurrence

if TYPE_CHECKING:
    from ...mechanism.hybrid.switches import Mode
    from ..run.run_state import RunState
    from ..run.step_map import StepMap


class ModeChanges(EventSource):
    """Monitor of the guards of a mode, and changes of the mode.

    Args:
        system: workspace of the run, for a mechanism with switches.
        rtol: relative tolerance of its steps, 0 for fixed steps.

    Attributes:
        modes: the modes, each with its first node.
        impacts: the impacts of the run.
        core_switches: core data of the switches; None if the core does not support all of them.
        checked_in_core: whether the core has checked the last steps.
    """

    def __init__(self, system: Index2System, rtol: float) -> None:
        self.system, self.all_rows = system, AllRows(system)
        system.set_min_slip_speed(smallest_slip(system.mechanism, rtol))
        self.switches = system.mechanism.switches
        self.unswitched = unswitched_rows(self.switches, system.ng)
        self.modes: list[tuple[int, Mode]] = []
        self.impacts: list[Impact] = []
        self.impacts_in_core = self.transitions_in_core = 0
        self.core_switches = core_switches(system)
        self.fired: list[Guard] = []  # guards that are zero at the end of the last step
        self.resting: set[int] = set()  # contacts that close at the start of a step, after an unresolvably short flight
        # end of the last step, and points of the step by theta
        self.point_cache: tuple[Array | None, dict[float, ModePoint]] = (None, {})
        self.last_impact: dict[int, float] = {}  # time of the last impact of each switch
        self.chattering = Chattering(self.switches)
        self._set_mode(system.mode)

    @classmethod
    def from_run(cls, run: "RunState") -> "ModeChanges | None":
        if not run.mechanism_system or not (switches := run.mechanism_system.mechanism.switches):
            return None
        name, formulation = switches[0].name, run.options.formulation
        if formulation != "index2":
            raise InputError(
                f"{name!r}: unilateral constraints and switches need formulation 'index2', got {formulation!r}"
            )
        if run.sign < 0:
            raise InputError(f"{name!r}: a run with modes cannot go backward in time: impacts are irreversible")
        return cls(run.mechanism_system, 0.0 if run.options.step else run.options.rtol)

    def _point(self, t: float, y: Array) -> ModePoint:
        return ModePoint(self.system, self.all_rows, t, y)

    def _set_mode(self, mode: "Mode", run: "RunState | None" = None) -> None:
        self.system.enter(mode)
        for signal in run.user_events.signals.values() if run else ():
            signal.system.enter(mode)
        self.guards: list[TrackedGuard] = []
        self.checked_in_core = False

    @property
    def each_step(self) -> bool:  # type: ignore[override]
        """Whether every step must be checked in Python, since the core does not support all switches."""
        return self.core_switches is None

    def is_idle(self, run: "RunState", t1: float) -> bool:
        return False

    def begin_interval(self, run: "RunState") -> None:
        """Track the guards of the mode, if the mode is new."""
        if len(run.ts) == 1 or not self.guards:
            self._track(run.t, run.ys[-1])

    def _track(self, t: float, y: Array, tracked: Callable[[Guard, ModePoint], TrackedGuard] = TrackedGuard) -> None:
        point, mode, self.system.ambiguous_pivot = self._point(t, y), self.system.mode, AMBIGUOUS_AFTER_START
        self.guards = [tracked(g, point) for s in self.switches for g in s.guards(mode[s.index])]

    def adjust_point(self, run: "RunState", y: Array) -> Array:
        """Select the mode of a smooth interval, and return the point at which the interval begins.

        At the start this is the first mode. After a jump of commands or applied forces, the mode changes only if a
        guard is negative. If a closed contact has an approach velocity, an impact precedes the new mode.

        Raises:
            InputError: if a gap is negative at the start.
            StepError: if an impact has no solution.
        """
        if self.modes:
            return self._after_jump(run, y)
        point = self._point(run.t, y)
        if contact := penetration_message(point):
            raise InputError(f"{contact} at the start")
        y, mode = self._resolve_mode(run, point, set())
        self.modes = [(0, mode)]
        self._set_mode(mode, run)
        return y

    def resume(self, run: "RunState", mode: "Mode") -> None:
        """Enter the mode of a snapshot; `begin_interval` tracks its guards."""
        self.modes = [(0, mode)]
        self._set_mode(mode, run)

    def _resolve_mode(self, run: "RunState", point: ModePoint, separating: set[int]) -> tuple[Array, "Mode"]:
        recent = {i for i, when in self.last_impact.items() if abs(point.t - when) < self.switches[i].rest}
        y, impact = resolve_impact(point, self.unswitched, recent, self.resting)
        self.resting = set()
        if impact:
            self.impacts.append(impact)
            self.last_impact |= {s.index: point.t for s in self.switches if s.name in impact.where}
        point = self._point(point.t, y)
        return y, select_mode(point, self.unswitched, separating, multipliers_after_short_step(run, point))

    def first_event(self, step: "StepMap") -> Occurrence | None:
        """Return the end of the mode in a step, where the first guards cross zero."""
        if self.checked_in_core:
            self.checked_in_core = False
            return None
        try:
            theta, self.fired = self._first_root(step)
        except StepError as e:  # a guard cannot be evaluated: the run ends before this step
            raise EventError(e.status, str(e), step.node) from e
        if not self.fired:
            return None
        if theta >= 1:
            return Occurrence(step.t1)
        t = step.t + theta * step.h
        self.resting = {g.switch for g in self.fired if g.kind == "contact" and t == step.t}
        return Occurrence(t, step.end(theta) if t != step.t else None)

    def _first_root(self, step: "StepMap") -> tuple[float, list[Guard]]:
        """Return theta at which the mode ends, and the guards that are zero there; (2, []) if it does not end."""
        at, stepper = self._points(step), step.run.stepper
        h = 0.0 if stepper.controls else abs(step.h)
        if ended := [g.guard for g in self.guards if g.guard.ends and g.guard.ends(at(0.0), h)]:
            return 0.0, ended
        interpolated = interpolated_points(step, at)
        thetas = resolving_samples(self.guards, interpolated, h) if h and stepper.any_size else QUARTERS
        theta, fired = first_guard_root(self.guards, step, at, thetas)
        if not fired:
            for guard in self.guards:
                guard.advance(at(1.0))
        return theta, fired

    def rejects(self, step: "StepMap") -> bool:
        """Return whether a step is too long to resolve multipliers of sticking or closed rows; limit the next step."""
        run = step.run
        if self.checked_in_core or not run.stepper.controls or not run.stepper.any_size:
            return False
        h, shortest = abs(step.h), shortest_step(run)
        worst = resolution_error(self.guards, interpolated_points(step, self._points(step)), QUARTERS, h)
        if worst > 0:
            run.stepper.limit_step(max(shortest, h * max(SHRINK, SAFETY * worst**-0.25)))
        return worst > 1 and h > 2 * shortest

    def _points(self, step: "StepMap") -> "PointAt":
        """Return a function of theta that returns the point of a step there; points are cached."""
        if self.point_cache[0] is not step.y1:
            self.point_cache = step.y1, {}
        cache = self.point_cache[1]

        def at(theta: float) -> ModePoint:
            if theta not in cache:
                y = step.y if not theta else step.y1 if theta == 1 else step.point(theta)
                cache[theta] = self._point(step.t + theta * step.h, y)
            return cache[theta]

        return at

    def _after_jump(self, run: "RunState", y: Array) -> Array:
        """Return the point in the mode after a jump; the node of the jump is the first node of that mode."""
        point = self._point(run.t, y)
        fired = [g.guard for g in self.guards if g.value(point) < -g.rounding]
        if not fired:
            return y
        self._check_chattering(run, fired)
        y, mode = self._enter_next_mode(run, point, _separating(fired))
        self.modes.append((len(run.ts) - 1, mode))
        return y

    def _enter_next_mode(self, run: "RunState", point: ModePoint, separating: set[int]) -> tuple[Array, "Mode"]:
        """Resolve impacts at a point, and enter the next mode; return the point after them, and that mode."""
        y, mode = self._resolve_mode(run, point, separating)
        self._set_mode(mode, run)
        return self.system.project_state(run.t, y) if run.project else y, mode

    def _check_chattering(self, run: "RunState", fired: list[Guard]) -> None:
        self.chattering.check(len(run.ts) - 1, run.t, (g.name for g in fired), self.system.mode)

    def handle_event(self, run: "RunState", ended: bool) -> bool:
        """Continue in the next mode with a second node at the same time, unless the run ends at this node.

        Raises:
            StepError: in case of chattering, or if an impact has no solution.
        """
        if run.time_left() > 0:
            self._check_chattering(run, self.fired)
            run.end_interval(len(run.ts) - 1)
            self.continue_from(run, self._point(run.t, run.ys[-1]), _separating(self.fired))
        return False

    def continue_from(
        self, run: "RunState", point: ModePoint, separating: set[int], with_work: Callable[[Array], Array] = np.asarray
    ) -> None:
        """Continue after impacts at a point, with a second node of the run at the same time.

        Args:
            run: the run.
            point: the point.
            separating: indices of the switches whose contacts separate.
            with_work: returns y with its work component updated.
        """
        y, mode = self._enter_next_mode(run, point, separating)
        self.modes.append((len(run.ts), mode))
        run.switch_mode(with_work(y))
        self._track(run.t, run.ys[-1])

    def adopt_transition(self, node: int, t: float, transition: CoreTransition) -> None:
        """Record a transition that the core made before a node; of several, only the last mode is entered afterwards.

        Raises:
            EventError: in case of chattering.
        """
        self.chattering.check(node - 1, t, (self.switches[i].name for i in transition.fired), self.system.mode)
        self.transitions_in_core += 1
        if impact := transition.impact(t, self.system.mechanism):
            self.impacts.append(impact)
            self.impacts_in_core += 1
            self.last_impact |= dict.fromkeys(transition.contacts, t)
        self.modes.append((node, tuple(transition.mode)))

    def adopt_guards(self, t: float, y: Array) -> None:
        """Create the guards of the mode at a point; the core provides their state."""
        self._track(t, y, TrackedGuard.without_state)

    def explain(self, run: "RunState", reason: StepError) -> StepError:
        """Add the time and the mode in which a run stopped, or the contact that closed at a singular configuration."""
        return StepError(reason.status, self._explained(run, reason))

    def _explained(self, run: "RunState", reason: StepError) -> str:
        last = run.ts[-1], run.ys[-1]
        if (
            run.singularity_monitor
            and run.singularity_monitor.is_adjacent(*last)
            and (contacts := closed_contacts(self._point(*last), POSITION_ACCURACY))
        ):
            names = " and ".join(map(repr, contacts)) + (" closes" if len(contacts) == 1 else " close")
            where = f"within {POSITION_ACCURACY:g} rad or characteristic lengths of a singular configuration"
            return f"{names} {where}, whose position is not known more precisely: their order is unknown ({reason})"
        when = "" if "t = " in str(reason) else f", at t = {run.t:.17g}"
        mode = describe_mode(self.switches, self.system.mode)
        return f"{reason}{when} ({mode})" if reason.status in ("step_size", "singular") else f"{reason}{when}"

    def results(self, run: "RunState") -> dict[str, Any]:
        return {"modes": [(i, mode) for i, mode in self.modes if i < len(run.ts)], "impacts": self.impacts}

    def statistics(self, run: "RunState") -> JsonObject:
        out: JsonObject = {"transitions": len(self.modes) - 1, "impacts": len(self.impacts)}
        in_core: JsonObject = {"impacts_in_core": self.impacts_in_core, "transitions_in_core": self.transitions_in_core}
        return out | in_core if run.stepper.backend == "native" else out


def _separating(fired: list[Guard]) -> set[int]:
    """Return the switches whose contacts separate."""
    return {g.switch for g in fired if g.kind == "separation"}
