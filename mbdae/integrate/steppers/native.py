"""Many steps of a run at once, in the compiled core; Python looks after events, jumps and the user in between."""

from typing import TYPE_CHECKING, Any

from ...backend import choose, status
from ...errors import InputError
from ...mechanism import Compiled, Mechanism, NotCompiled
from ...methods import Tableau
from ...system import State, System

if TYPE_CHECKING:
    from ..run import Run
    from .pace import Pace

SECONDS = 0.05  # of computing between looks at progress and Ctrl-C
MANY = 2000  # steps


def bind(
    problem: Any, tableau: Any, formulation: str, baumgarte: tuple[float, float] | None, backend: str
) -> tuple[System, str]:
    """Bind a problem to a workspace, of the compiled core where that can be.

    Returns:
        The workspace; and, for ``backend="auto"``, what keeps the run from the core, in words, or "".

    Raises:
        InputError: for ``backend="native"`` where the core is missing or does not have what is asked for.
        UnknownNameError: for a back end or a formulation that does not exist.
    """
    missing = lacking(problem, tableau, formulation)
    native = None if missing and backend in ("auto", "native") else choose(backend)
    if native:
        try:
            return problem.system(formulation, baumgarte, native), ""
        except NotCompiled as e:
            missing = str(e)
    if missing and backend == "native":
        raise InputError(f"backend='native' does not have {missing}: take 'auto' or 'python'")
    why = "" if backend == "python" else missing or status()
    return problem.system(formulation, baumgarte), why


def lacking(problem: Any, tableau: Any, formulation: str) -> str:
    """Say in words what the core does not have of a run; "" where it may have it all."""
    if not isinstance(problem, Mechanism):
        return "textbook problems"
    if formulation != "index2":
        return f"formulation {formulation!r}"
    return "" if isinstance(tableau, Tableau) else f"method {tableau.name!r}"


class Core:
    """The compiled core at work on a run.

    Args:
        system: the run's workspace.
        tableau: a half-explicit method.
        project: positions are kept by projection.
    """

    def __init__(self, system: Compiled, tableau: Any, project: bool) -> None:
        self.system, self.tableau = system, tableau
        self.course = system.native.Course()
        self.course.project, self.course.seconds = project, SECONDS

    def advance(self, run: "Run", pace: "Pace", budget: int | None) -> int:
        """Take steps until something asks for Python: at most ``budget``, for `SECONDS` or little more.

        Steps, rejections and the state are those of the run afterwards, also when this is interrupted.

        Returns:
            How many attempts were made; 0 where the next step is one for Python.
        """
        if not pace.ready(run):
            return 0
        c, state, watch = self.course, run.state, run.singular
        c.t, c.t1, c.sign, c.stop, c.end = run.t, run.t1, run.sign, run.leg.stop, run.leg.end
        c.budget = MANY if budget is None else min(budget, MANY)
        c.begin(state.y, state.carry, state.low)
        c.watched = watch is not None
        if watch:
            c.usual, c.before, c.suspect, c.landed, c.zone = watch.limits()
        pace.lend(c)
        try:
            self.system.march(self.tableau, c)
        finally:
            pace.take_back(c)
            run.rejected = (run.rejected or 0) + c.rejected
            self._record(run)
        return c.taken + c.rejected

    def _record(self, run: "Run") -> None:
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
