"""Many steps of a run at once, in the compiled core; Python looks after events, jumps and the user in between."""

from typing import TYPE_CHECKING, Any

from ...system import Array, State, Step
from .stepper import PythonStepper, Stepper

if TYPE_CHECKING:
    from ..run import RunState

SECONDS = 0.05  # of computing between looks at progress and Ctrl-C
MANY = 2000  # steps


class NativeStepper(Stepper):
    """The compiled core at work on a run.

    Args:
        inner: chooses step sizes, and takes the steps that the core cannot take.
        system: the run's workspace.
        tableau: a half-explicit method.
        project: positions are kept by projection.
    """

    backend = "native"

    def __init__(self, inner: PythonStepper, system: Any, tableau: Any, project: bool) -> None:
        self.inner, self.system, self.tableau = inner, system, tableau
        self.course = system.native.Course()
        self.course.project, self.course.seconds = project, SECONDS

    def advance(self, run: "RunState", most: int | None = None) -> None:
        """Take steps until something asks for Python, for `SECONDS` or little more; one in Python where it is needed.

        Steps, rejections and the state are those of the run afterwards, also when this is interrupted.
        """
        if not (self.inner.ready(run) and self._march(run, MANY if most is None else min(most, MANY))):
            self.inner.advance(run)

    def take(self, run: "RunState", h: float) -> Step:  # noqa: D102
        return self.inner.take(run, h)

    def tolerates(self, run: "RunState", y: Array, move: Array) -> bool:  # noqa: D102
        return self.inner.tolerates(run, y, move)

    def settings(self) -> dict[str, Any]:  # noqa: D102
        return self.inner.settings()

    def restart(self) -> None:  # noqa: D102
        self.inner.restart()

    def _march(self, run: "RunState", most: int) -> int:
        """Let the core try steps; return how many, 0 where the next one is one for Python."""
        c, state, watch = self.course, run.state, run.singular
        c.t, c.t1, c.sign, c.stop, c.end = run.t, run.t1, run.sign, run.leg.stop, run.leg.end
        c.budget = most
        c.begin(state.y, state.carry, state.low)
        c.watched = watch is not None
        if watch:
            c.usual, c.before, c.suspect, c.landed, c.zone = watch.limits()
        self.inner.lend(c)
        try:
            self.system.march(self.tableau, c)
        finally:
            self.inner.take_back(c)
            run.rejected = (run.rejected or 0) + c.rejected
            self._record(run)
        return c.taken + c.rejected

    def _record(self, run: "RunState") -> None:
        c, watch, first = self.course, run.singular, len(run.ts) - 1
        if not c.taken:
            return
        run.in_use += [(first + k, tuple(rows)) for k, rows in c.changes]
        state = State(*c.state())
        ts, ys, zs, weakest = c.steps()
        times, i, n = ts.tolist(), 0, c.taken
        finished = times[-1] == run.t1
        if watch:
            watch.begin_step()
        while i < n:
            quiet = watch.quiet(weakest[i : n - finished]) if watch else n
            run.extend(times[i : i + quiet], ys[i : i + quiet], zs[i : i + quiet], state)
            i += quiet
            if watch and i < n:
                run.extend(times[i : i + 1], ys[i : i + 1], zs[i : i + 1], state)
                self.system.weakest, i = float(weakest[i]), i + 1
                watch.step(run, finished and i == n)
