"""Events at which the state jumps (`mbdae.Reset`): located on steps of the method; the run continues from R(y)."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...data_types import JsonObject
from ...errors import InputError, StepError, UnknownNameError
from ...mechanism import Mechanism
from ...mechanism.formulations.index2 import Index2System
from ...mechanism.hybrid.kinds.unilateral import penetration_message
from ...mechanism.hybrid.mode_point import ModePoint
from ...mechanism.hybrid.reset import Reset, ResetMap
from ...solution.signal_value import find_point_signal
from ...system import Array
from ...tolerances import AGREEMENT, SOLUTION_ROUNDING
from .level_crossing import SignalEvent, parse_level_crossing
from .source import EventSource, Occurrence

if TYPE_CHECKING:
    from ..run.run_state import RunState
    from ..run.step_map import StepMap

MAX_RESETS = 100  # at one time


class Resets(EventSource):
    """Detection of events, and jumps of the state.

    Args:
        system: workspace of the run.

    Attributes:
        occurred: first node after each jump, and the name of its event.

    Raises:
        InputError: for an event whose reset function is missing.
    """

    each_step = True

    def __init__(self, system: Index2System) -> None:
        self.system, resets = system, system.mechanism.resets
        self.maps = [ResetMap(system, reset) for reset in resets]
        self.workspace = workspace = system.new_workspace()
        bound = partial(SignalEvent.from_text, workspace, system.mechanism, direction=0)
        self.signals = [bound(reset.signal) for reset in resets]
        self.conditions = [bound(reset.when) if reset.when else None for reset in resets]
        self.occurred: list[tuple[int, str]] = []
        self.times: list[float] = []
        self._event = 0  # index of the event of the last step
        self._missed = ""  # event that a terminal event prevented
        self._checked_until = np.nan  # nan after a jump

    @classmethod
    def from_run(cls, run: "RunState") -> "Resets | None":
        if not run.mechanism_system or not (resets := run.mechanism_system.mechanism.resets):
            return None
        name, formulation = resets[0].name, run.options.formulation
        if formulation == "index1":
            raise InputError(f"event {name!r}: states jump in formulations 'index2' and 'ggl', got {formulation!r}")
        if run.sign < 0:
            raise InputError(f"event {name!r}: a run whose state jumps cannot go backward in time")
        return cls(run.mechanism_system)

    def begin_interval(self, run: "RunState") -> None:
        """Start to track the signals."""
        if len(run.ts) == 1:
            self._checked_until = run.t
            for signal in self.signals:
                signal.start_at(run.t, run.ys[-1])

    def after_discontinuity(self, run: "RunState", node: int, mode_changed: bool) -> None:
        """Check for jumps of signals at the start of the next step."""
        if mode_changed:
            self._checked_until = np.nan

    def first_event(self, step: "StepMap") -> Occurrence | None:
        """Return the first event of a step whose condition holds."""
        if self.workspace.mode != self.system.mode:
            self.workspace.enter(self.system.mode)
        jumped = SOLUTION_ROUNDING if np.isnan(self._checked_until) else 0.0
        tangency = None if step.t == self._checked_until else jumped
        self._checked_until, hits = step.t1, list[tuple[float, int]]()
        for i, signal in enumerate(self.signals):
            crossings = signal.zeros(step, tangency)
            if step.ends and not crossings and signal.reaches(step):
                crossings = [(1.0, step.y1)]
            hits += [(theta, i) for theta, y in crossings if self._counts(i, step, theta, y)]
        if not hits:
            return None
        theta, self._event = min(hits)
        if theta >= 1:
            return Occurrence(step.t1)
        t = step.t + theta * step.h
        return Occurrence(t, step.end(theta) if t != step.t else None)

    def _counts(self, i: int, step: "StepMap", theta: float, y: Array) -> bool:
        """Return whether an event counts: it is not at the start of the run, and its condition holds."""
        condition, t = self.conditions[i], step.t + theta * step.h
        if step.first and theta * abs(step.h) <= AGREEMENT * max(1.0, abs(step.t)):
            return False
        return condition is None or condition.direction * condition.value(t, y) > 0

    def handle_event(self, run: "RunState", ended: bool) -> bool:
        """Apply the jump of the state, unless the run ends at this node, before the jump, as before an impact."""
        if ended and not run.continues:
            self._missed = self.maps[self._event].reset.name
            return False
        if run.time_left() <= 0:
            return False
        reset_map = self.maps[self._event]
        self.times = [*self.times[-MAX_RESETS:], run.t]
        if len(self.times) > MAX_RESETS and self.times[0] == run.t:
            raise StepError("switching", f"event {reset_map.reset.name!r} repeats without end at t = {run.t:.17g}")
        run.end_interval(len(run.ts) - 1)
        for i, signal in enumerate(self.signals):  # they were advanced to the end of the step before it was truncated
            after = signal.continue_after_crossing if i == self._event else signal.continue_after_other_event
            after(run.t, run.ys[-1])
        self.occurred.append((len(run.ts), reset_map.reset.name))
        y = run.ys[-1]
        if run.mode_changes is None:
            run.switch_mode(reset_map(run.t, y))
        else:
            self.system.enter((0,) * len(self.system.mode))  # the mode is selected as at a start
            point = ModePoint(self.system, run.mode_changes.all_rows, run.t, reset_map.assembled(run.t, y))
            if contact := penetration_message(point):
                raise StepError("impact", f"{contact} after event {reset_map.reset.name!r}, at t = {run.t:.17g}")
            run.mode_changes.continue_from(run, point, set(), partial(reset_map.with_work, y))
        return False

    def warning(self) -> str:
        """Return which event a terminal event prevented."""
        return f"before event {self._missed!r}, which a run that continues does not repeat" if self._missed else ""

    def release(self) -> None:
        self.system.mechanism.workspaces.release(self.workspace)

    def results(self, run: "RunState") -> dict[str, Any]:
        return {"resets": [(i, name) for i, name in self.occurred if i < len(run.ts)]}

    def statistics(self, run: "RunState") -> JsonObject:
        return {"resets": len(self.occurred)}


def require_known_signals(mech: Mechanism, resets: Sequence[Reset]) -> None:
    """Require that events compare signals of a mechanism with numbers.

    Raises:
        InputError: for another text, or a signal of a whole run; names the event.
        UnknownNameError: for an unknown signal, with the valid ones.
    """
    for reset in resets:
        for key, text, signs in (("signal", reset.signal, "> < ="), ("when", reset.when, "> <")):
            if text:
                _require_comparison(mech, f"{key} of event {reset.name!r}", text, signs)


def _require_comparison(mech: Mechanism, where: str, text: str, signs: str) -> None:
    """Require a signal, one of several signs, and a number.

    Raises:
        InputError: for another text, or a signal of a whole run.
        UnknownNameError: for an unknown signal.
    """
    try:
        signal, _, direction = parse_level_crossing(text)
        if signal == text.strip() or not (direction or "=" in signs):
            raise InputError(f"expected a signal, one of {signs}, and a number, got {text!r:.80}")
        find_point_signal(mech, signal)
    except UnknownNameError as e:
        raise UnknownNameError(f"signal in {where}", e.name, e.valid) from None
    except InputError as e:
        raise InputError(f"{where}: {e}") from None
